//! Names that were meant: those nearest to one that is not known.

/// Names beyond which an answer only lists the nearest.
const MAX_NAMES_LISTED: usize = 3;
/// Names listed where none is near.
const NAMES_LISTED_WITHOUT_NEAR_ONE: usize = 12;

/// A number and what is counted, whose plural ends in s: `1 state`, `2 states`.
///
/// ```
/// use airloop_series::names::counted;
/// assert_eq!((counted(1, "state"), counted(0, "state")), ("1 state".into(), "0 states".into()));
/// ```
pub fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// Suggestion for an unknown name: the nearest known names, or the known names where none is near.
pub fn suggestion<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let known: Vec<&str> = known.into_iter().collect();
    let far = name.chars().count().div_ceil(3).max(2);
    let mut near: Vec<(usize, &str)> =
        known.iter().map(|other| (closeness(name, other), *other)).filter(|(d, _)| *d <= far).collect();
    near.sort_by_key(|(distance, _)| *distance);
    near.truncate(MAX_NAMES_LISTED);
    if !near.is_empty() {
        let near: Vec<String> = near.iter().map(|(_, name)| format!("`{name}`")).collect();
        return format!("did you mean {}?", near.join(" or "));
    }
    let more = known.len().saturating_sub(NAMES_LISTED_WITHOUT_NEAR_ONE);
    let listed = known[..known.len() - more].join(", ");
    match (known.is_empty(), more) {
        (true, _) => "there is none".into(),
        (false, 0) => format!("known are: {listed}"),
        (false, more) => format!("known are: {listed} and {more} more"),
    }
}

/// A hint where a column is asked for by its name and unit, as they stand in the header of a file; else nothing.
pub fn without_unit<'a>(column: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let name = column.split_once(" [").map(|(name, _)| name);
    let name = name.filter(|name| known.into_iter().any(|known| known == *name));
    name.map(|name| format!(" (its name is `{name}`, without the unit)")).unwrap_or_default()
}

/// Distance of two names; the last part of a path counts like a name of its own.
fn closeness(name: &str, other: &str) -> usize {
    let last = other.rsplit('.').next().unwrap_or(other);
    let of_last = if last == other { usize::MAX } else { distance(name, last) };
    distance(name, other).min(of_last)
}

/// Insertions, deletions and replacements between two texts (Levenshtein), letters of either case alike.
fn distance(a: &str, b: &str) -> usize {
    let letters = |text: &str| -> Vec<char> { text.to_lowercase().chars().collect() };
    let (a, b) = (letters(a), letters(b));
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, from) in a.iter().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, to) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(from != to);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_of_levenshtein() {
        for (a, b, expected) in
            [("kitten", "sitting", 3), ("", "ab", 2), ("Omega", "omega", 0), ("abc", "acb", 2)]
        {
            assert_eq!(distance(a, b), expected, "{a} {b}");
        }
    }

    #[test]
    fn the_nearest_name_is_offered_also_by_its_last_part() {
        let known = ["x", "theta", "omega", "actuator.z[1]"];
        assert_eq!(suggestion("tetha", known), "did you mean `theta`?");
        assert!(suggestion("z[1]", known).starts_with("did you mean `actuator.z[1]`"));
        assert_eq!(suggestion("velocity", known), "known are: x, theta, omega, actuator.z[1]");
        assert_eq!(suggestion("u", []), "there is none");
    }
}
