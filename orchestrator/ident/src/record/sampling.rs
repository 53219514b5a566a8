//! One uniform sample time from time stamps, which files give in rounded decimals.

use super::Error;

/// Intervals that tell the usual distance of samples and the decimals of the time stamps.
const PROBED_INTERVALS: usize = 1000;
/// Deviation of an interval from the mean, as part of it, that does no harm.
const MAX_RELATIVE_JITTER: f64 = 1e-3;
/// Most decimals of time stamps that are taken for rounding.
const MOST_DECIMALS: i32 = 9;
/// Samples below which there is no point in anything.
const MIN_SAMPLES: usize = 4;

/// A uniform time axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sampling {
    /// Sample time \[s\], the shortest decimal that the time stamps allow.
    pub sample_time: f64,
    /// First time \[s\].
    pub start: f64,
    /// Number of samples.
    pub samples: usize,
    /// Relative uncertainty of the sample time, from the decimals of the time stamps.
    pub uncertainty: f64,
}

/// Takes time stamps one by one.
#[derive(Debug, Clone, Default)]
pub struct Clock {
    samples: usize,
    first: f64,
    last: f64,
    probe: Vec<f64>,
    shortest: Interval,
    longest: Interval,
}

#[derive(Debug, Clone, Copy, Default)]
struct Interval {
    length: f64,
    line: usize,
    before: f64,
    after: f64,
}

impl Clock {
    /// Adds the time stamp of a row.
    ///
    /// # Errors
    /// `path` with line and times, if time does not increase.
    pub fn push(&mut self, time: f64, line: usize, path: &str) -> Result<(), Error> {
        if self.samples == 0 {
            self.first = time;
        } else {
            let before = self.last;
            let length = time - before;
            if length <= 0.0 {
                return Err(airloop_series::csv::Error::NotIncreasing {
                    path: path.into(),
                    line,
                    before,
                    after: time,
                }
                .into());
            }
            let interval = Interval { length, line, before, after: time };
            if self.samples == 1 || length < self.shortest.length {
                self.shortest = interval;
            }
            if self.samples == 1 || length > self.longest.length {
                self.longest = interval;
            }
        }
        if self.probe.len() < PROBED_INTERVALS {
            self.probe.push(time);
        }
        self.last = time;
        self.samples += 1;
        Ok(())
    }

    /// The time axis of all stamps.
    ///
    /// # Errors
    /// [`Error::TooShort`], [`Error::Gap`] or [`Error::Uneven`].
    pub fn finish(&self, file: &str) -> Result<Sampling, Error> {
        let file = || file.to_owned();
        if self.samples < MIN_SAMPLES {
            return Err(Error::TooShort { file: file(), samples: self.samples, needed: MIN_SAMPLES });
        }
        let mut intervals: Vec<f64> = self.probe.windows(2).map(|pair| pair[1] - pair[0]).collect();
        intervals.sort_unstable_by(f64::total_cmp);
        let usual = intervals[intervals.len() / 2];
        let intervals_all = (self.samples - 1) as f64;
        let mean = (self.last - self.first) / intervals_all;
        let quantum = self.quantum().min(mean);
        // Stamps of few decimals alternate between two intervals; one long interval among equal ones is a gap.
        let alternation =
            intervals[intervals.len() - 1 - intervals.len() / 10] - intervals[intervals.len() / 10];
        let rounding = quantum * (1.0 + 1e-6);
        let tolerance = if alternation > MAX_RELATIVE_JITTER * usual { rounding } else { 0.0 };
        if self.longest.length > 1.5 * usual + tolerance {
            let Interval { line, before, after, .. } = self.longest;
            return Err(Error::Gap {
                file: file(),
                line,
                before,
                after,
                sample_time: short(usual, MAX_RELATIVE_JITTER * usual),
            });
        }
        let allowed = rounding.max(MAX_RELATIVE_JITTER * mean);
        for interval in [self.shortest, self.longest] {
            if (interval.length - mean).abs() > allowed {
                let (line, interval) = (interval.line, interval.length);
                let sample_time = short(mean, 1e-6 * mean);
                return Err(Error::Uneven {
                    file: file(),
                    line,
                    interval: short(interval, 1e-6 * mean),
                    sample_time,
                });
            }
        }
        let doubt = (quantum.max(1e-9 * mean) / intervals_all)
            .max(4.0 * f64::EPSILON * self.last.abs() / intervals_all);
        Ok(Sampling {
            sample_time: short(mean, doubt),
            start: self.first,
            samples: self.samples,
            uncertainty: doubt / mean,
        })
    }

