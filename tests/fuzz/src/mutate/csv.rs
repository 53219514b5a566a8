//! Changes of CSV: rows, columns and cells.

use super::{Dice, numbers};

/// The text with one change.
pub fn mutate(text: &str, dice: &mut Dice) -> String {
    let mut rows: Vec<Vec<String>> =
        text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect();
    let at = dice.below(rows.len().max(1));
    let Some(width) = rows.get(at).map(Vec::len) else { return numbers::word(dice) };
    let column = dice.below(width);
    match dice.below(12) {
        0 => drop(rows.remove(at)),
        1 => {
            let row = rows[at].clone();
            rows.insert(at, row);
        }
        2 => {
            let other = dice.below(rows.len());
            rows.swap(at, other);
        }
        3 => rows.truncate(at),
        4 => rows.iter_mut().filter(|row| column < row.len()).for_each(|row| drop(row.remove(column))),
        5 => {
            let value = numbers::value(dice);
            rows.iter_mut()
                .skip(1)
                .filter_map(|row| row.get_mut(column))
                .for_each(|cell| *cell = value.clone());
        }
        6 => rows[at][column] = numbers::word(dice),
        7 => rows[0] = rows[at].clone(),
        8 => {
            let end = ["\r\n", "\r", "\n\n", ";\n", " \n", "\u{2028}"][dice.below(6)];
            return rows.iter().map(|row| row.join(",") + end).collect();
        }
        _ => rows[at][column] = numbers::value(dice),
    }
    rows.iter().map(|row| row.join(",") + "\n").collect()
}
