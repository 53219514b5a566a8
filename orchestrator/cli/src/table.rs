//! Tables for the terminal: columns as wide as their longest cell.

/// A table as text; columns named in `right` are aligned to the right.
pub fn table(header: &[&str], rows: &[Vec<String>], right: &[usize]) -> String {
    let width = |column: usize| {
        let cells = rows.iter().map(|row| row[column].chars().count());
        cells.chain([header[column].chars().count()]).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..header.len()).map(width).collect();
    let line = |cells: Vec<&str>| {
        let padded: Vec<String> = cells
            .iter()
            .enumerate()
            .map(|(column, cell)| {
                let width = widths[column];
                // Widths of format strings end at 65,535, names in files do not.
                let blank = " ".repeat(width - cell.chars().count());
                if right.contains(&column) { blank + cell } else { [cell, &*blank].concat() }
            })
            .collect();
        padded.join("  ").trim_end().to_owned() + "\n"
    };
    let mut text = line(header.to_vec());
    for row in rows {
        text += &line(row.iter().map(String::as_str).collect());
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up() {
        let rows = vec![vec!["x".into(), "1.5".into()], vec!["theta".into(), "-10".into()]];
        assert_eq!(table(&["signal", "fit"], &rows, &[1]), "signal  fit\nx       1.5\ntheta   -10\n");
    }

    #[test]
    fn cells_may_be_longer_than_a_format_string_allows() {
        let long = "x".repeat(70_000);
        let text = table(&["signal"], &[vec![long.clone()], vec!["y".into()]], &[0]);
        assert_eq!(text.lines().last().map(str::len), Some(70_000));
        assert!(text.contains(&long));
    }
}
