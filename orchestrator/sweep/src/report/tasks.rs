//! Tasks one by one: a table with links to what commands wrote, and bars of a quantity.

use std::fmt::Write;
use std::path::Path;

use airloop_report::plot::svg::escape;

use super::{Values, figures};
use crate::table::Type;

/// Tasks that have a row.
const MAX_ROWS: usize = 1000;
/// Tasks that have a bar of their own.
const MAX_BARS: usize = 150;
/// Characters of the name at a bar.
const MAX_NAME: usize = 34;

/// The table of all tasks of commands as HTML: each leads to its page, or to its folder where it wrote none. Empty
/// where the tasks have no folders.
pub fn table(columns: &[Values], sweep: &Path) -> String {
    let Some(folders) = columns.iter().find(|one| is_folder(one)) else { return String::new() };
    let shown: Vec<&Values> =
        columns.iter().skip(2).filter(|one| !is_folder(one) && one.column.name != "cause").collect();
    let mut html = String::from("<h2>Tasks</h2>\n<table><thead><tr><th>task</th>");
    // Writing into a String cannot fail.
    for one in &shown {
        let _ = write!(html, "<th{}>{}</th>", class(one), escape(&one.column.title()));
    }
    html += "</tr></thead><tbody>\n";
    for (task, folder) in folders.texts.iter().enumerate().take(MAX_ROWS) {
        let _ = match folder.as_str() {
            "" => write!(html, "<tr><td>{task}</td>"),
            folder => write!(html, "<tr><td><a href=\"{}\">{task}</a></td>", escape(&target(folder, sweep))),
        };
        for one in &shown {
            let _ = write!(html, "<td{}>{}</td>", class(one), escape(&one.text(task)));
        }
        html += "</tr>\n";
    }
    html += "</tbody></table>\n";
    if folders.texts.len() > MAX_ROWS {
        let _ =
            writeln!(html, "<p>The first {MAX_ROWS} of {}; results.csv has all.</p>", folders.texts.len());
    }
    html
}

/// Whether a column holds the folders of the tasks.
pub fn is_folder(values: &Values) -> bool {
    values.column.name == "folder" && values.column.kind == Type::Text
}

fn class(values: &Values) -> &'static str {
    if values.column.kind == Type::Text { "" } else { " class=\"n\"" }
}

fn target(folder: &str, sweep: &Path) -> String {
    let pages = ["index.html", "report.html"].map(|page| format!("{folder}/{page}"));
    pages.into_iter().find(|page| sweep.join(page).exists()).unwrap_or_else(|| folder.to_owned())
}

/// A quantity of every task, sorted: bars with the names of the tasks, or dots over the rank where they are many. None
/// if no task has a value.
pub fn figure(quantity: &Values, factors: &[Values]) -> Option<String> {
    let with_value = quantity.numbers.iter().enumerate().filter(|(_, value)| value.is_finite());
    let mut sorted: Vec<(usize, f64)> = with_value.map(|(task, value)| (task, *value)).collect();
    sorted.sort_by(|a, b| b.1.total_cmp(&a.1));
    let title = quantity.column.title();
    match sorted.len() {
        0 => None,
        1..=MAX_BARS => {
            let bars: Vec<(String, f64)> =
                sorted.iter().map(|(task, value)| (name(*task, factors), *value)).collect();
            Some(figures::per_task(&title, &bars))
        }
        count => {
            let points = sorted.iter().enumerate().step_by(count.div_ceil(super::MAX_POINTS));
            let points: Vec<(f64, f64)> =
                points.map(|(rank, (_, value))| (rank as f64 + 1.0, *value)).collect();
            Some(figures::scatter(&points, ("rank", &title)))
        }
    }
}

/// Values of the factors of a task, the last parts of long ones.
fn name(task: usize, factors: &[Values]) -> String {
    let name = factors.iter().map(|factor| factor.text(task)).collect::<Vec<_>>().join(", ");
    let length = name.chars().count();
    match length > MAX_NAME {
        true => std::iter::once('\u{2026}').chain(name.chars().skip(length - MAX_NAME + 1)).collect(),
        false => name,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::Column;

    #[test]
    fn every_task_has_a_bar_until_they_are_many() {
        let values = |count: usize| Values {
            column: Column::new("share", Type::Number),
            numbers: (0..count).map(|k| if k == 3 { f64::NAN } else { k as f64 }).collect(),
            texts: Vec::new(),
        };
        let cases = |count: usize| Values {
            column: Column::new("case", Type::Text),
            numbers: Vec::new(),
            texts: (0..count).map(|k| format!("a_folder_with_a_long_name/of_the_records/{k:03}")).collect(),
        };
        let few = figure(&values(100), &[cases(100)]).unwrap();
        assert_eq!(few.matches("of_the_records/").count(), 99, "one has no value");
        let place = |name: &str| few.find(&format!("/of_the_records/{name}<")).unwrap();
        assert!(place("099") < place("098") && place("001") < place("000"), "the largest is on top");
        let many = figure(&values(9000), &[cases(9000)]).unwrap();
        assert!(!many.contains("of_the_records") && many.contains("rank"));
        assert_eq!(figure(&values(0), &[cases(0)]), None);
    }
}
