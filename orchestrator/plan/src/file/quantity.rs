//! Numbers with units as problem files write them: `0.15`, `"150 mm"`, `"180 deg"`.

use super::source::Place;

/// A number, with the name of its unit where one was written.
#[derive(Debug, Clone, PartialEq)]
pub struct Quantity {
    /// Number as written.
    pub value: f64,
    /// Unit as written; none: that of the variable.
    pub unit: Option<String>,
    /// Place in the file.
    pub place: Place,
}

/// Number and unit of a text.
///
/// # Errors
/// Fault of the text, in words.
pub fn parse(text: &str) -> Result<(f64, Option<String>), String> {
    let text = text.trim();
    let hint = "write a number and a unit, such as \"150 mm\"";
    if text.is_empty() {
        return Err(format!("there is no number; {hint}"));
    }
    // The longest beginning that is a number: units such as `m` never extend it, `1e-3` does.
    let ends: Vec<usize> = text.char_indices().map(|(at, c)| at + c.len_utf8()).collect();
    let number = ends.iter().rev().find_map(|&end| {
        let digits = text[..end].trim_end();
        let plain = digits.chars().all(|c| c.is_ascii_digit() || "+-.eE".contains(c));
        plain.then(|| digits.parse::<f64>().ok().map(|value| (value, end))).flatten()
    });
    let Some((value, end)) = number else {
        return Err(format!("`{text}` does not begin with a number; {hint}"));
    };
    if !value.is_finite() {
        return Err(format!("`{text}` is not finite"));
    }
    let unit = text[end..].trim();
    Ok((value, (!unit.is_empty()).then(|| unit.to_owned())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_units_are_told_apart() {
        for (text, value, unit) in [
            ("150 mm", 150.0, Some("mm")),
            ("2s", 2.0, Some("s")),
            ("1e-3 m", 1e-3, Some("m")),
            ("-4.5", -4.5, None),
            ("3 1/s", 3.0, Some("1/s")),
            (" 180deg ", 180.0, Some("deg")),
        ] {
            assert_eq!(parse(text), Ok((value, unit.map(str::to_owned))), "{text}");
        }
    }

    #[test]
    fn texts_without_a_number_are_refused_with_an_example() {
        for text in ["", "mm", "much", "inf m", "1e999 m"] {
            let message = parse(text).expect_err(text);
            assert!(message.contains("150 mm") || message.contains("not finite"), "{message}");
        }
    }
}