    /// Last decimal of the time stamps \[s\]; 0 for more than some.
    fn quantum(&self) -> f64 {
        (0..=MOST_DECIMALS)
            .map(|decimals| 10f64.powi(decimals))
            .find(|scale| {
                self.probe.iter().all(|time| {
                    let scaled = time * scale;
                    (scaled - scaled.round()).abs() <= 1e-6
                })
            })
            .map_or(0.0, |scale| 1.0 / scale)
    }
}

/// The decimal with the fewest digits within `doubt` of `value`.
fn short(value: f64, doubt: f64) -> f64 {
    (0..17)
        .filter_map(|digits| format!("{value:.digits$e}").parse::<f64>().ok())
        .find(|candidate| (candidate - value).abs() <= doubt)
        .unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sampling(times: impl IntoIterator<Item = f64>) -> Result<Sampling, Error> {
        let mut clock = Clock::default();
        for (k, time) in times.into_iter().enumerate() {
            clock.push(time, k + 2, "a.csv")?;
        }
        clock.finish("a.csv")
    }

    fn rounded(sample_time: f64, decimals: i32, n: usize) -> impl Iterator<Item = f64> {
        let scale = 10f64.powi(decimals);
        (0..n).map(move |k| ((3.0 + k as f64 * sample_time) * scale).round() / scale)
    }

    #[test]
    fn rounded_time_stamps_give_the_sample_time_behind_them() {
        for (sample_time, decimals, n) in [(1e-3, 3, 4000), (0.08, 2, 900), (0.0015, 3, 3000), (1e-3, 6, 50)]
        {
            let found = sampling(rounded(sample_time, decimals, n)).unwrap();
            assert_eq!((found.sample_time, found.start, found.samples), (sample_time, 3.0, n));
        }
        let thirtieth = sampling(rounded(1.0 / 30.0, 3, 3000)).unwrap().sample_time;
        assert!((thirtieth * 30.0 - 1.0).abs() < 1e-4, "{thirtieth}");
        let sum = (0..5000).scan(0.0, |t, _| Some(std::mem::replace(t, *t + 0.1)));
        assert_eq!(sampling(sum).unwrap().sample_time, 0.1);
    }

    #[test]
    fn a_lost_sample_is_a_gap_and_a_late_one_is_uneven() {
        let lost = rounded(1e-3, 3, 500).enumerate().filter(|(k, _)| *k != 250).map(|(_, t)| t);
        let message = sampling(lost).unwrap_err().to_string();
        assert!(
            message.contains("line 252: gap from 3.249 s to 3.251 s in a record with samples every 0.001 s"),
            "{message}"
        );
        let late = rounded(0.01, 6, 500).enumerate().map(|(k, t)| if k == 100 { t + 0.00123 } else { t });
        let message = sampling(late).unwrap_err().to_string();
        assert!(
            message.contains("line 102: unevenly sampled") || message.contains("line 103: unevenly"),
            "{message}"
        );
        assert!(message.contains("resample"), "{message}");
    }

    #[test]
    fn three_rows_are_too_few() {
        let message = sampling([0.0, 1.0, 2.0]).unwrap_err().to_string();
        assert!(message.starts_with("a.csv: 3 samples are too few"), "{message}");
    }
}
