//! Changes of archives: their entries, names, and the files in them.

use super::{Dice, numbers};
use crate::input::Form;

/// Changes one thing.
pub fn mutate(entries: &mut Vec<(String, Vec<u8>)>, dice: &mut Dice) {
    let at = dice.below(entries.len());
    if entries.is_empty() {
        return;
    }
    let (name, bytes) = entries[at].clone();
    match dice.below(12) {
        0 => drop(entries.remove(at)),
        1 => entries.insert(at, (name + "/", Vec::new())),
        2 => entries.push((format!("{name}{}", dice.below(9)), bytes)),
        3 => {
            let names = [
                "../x",
                "/etc/x",
                "C:\\x",
                "a\\b",
                ".",
                "",
                "a/../../b",
                "modelDescription.xml",
                "a//b",
                "con",
            ];
            let long = dice.one_in(4).then(|| "n".repeat(1 << (4 + dice.below(12))));
            entries[at].0 = long.unwrap_or_else(|| names[dice.below(names.len())].to_owned());
        }
        4 => {
            let folders = 1 + dice.below(300);
            entries.push(("d/".repeat(folders) + "x", numbers::word(dice).into_bytes()));
        }
        5 => entries[at].1 = vec![0; 1 << dice.below(21)],
        _ => {
            let form = match name.rsplit_once('.').map(|(_, end)| end) {
                Some("xml" | "ssd" | "ssv") => Form::Xml,
                Some("toml") => Form::Toml,
                _ => Form::Words,
            };
            entries[at].1 = super::text(form, &bytes, dice);
        }
    }
}
