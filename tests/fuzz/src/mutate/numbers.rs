//! Values that readers stumble over.

use super::Dice;

const VALUES: [&str; 44] = [
    "0",
    "-0.0",
    "1",
    "-1",
    "2",
    "3",
    "16",
    "0.5",
    "1e-9",
    "1e-12",
    "1e-300",
    "5e-324",
    "1e9",
    "1e15",
    "1e19",
    "1e300",
    "1e308",
    "-1e308",
    "1.7976931348623157e308",
    "1e400",
    "nan",
    "-nan",
    "inf",
    "-inf",
    "NaN",
    "INF",
    "127",
    "255",
    "65536",
    "1000001",
    "2147483647",
    "2147483648",
    "-2147483648",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "-9223372036854775808",
    "18446744073709551615",
    "18446744073709551616",
    "99999999999999999999999999",
    "0x10",
    "1_000",
    "+1",
    "1,5",
];

/// A number, or what looks like one.
pub fn value(dice: &mut Dice) -> String {
    match dice.below(5) {
        0 => format!("{:e}", dice.0.symmetric() * 10f64.powi(dice.below(40) as i32 - 20)),
        _ => dice.pick(&VALUES).copied().unwrap_or("0").to_owned(),
    }
}

/// A text that is no number.
pub fn word(dice: &mut Dice) -> String {
    let words =
        ["", " ", "x", "\u{e9}\u{4e2d}\u{1f600}", "a.b[1]", "../..", "/", "true", "\\", "\u{202e}", "s"];
    match dice.below(14) {
        0 => "a".repeat(1 << dice.below(18)),
        1 => "9".repeat(1 + dice.below(400)),
        2 => "(".repeat(1 << dice.below(16)),
        _ => dice.pick(&words).copied().unwrap_or("").to_owned(),
    }
}

/// Places of numbers in a text: begin and end in bytes.
pub fn places(text: &str) -> Vec<(usize, usize)> {
    let bytes = text.as_bytes();
    let mut found = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let begins = bytes[at].is_ascii_digit()
            && (at == 0 || !(bytes[at - 1].is_ascii_alphanumeric() || bytes[at - 1] == b'_'));
        if !begins {
            at += 1;
            continue;
        }
        let from = if at > 0 && bytes[at - 1] == b'-' { at - 1 } else { at };
        while at < bytes.len() && (bytes[at].is_ascii_digit() || matches!(bytes[at], b'.' | b'e' | b'E')) {
            at += 1;
            if at < bytes.len() && matches!(bytes[at], b'-' | b'+') && matches!(bytes[at - 1], b'e' | b'E') {
                at += 1;
            }
        }
        found.push((from, at));
    }
    found
}

/// The text with one of its numbers replaced.
pub fn replace_one(text: &str, dice: &mut Dice) -> String {
    let places = places(text);
    match dice.pick(&places) {
        Some(&(from, to)) => format!("{}{}{}", &text[..from], value(dice), &text[to..]),
        None => text.to_owned() + &value(dice),
    }
}
