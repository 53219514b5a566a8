//! Command signals for experiments: chirps, random stairs, multisines, pseudo-random binary sequences.
//!
//! Every signal is a vector of samples at `k Ts`, zero-order hold in between, and depends on its settings and seed
//! alone (`airloop_series::random`). Reading and writing files is left to others. Start with [`Signal::samples`].

pub mod chirp;
pub mod fourier;
pub mod multisine;
pub mod prbs;
pub mod stairs;
pub mod supply;

use std::ops::Range;

/// A band of frequencies \[Hz\].
pub type Band = Range<f64>;

/// Reason why a signal cannot be made.
#[derive(Debug, thiserror::Error, PartialEq)]
#[allow(missing_docs, reason = "setting, value and what is allowed, as named in each message")]
pub enum Error {
    /// A setting out of range.
    #[error("{what} is {value}{}{unit}, but {allowed}", if unit.is_empty() { "" } else { " " })]
    Setting { what: &'static str, value: f64, unit: &'static str, allowed: String },
    /// The command leaves what the supply can give.
    #[error(
        "the command runs from {lowest:.4} to {highest:.4}, but the limits are {lower:.4} to {upper:.4}; lower the amplitude to at most {largest:.4} or change the offset"
    )]
    Limit { lowest: f64, highest: f64, lower: f64, upper: f64, largest: f64 },
    /// Two signals for one file.
    #[error(
        "the amplitude {amplitude} is given twice, and both would be the same file; give each once, or --join for one after another in one file"
    )]
    Repeated { amplitude: f64 },
    /// A file that is not a command.
    #[error("{}: this file is there and is not a command with the same column; choose another name", path.display())]
    File { path: std::path::PathBuf },
}

/// Shape of a command without its amplitude: its largest value is at most 1.
#[derive(Debug, Clone, PartialEq)]
pub enum Signal {
    /// A sine whose frequency runs through the band.
    Chirp {
        /// First and last frequency \[Hz\]; the last may be the lower.
        band: Band,
        /// Change of the frequency over time.
        sweep: chirp::Sweep,
    },
    /// Random levels, each held for a random time.
    Stairs {
        /// Shortest and longest time at a level \[s\].
        hold: Range<f64>,
    },
    /// Sines of equal amplitude with phases for a low peak.
    Multisine {
        /// Lowest and highest frequency \[Hz\].
        band: Band,
        /// Period \[s\]; the sines are multiples of its inverse. None: the duration.
        period: Option<f64>,
    },
    /// Two levels in a pseudo-random order of maximal length.
    Prbs {
        /// Time between possible switches \[s\].
        clock: f64,
        /// Order n: the sequence repeats after 2^n - 1 clock times.
        order: u32,
    },
}

/// Settings common to all signals: amplitude, offset, timing and seed.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Largest deviation from the offset.
    pub amplitude: f64,
    /// Level in the middle, also that of the rests.
    pub offset: f64,
    /// Length of the signal without rests \[s\].
    pub duration: f64,
    /// Sample time \[s\].
    pub sample_time: f64,
    /// Time at the offset before the signal \[s\].
    pub rest_before: f64,
    /// Time at the offset after the signal \[s\].
    pub rest_after: f64,
    /// Seed of random choices.
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            amplitude: 1.0,
            offset: 0.0,
            duration: 20.0,
            sample_time: 1e-3,
            rest_before: 0.0,
            rest_after: 0.0,
            seed: 1,
        }
    }
}

/// More samples than this are a slip of the unit.
const MOST_SAMPLES: f64 = 1e8;

