//! The child: makes inputs, writes each to its file before it is read, and says its number.

use std::io::Write;
use std::path::Path;

use airloop::series::random::Random;

use crate::mutate::{self, Dice};
use crate::{corpus, targets::Target};

/// Reads `count` inputs of a target, from the number `from` on, in the folder `place`.
pub fn run(target: Target, place: &Path, seed: u64, from: u64, count: u64) -> Result<(), String> {
    let seeds = corpus::seeds(target);
    if seeds.is_empty() {
        return Err(format!("the target {} has no inputs to mutate", target.name));
    }
    let said = |error: std::io::Error| format!("{}: {error}", place.display());
    corpus::furnish(target, place).map_err(said)?;
    let file = place.join(target.file);
    let mut out = std::io::stdout();
    for number in from..from + count {
        let mut dice = Dice(Random::numbered(seed, number));
        let input = &seeds[dice.below(seeds.len())];
        std::fs::write(&file, mutate::input(input, &mut dice)).map_err(said)?;
        writeln!(out, "{number}").and_then(|()| out.flush()).map_err(said)?;
        (target.read)(&file);
    }
    Ok(())
}

/// Reads one file, which is copied to the place.
pub fn one(target: Target, place: &Path, file: &Path) -> Result<(), String> {
    corpus::furnish(target, place).map_err(|error| format!("{}: {error}", place.display()))?;
    let copy = place.join(target.file);
    std::fs::copy(file, &copy).map_err(|error| format!("{}: {error}", file.display()))?;
    println!("0");
    (target.read)(&copy);
    Ok(())
}
