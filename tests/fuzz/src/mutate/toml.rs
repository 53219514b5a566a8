//! Changes of TOML: tables, keys and values, line by line.

use super::{Dice, numbers};

/// The text with one change.
pub fn mutate(text: &str, dice: &mut Dice) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let at = dice.below(lines.len().max(1));
    if lines.is_empty() {
        return numbers::word(dice);
    }
    match dice.below(12) {
        0 => drop(lines.remove(at)),
        1 => {
            let line = lines[at].clone();
            (0..=dice.below(30)).for_each(|_| lines.insert(at, line.clone()));
        }
        2 => {
            let other = dice.below(lines.len());
            lines.swap(at, other);
        }
        3 => {
            // A whole table again, or away.
            let next = |from: usize| (from..lines.len()).find(|&line| lines[line].starts_with('['));
            let Some(begin) = next(at) else { return text.to_owned() };
            let end = next(begin + 1).unwrap_or(lines.len());
            let table: Vec<String> = match dice.one_in(2) {
                true => Vec::new(),
                false => lines[begin..end].iter().cycle().take(3 * (end - begin)).cloned().collect(),
            };
            lines.splice(begin..end, table);
        }
        4 | 5 => {
            let line = lines[at].clone();
            if let Some((key, _)) = line.split_once('=') {
                lines[at] = format!("{key}= {}", any(dice));
            }
        }
        6 => {
            let line = lines[at].clone();
            if let Some((key, value)) = line.split_once('=') {
                let other = dice.below(lines.len());
                let other_key = lines[other].split_once('=').map(|(key, _)| key.to_owned());
                lines[at] = match (other_key, dice.below(2)) {
                    (Some(other), 0) => format!("{other}={value}"),
                    _ => format!("{key}{}={value}", dice.below(10)),
                };
            }
        }
        _ => {
            // Numbers carry most of the meaning.
            let with: Vec<usize> =
                (0..lines.len()).filter(|&line| !numbers::places(&lines[line]).is_empty()).collect();
            if let Some(&line) = dice.pick(&with) {
                lines[line] = numbers::replace_one(&lines[line], dice);
            }
        }
    }
    lines.join("\n") + "\n"
}

/// A value of any type.
fn any(dice: &mut Dice) -> String {
    match dice.below(9) {
        0 => numbers::value(dice),
        1 => format!("{:?}", numbers::word(dice)),
        2 => "[]".into(),
        3 => "{}".into(),
        4 => format!("[{}, {}]", numbers::value(dice), numbers::value(dice)),
        5 => "true".into(),
        6 => {
            let depth = 1 << dice.below(12);
            "[".repeat(depth) + &"]".repeat(depth)
        }
        7 => "1979-05-27T07:32:00Z".into(),
        _ => format!("\"{} {}\"", numbers::value(dice), ["s", "m", "deg", "N", "ms", ""][dice.below(6)]),
    }
}