impl Settings {
    /// Refuses settings out of range.
    ///
    /// # Errors
    /// [`Error::Setting`].
    pub fn validate(&self) -> Result<(), Error> {
        let above_zero = [("the duration", self.duration), ("the sample time", self.sample_time)];
        for (what, value) in above_zero {
            check(what, value, "s", value > 0.0, || "it must be above zero".into())?;
        }
        for (what, value) in [("the rest before", self.rest_before), ("the rest after", self.rest_after)] {
            check(what, value, "s", value >= 0.0, || "it must not be negative".into())?;
        }
        for (what, value) in [("the amplitude", self.amplitude), ("the offset", self.offset)] {
            check(what, value, "", true, || "it must be a finite number".into())?;
        }
        check("the amplitude", self.amplitude, "", self.amplitude > 0.0, || "it must be above zero".into())?;
        let samples = (self.duration + self.rest_before + self.rest_after) / self.sample_time;
        check("the number of samples", samples, "", samples <= MOST_SAMPLES, || {
            format!("at most {MOST_SAMPLES:e} are written; check the units of duration and sample time")
        })?;
        check("the duration", self.duration, "s", self.duration >= 2.0 * self.sample_time, || {
            format!("it must hold at least two samples of {} s", self.sample_time)
        })
    }
}

/// [`Error::Setting`] unless the value is finite and the condition holds.
fn check(
    what: &'static str,
    value: f64,
    unit: &'static str,
    holds: bool,
    allowed: impl FnOnce() -> String,
) -> Result<(), Error> {
    if value.is_finite() && holds {
        Ok(())
    } else {
        Err(Error::Setting { what, value, unit, allowed: allowed() })
    }
}

/// Checks a band that is sampled every `sample_time` \[s\].
fn check_band(band: &Band, sample_time: f64) -> Result<(), Error> {
    let nyquist = 0.5 / sample_time;
    for frequency in [band.start, band.end] {
        check("a frequency of the band", frequency, "Hz", frequency > 0.0 && frequency < nyquist, || {
            format!("it must be above zero and below half the sample rate, {nyquist} Hz")
        })?;
    }
    Ok(())
}

impl Signal {
    /// Samples of the whole command with offset and rests, shape \[n\]: sample k stands at `k Ts`.
    ///
    /// # Errors
    /// [`Error::Setting`] for settings out of range.
    pub fn samples(&self, settings: &Settings) -> Result<Vec<f64>, Error> {
        settings.validate()?;
        let (ts, seed) = (settings.sample_time, settings.seed);
        let n = count(settings.duration, ts);
        let shape = match self {
            Signal::Chirp { band, sweep } => {
                check_band(band, ts)?;
                chirp::samples(band, *sweep, n, ts)
            }
            Signal::Stairs { hold } => {
                check("the hold time", hold.start, "s", hold.start >= ts * (1.0 - 1e-9), || {
                    format!("it must be at least the sample time of {ts} s")
                })?;
                check("the longest hold time", hold.end, "s", hold.end >= hold.start, || {
                    format!("it must not be below the shortest, {} s", hold.start)
                })?;
                check("the hold time", hold.start, "s", count(hold.start, ts) < n, || {
                    format!(
                        "the signal lasts {} s and would be constant; hold levels for a fraction of it",
                        settings.duration
                    )
                })?;
                stairs::samples(hold, n, ts, seed)
            }
            Signal::Multisine { band, period } => {
                check_band(band, ts)?;
                multisine::samples(band, period.unwrap_or(n as f64 * ts), n, ts, seed)?
            }
            Signal::Prbs { clock, order } => {
                check("the clock time", *clock, "s", *clock >= ts * (1.0 - 1e-9), || {
                    format!("it must be at least the sample time of {ts} s")
                })?;
                check("the clock time", *clock, "s", *clock < n as f64 * ts, || {
                    format!(
                        "it must be shorter than the signal of {} s, which would be constant",
                        n as f64 * ts
                    )
                })?;
                prbs::samples(count(*clock, ts), *order, n, seed)?
            }
        };
        let rest = |time| std::iter::repeat_n(settings.offset, count(time, ts));
        let signal = shape.into_iter().map(|value| settings.offset + settings.amplitude * value);
        Ok(rest(settings.rest_before).chain(signal).chain(rest(settings.rest_after)).collect())
    }
}

/// Samples in a time, to the nearest.
fn count(time: f64, sample_time: f64) -> usize {
    (time / sample_time).round() as usize
}

