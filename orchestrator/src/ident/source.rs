//! Experiments that are read in blocks, as often as an algorithm needs: from memory or from a file.

use super::record::{Error, Record};

/// Samples of a block.
pub const BLOCK: usize = 4096;

/// Consecutive samples of one experiment, with some before them.
#[derive(Debug, Clone, Copy)]
pub struct Window<'a> {
    /// Inputs, shape \[n_u\]\[before + n\].
    pub inputs: &'a [&'a [f64]],
    /// Outputs, shape \[n_y\]\[before + n\].
    pub outputs: &'a [&'a [f64]],
    /// Samples that were there before; fewer than asked for only at the beginning of the experiment.
    pub before: usize,
    /// Index in the experiment of the first new sample.
    pub at: usize,
}

impl Window<'_> {
    /// Samples, those before included.
    pub fn len(&self) -> usize {
        self.outputs.first().or(self.inputs.first()).map_or(0, |column| column.len())
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// An experiment that can be read from the beginning as often as wanted.
pub trait Source {
    /// What messages call it.
    fn name(&self) -> &str;
    /// Number of samples.
    fn samples(&self) -> usize;
    /// Time of sample `k` \[s\].
    fn time(&self, k: usize) -> f64;
    /// Hands all samples to `take` in order; every window has the last `history` samples of the one before in front.
    ///
    /// # Errors
    /// Whatever reading comes to.
    fn windows(&self, history: usize, take: &mut dyn FnMut(Window)) -> Result<(), Error>;
}

impl Source for Record {
    fn name(&self) -> &str {
        &self.name
    }

    fn samples(&self) -> usize {
        self.len()
    }

    fn time(&self, k: usize) -> f64 {
        Record::time(self, k)
    }

    fn windows(&self, history: usize, take: &mut dyn FnMut(Window)) -> Result<(), Error> {
        let mut at = 0;
        while at < self.len() {
            let end = (at + BLOCK).min(self.len());
            let before = history.min(at);
            let inputs: Vec<&[f64]> = self.inputs.iter().map(|column| &column[at - before..end]).collect();
            let outputs: Vec<&[f64]> = self.outputs.iter().map(|column| &column[at - before..end]).collect();
            take(Window { inputs: &inputs, outputs: &outputs, before, at });
            at = end;
        }
        Ok(())
    }
}
