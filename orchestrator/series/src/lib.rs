//! Named signals over one common time axis, read from and written to CSV, looked up between samples.
//!
//! Everything measured or simulated passes through [`TimeSeries`]. What a signal means (which component, which
//! connector) is left to the layers above. Start with [`TimeSeries::new`] or [`csv::read`]. [`mod@declared`] reads the
//! TOML files that users write.

pub mod compound_unit;
pub mod csv;
pub mod declared;
pub mod fails_once;
pub mod file;
pub mod frame;
mod header;
pub mod memory;
pub mod names;
pub mod random;
pub mod resample;
pub mod rows;
pub mod schema;
pub mod scratch;
pub mod stream;
pub mod uniform;
pub mod units;

pub use resample::Interpolation;

/// One signal: a value for every point of the time axis it belongs to.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// Name, unique within its series (`component.variable`, or the plain name of a system connector).
    pub name: String,
    /// Unit of the values as text (`N`, `m/s`), if known.
    pub unit: Option<String>,
    /// Values, shape \[n\] like the time axis.
    pub values: Vec<f64>,
    /// Whether some values were written as `true` or `false` (1 and 0 here): only a Boolean may be.
    pub words: bool,
}

/// Signals that share a strictly increasing time axis.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TimeSeries {
    time: Vec<f64>,
    channels: Vec<Channel>,
}

/// Reason why a series cannot be built.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The time axis stands still, runs backwards or is not finite.
    #[error(
        "time must be finite and increase from sample to sample, but sample {index} is at {after} s after {before} s"
    )]
    Time {
        /// 0-based index of the offending sample.
        index: usize,
        /// Time \[s\] of the sample before it (negative infinity for the first).
        before: f64,
        /// Time \[s\] of the offending sample.
        after: f64,
    },
    /// A channel has another number of samples than the time axis.
    #[error("channel `{name}` has {found} samples, the time axis {expected}; give one value per time")]
    Length {
        /// Channel.
        name: String,
        /// Samples of the channel.
        found: usize,
        /// Samples of the time axis.
        expected: usize,
    },
    /// Two channels of one name.
    #[error("channel `{name}` appears twice; rename one of them")]
    Duplicate {
        /// Channel.
        name: String,
    },
}

impl TimeSeries {
    /// A series without channels on the time axis `time` \[s\], shape \[n\].
    ///
    /// ```
    /// use airloop_series::TimeSeries;
    /// let mut series = TimeSeries::new(vec![0.0, 0.5]).unwrap();
    /// series.push("x", Some("m".into()), vec![1.0, 2.0]).unwrap();
    /// assert_eq!(series.channel("x").unwrap().values[1], 2.0);
    /// ```
    ///
    /// # Errors
    /// [`Error::Time`] unless the times are finite and strictly increasing.
    pub fn new(time: Vec<f64>) -> Result<TimeSeries, Error> {
        let mut before = f64::NEG_INFINITY;
        for (index, &after) in time.iter().enumerate() {
            if !after.is_finite() || after <= before {
                return Err(Error::Time { index, before, after });
            }
            before = after;
        }
        Ok(TimeSeries { time, channels: Vec::new() })
    }

    /// A series with all its channels (name, unit, values), however many there are.
    ///
    /// | name | shape | unit | meaning |
    /// |------|-------|------|---------|
    /// | `time` | \[n\] | s | finite and strictly increasing |
    /// | values of a channel | \[n\] | that of the channel | samples at `time` |
    ///
    /// # Errors
    /// Same as [`TimeSeries::new`] and [`TimeSeries::push`].
    pub fn with_channels(
        time: Vec<f64>,
        channels: Vec<(String, Option<String>, Vec<f64>)>,
    ) -> Result<TimeSeries, Error> {
        let mut series = TimeSeries::new(time)?;
        let mut names = std::collections::HashSet::with_capacity(channels.len());
        if let Some((name, ..)) = channels.iter().find(|(name, ..)| !names.insert(name)) {
            return Err(Error::Duplicate { name: name.clone() });
        }
        drop(names);
        for (name, unit, values) in channels {
            if values.len() != series.time.len() {
                return Err(Error::Length { name, found: values.len(), expected: series.time.len() });
            }
            series.channels.push(Channel { name, unit, values, words: false });
        }
        Ok(series)
    }

    /// Adds a channel with one value per time, shape \[n\], in `unit`.
    ///
    /// # Errors
    /// [`Error::Length`] or [`Error::Duplicate`].
    pub fn push(
        &mut self,
        name: impl Into<String>,
        unit: Option<String>,
        values: Vec<f64>,
    ) -> Result<(), Error> {
        let name = name.into();
        if values.len() != self.time.len() {
            return Err(Error::Length { name, found: values.len(), expected: self.time.len() });
        }
        if self.channel(&name).is_some() {
            return Err(Error::Duplicate { name });
        }
        self.channels.push(Channel { name, unit, values, words: false });
        Ok(())
    }

    /// The same series with the other sign of the channel `name`.
    #[must_use]
    pub fn negated(&self, name: &str) -> TimeSeries {
        let mut series = self.clone();
        for channel in series.channels.iter_mut().filter(|channel| channel.name == name) {
            channel.values.iter_mut().for_each(|value| *value = -*value);
        }
        series
    }

    /// Time axis \[s\], shape \[n\].
    pub fn time(&self) -> &[f64] {
        &self.time
    }

    /// Number of samples n.
    pub fn len(&self) -> usize {
        self.time.len()
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.time.is_empty()
    }

    /// All channels in the order they were added.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// The channel of this name.
    pub fn channel(&self, name: &str) -> Option<&Channel> {
        self.channels.iter().find(|channel| channel.name == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_that_stands_still_is_refused_with_its_index() {
        let error = TimeSeries::new(vec![0.0, 0.1, 0.1]).unwrap_err();
        assert!(matches!(error, Error::Time { index: 2, .. }), "{error}");
        assert!(TimeSeries::new(vec![f64::NAN]).is_err());
    }

    #[test]
    fn channels_have_one_value_per_time_and_one_name_each() {
        let mut series = TimeSeries::new(vec![0.0, 0.1]).unwrap();
        series.push("x", None, vec![1.0, 2.0]).unwrap();
        assert!(matches!(series.push("x", None, vec![1.0, 2.0]), Err(Error::Duplicate { .. })));
        assert!(matches!(series.push("y", None, vec![1.0]), Err(Error::Length { .. })));
    }
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
