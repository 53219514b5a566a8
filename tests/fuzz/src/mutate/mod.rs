//! Changes of an input at the level of its form, and of its bytes.

use airloop::series::random::Random;

use crate::input::{Form, Input};

mod bytes;
mod csv;
mod numbers;
mod toml;
mod words;
mod xml;
mod zip;

/// Random choices.
pub struct Dice(pub Random);

impl Dice {
    /// A number below `n`; 0 where `n` is 0.
    pub fn below(&mut self, n: usize) -> usize {
        if n == 0 { 0 } else { (self.0.bits() % n as u64) as usize }
    }

    /// Whether one of `n` equal chances came.
    pub fn one_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }

    /// One of the items.
    pub fn pick<'a, T>(&mut self, items: &'a [T]) -> Option<&'a T> {
        items.get(self.below(items.len()))
    }
}

/// The input with one to six changes.
pub fn input(seed: &Input, dice: &mut Dice) -> Vec<u8> {
    let mut input = seed.clone();
    for _ in 0..=dice.below(6) {
        match &mut input {
            Input::Plain(form, bytes) => *bytes = text(*form, bytes, dice),
            Input::Archive(entries) => zip::mutate(entries, dice),
        }
    }
    let whole = input.bytes();
    // Archives are broken as bytes, too: what stands outside of their entries.
    let is_archive = matches!(input, Input::Archive(_));
    if is_archive && dice.one_in(4) { bytes::mutate(&whole, dice) } else { whole }
}

/// A changed text.
fn text(form: Form, text: &[u8], dice: &mut Dice) -> Vec<u8> {
    if dice.one_in(6) {
        return bytes::mutate(text, dice);
    }
    let text = String::from_utf8_lossy(text);
    let changed = match form {
        Form::Xml => xml::mutate(&text, dice),
        Form::Toml => toml::mutate(&text, dice),
        Form::Csv => csv::mutate(&text, dice),
        Form::Words => words::mutate(&text, dice),
    };
    changed.into_bytes()
}
