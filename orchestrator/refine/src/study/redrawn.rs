//! Records of a study drawn again: what a system gives on them, plus what it leaves of the measured ones in another
//! order.
//!
//! With the declared system nothing is missing in such records; with the amended system of a report its effects are.
//! A search over many draws tells how often it finds something where nothing is, or again what it found.
//!
//! The residuals keep their correlation in time and among outputs: they are moved in blocks, all outputs together (the
//! circular block bootstrap of Politis and Romano, 1992).

use std::path::Path;

use super::declaration::{File, Role};
use super::model::Study;
use super::replay;
use crate::Error;
use crate::engine::noise::Noise;

/// Autocorrelation below which residuals are no longer one swing.
const MAX_CORRELATION: f64 = 0.367_879_441_171_442_33;
/// Length of a block, in times until the autocorrelation falls below that.
const CORRELATION_TIMES_OF_A_BLOCK: usize = 4;
/// Fewest blocks of a record.
const MIN_BLOCKS: usize = 4;

/// Outputs of the records of a study, drawn again.
#[derive(Debug, Clone)]
pub struct Redrawn {
    records: Vec<Record>,
    /// A sentence on what was drawn.
    pub note: String,
}

#[derive(Debug, Clone)]
struct Record {
    name: String,
    role: Role,
    /// `[outputs][n]`, in the units of the study.
    outputs: Vec<Vec<f64>>,
}

impl Redrawn {
    /// Outputs from simulations of `system` (`.ssd`, `.ssp` or `.fmu`; none: the declared system, fitted) and blocks of
    /// their residuals, which `seed` chooses.
    ///
    /// # Errors
    /// Those of [`replay::replay`].
    pub fn draw(file: &File, system: Option<&Path>, seed: u64) -> Result<Redrawn, Error> {
        let mut records = Vec::new();
        for (index, own) in replay::simulated(file, system)?.into_iter().enumerate() {
            let n = own.measured.len() / own.outputs;
            let residuals: Vec<f64> = own.measured.iter().zip(&own.predicted).map(|(m, p)| m - p).collect();
            let residuals: Vec<&[f64]> = residuals.chunks(n).collect();
            let block = own.window.unwrap_or_else(|| block(&residuals));
            let sources = sources(n, block, own.window.unwrap_or(1), &mut Noise::new(seed, index as u64));
            let drawn = |(predicted, residual): (&[f64], &&[f64])| {
                predicted.iter().zip(&sources).map(|(value, &from)| value + residual[from]).collect()
            };
            let outputs = own.predicted.chunks(n).zip(&residuals).map(drawn).collect();
            records.push(Record { name: own.record, role: own.role, outputs });
        }
        let model = system.map_or("the declared system".to_owned(), |path| path.display().to_string());
        let note = format!(
            "The records are drawn again, with seed {seed}: outputs are those of {model} plus blocks of what it leaves of the measured ones."
        );
        Ok(Redrawn { records, note })
    }

    /// Puts the outputs in place of the measured ones.
    pub(super) fn replace(&self, study: &mut Study) {
        for record in &mut study.records {
            let mut drawn = self.records.iter();
            if let Some(own) = drawn.find(|own| own.name == record.name && own.role == record.role) {
                record.outputs.clone_from(&own.outputs);
            }
        }
    }
}

/// Length of a block \[samples\] of residuals `[outputs][n]`: four times that until the slowest of them is no longer
/// correlated with itself, at most a quarter of the record.
fn block(residuals: &[&[f64]]) -> usize {
    let n = residuals.first().map_or(0, |own| own.len());
    let most = (n / MIN_BLOCKS).max(1);
    let correlated = |lag: usize| residuals.iter().any(|own| autocorrelation(own, lag) > MAX_CORRELATION);
    let mut lag = 1;
    while CORRELATION_TIMES_OF_A_BLOCK * lag < most && correlated(lag) {
        lag += (lag / 4).max(1);
    }
    (CORRELATION_TIMES_OF_A_BLOCK * lag).min(most)
}

/// Autocorrelation of residuals at a lag; 0 without any.
fn autocorrelation(values: &[f64], lag: usize) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let power: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    let products = values.iter().zip(values.iter().skip(lag)).map(|(a, b)| (a - mean) * (b - mean));
    if power > 0.0 { products.sum::<f64>() / power } else { 0.0 }
}

/// Where the residual of each of `n` samples comes from: blocks that begin at multiples of `unit` and go on at the
/// beginning of the record.
fn sources(n: usize, block: usize, unit: usize, noise: &mut Noise) -> Vec<usize> {
    let mut sources = Vec::with_capacity(n);
    while sources.len() < n {
        let begins = (n / unit).max(1);
        let begin = unit * ((noise.uniform() * begins as f64) as usize).min(begins - 1);
        let left = n - sources.len();
        sources.extend((begin..begin + block.min(left)).map(|k| k % n));
    }
    sources
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_four_correlation_times_long() {
        let mut noise = Noise::new(1, 0);
        let white: Vec<f64> = (0..100_000).map(|_| noise.normal()).collect();
        assert_eq!(block(&[&white]), 4);
        // A first-order process has the autocorrelation exp(-lag/50).
        let pole = (-1.0f64 / 50.0).exp();
        let slow: Vec<f64> = white
            .iter()
            .scan(0.0, |state, e| {
                *state = pole * *state + e;
                Some(*state)
            })
            .collect();
        let found = block(&[&white, &slow]);
        assert!((180..=260).contains(&found), "{found}");
        assert_eq!(block(&[&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]]), 2);
    }

    #[test]
    fn samples_come_from_whole_blocks_and_every_sample_is_drawn_as_often() {
        let mut noise = Noise::new(2, 0);
        let mut counts = [0usize; 103];
        for _ in 0..2000 {
            let own = sources(103, 10, 1, &mut noise);
            assert_eq!(own.len(), 103);
            for part in own.chunks(10) {
                assert!(part.windows(2).all(|pair| pair[1] == (pair[0] + 1) % 103));
            }
            own.iter().for_each(|&k| counts[k] += 1);
        }
        let (least, most) = (counts.iter().min(), counts.iter().max());
        assert!(least > Some(&1700) && most < Some(&2300), "{least:?} {most:?}");
        // Windows stay whole.
        let own = sources(100, 20, 20, &mut noise);
        assert!(own.chunks(20).all(|part| part[0] % 20 == 0 && part[19] == part[0] + 19));
    }
}
