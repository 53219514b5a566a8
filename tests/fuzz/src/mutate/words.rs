//! Changes of short texts such as units and formulas: their words and numbers.

use super::{Dice, numbers};

/// The text with one change.
pub fn mutate(text: &str, dice: &mut Dice) -> String {
    let pieces = [
        "*", "/", "^", "(", ")", ".", "-", "m", "s", "kg", "tanh(", "sqrt(", "v", "x", "p[0]", " ", ",", "1",
    ];
    let piece = dice.pick(&pieces).copied().unwrap_or("").to_owned();
    let at = (0..=dice.below(text.len() + 1)).rev().find(|&at| text.is_char_boundary(at)).unwrap_or(0);
    match dice.below(6) {
        0 => numbers::replace_one(text, dice),
        1 => format!("{}{}", &text[..at], &text[at..].chars().skip(1).collect::<String>()),
        2 => text.repeat(1 + dice.below(3)),
        3 => format!("{}{}{}", &text[..at], numbers::word(dice), &text[at..]),
        4 => format!("{}{}{}", &text[..at], piece.repeat(1 + dice.below(2000)), &text[at..]),
        _ => format!("{}{piece}{}", &text[..at], &text[at..]),
    }
}
