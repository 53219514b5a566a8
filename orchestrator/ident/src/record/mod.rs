//! One experiment: inputs and outputs sampled at one uniform rate; how it is read and what is checked.
//!
//! | module | what |
//! |--------|------|
//! | [`sampling`] | one uniform sample time from time stamps |
//! | [`channel`] | what the values of one column say: missing, constant, saturated, held |
//! | [`read`] | one file to a [`Record`] or, without keeping the values, to a [`Survey`] |
//! | [`set`] | several files for one identification: names, units, rates and excitation agree |
//! | [`detrend`] | operating point and trend |

pub mod channel;
pub mod detrend;
mod error;
pub mod read;
pub mod sampling;
pub mod set;

pub use detrend::Detrend;
pub use error::Error;
pub use read::Survey;
pub use set::Experiments;

use airloop_series::TimeSeries;

/// Sampled inputs and outputs of one experiment.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Record {
    /// Name in messages, usually the file it was read from.
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

    /// The record in a series: channels `inputs` and `outputs` by name; with what should be known about it.
    ///
    /// ```
    /// use airloop_ident::record::Record;
    /// use airloop_series::csv;
    /// let rows: String = (0..20).map(|k| format!("{},{},{}\n", 0.1 * f64::from(k), k % 3, k % 5)).collect();
    /// let series = csv::parse(&format!("time,u,y\n{rows}"), "step.csv".as_ref()).unwrap();
    /// let (record, notes) = Record::from_series(&series, "step.csv", &["u".into()], &["y".into()]).unwrap();
    /// assert_eq!((record.sample_time, record.len(), notes.len()), (0.1, 20, 0));
    /// ```
    ///
    /// # Errors
    /// [`Error`] for a channel that is not there, and for every kind of sampling or values that cannot be used.
    pub fn from_series(
        series: &TimeSeries,
        name: &str,
        inputs: &[String],
        outputs: &[String],
    ) -> Result<(Record, Vec<String>), Error> {
        read::from_series(series, name, inputs, outputs)
    }
}
