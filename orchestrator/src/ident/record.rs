//! One experiment: inputs and outputs sampled at one uniform rate.

/// Sampled inputs and outputs of one experiment.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Record {
    /// What messages call it, as a rule the file it was read from.
    pub name: String,
    /// Sample time \[s\].
    pub sample_time: f64,
    /// Time of the first sample \[s\].
    pub start: f64,
    /// Inputs u, shape \[n_u\]\[n\].
    pub inputs: Vec<Vec<f64>>,
    /// Outputs y, shape \[n_y\]\[n\].
    pub outputs: Vec<Vec<f64>>,
}

impl Record {
    /// Number of samples n.
    pub fn len(&self) -> usize {
        self.outputs.first().or(self.inputs.first()).map_or(0, Vec::len)
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Time of sample `k` \[s\].
    pub fn time(&self, k: usize) -> f64 {
        self.start + k as f64 * self.sample_time
    }
}