/// Times of samples \[s\]: `k Ts`, rounded once where the sample rate is a whole number of hertz.
pub fn times(samples: usize, sample_time: f64) -> Vec<f64> {
    let rate = (1.0 / sample_time).round();
    let whole = (rate * sample_time - 1.0).abs() < 1e-12;
    (0..samples).map(|k| if whole { k as f64 / rate } else { k as f64 * sample_time }).collect()
}

/// Size of a signal about its offset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Size {
    /// Lowest value.
    pub lowest: f64,
    /// Highest value.
    pub highest: f64,
    /// Root mean square of the deviation from the offset.
    pub rms: f64,
    /// Largest deviation from the offset over the root mean square; 0 for a signal that never leaves it.
    pub crest_factor: f64,
}

impl Size {
    /// Size of samples \[n\] about `offset`, in their unit.
    pub fn of(samples: &[f64], offset: f64) -> Size {
        let (mut lowest, mut highest, mut squares) = (f64::INFINITY, f64::NEG_INFINITY, 0.0);
        for value in samples {
            lowest = value.min(lowest);
            highest = value.max(highest);
            squares += (value - offset) * (value - offset);
        }
        let rms = (squares / samples.len().max(1) as f64).sqrt();
        let peak = (highest - offset).abs().max((lowest - offset).abs());
        Size { lowest, highest, rms, crest_factor: if rms > 0.0 { peak / rms } else { 0.0 } }
    }

    /// Refuses a command outside the limits `lower`..`upper`, in the unit of the command.
    ///
    /// # Errors
    /// [`Error::Limit`] with the largest amplitude about `offset` that stays inside.
    pub fn within(&self, lower: f64, upper: f64, offset: f64) -> Result<(), Error> {
        if self.lowest >= lower && self.highest <= upper {
            return Ok(());
        }
        let largest = (upper - offset).min(offset - lower).max(0.0);
        Err(Error::Limit { lowest: self.lowest, highest: self.highest, lower, upper, largest })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rests_stand_at_the_offset_and_the_signal_between_them() {
        let settings = Settings {
            amplitude: 2.0,
            offset: 5.0,
            duration: 1.0,
            sample_time: 0.01,
            rest_before: 0.1,
            rest_after: 0.2,
            seed: 3,
        };
        let samples = Signal::Stairs { hold: 0.05..0.1 }.samples(&settings).unwrap();
        assert_eq!(samples.len(), 130);
        assert!(samples[..10].iter().chain(&samples[110..]).all(|value| *value == 5.0));
        assert!(samples[10..110].iter().all(|value| (value - 5.0).abs() <= 2.0 && *value != 5.0));
    }

    #[test]
    fn settings_out_of_range_are_named() {
        let chirp = Signal::Chirp { band: 0.1..600.0, sweep: chirp::Sweep::Linear };
        let message = chirp.samples(&Settings::default()).unwrap_err().to_string();
        assert!(message.contains("600 Hz") && message.contains("500 Hz"), "{message}");
        let none = Settings { amplitude: 0.0, ..Settings::default() };
        let message = chirp.samples(&none).unwrap_err().to_string();
        assert!(message.starts_with("the amplitude is 0, but"), "{message}");
        let message =
            Signal::Stairs { hold: 30.0..30.0 }.samples(&Settings::default()).unwrap_err().to_string();
        assert!(message.contains("30 s") && message.contains("constant"), "{message}");
        for settings in [
            Settings { duration: -1.0, ..Settings::default() },
            Settings { sample_time: 0.0, ..Settings::default() },
            Settings { amplitude: f64::NAN, ..Settings::default() },
            Settings { duration: 1e9, ..Settings::default() },
        ] {
            assert!(Signal::Stairs { hold: 0.1..0.2 }.samples(&settings).is_err(), "{settings:?}");
        }
    }

    #[test]
    fn a_command_beyond_the_supply_is_refused_with_what_is_possible() {
        let size = Size::of(&[-40.0, 40.0], 0.0);
        assert_eq!(size.crest_factor, 1.0);
        assert_eq!(size.within(-50.0, 50.0, 0.0), Ok(()));
        let error = size.within(-35.0, 50.0, 0.0).unwrap_err();
        assert!(error.to_string().contains("at most 35"), "{error}");
    }
}
