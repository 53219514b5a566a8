//! A series on a uniform grid: by its own time stamps, without aliasing where the grid is coarser.
//!
//! A signal that is held between its samples (a command, a discrete output) keeps the value of its last sample. A
//! continuous one moves on straight lines between its samples; for a coarser grid a zero-phase low-pass takes away
//! first what the grid cannot show.

use super::names::counted;
use super::{Channel, Error, Interpolation, TimeSeries};

/// Stop band of the low-pass, as a share of the new sample rate: half of it is the highest frequency that a grid can
/// show.
const STOP_BAND: f64 = 0.5;
/// Pass band of the low-pass, as a share of the new sample rate.
const PASS_BAND: f64 = 0.4;
/// Attenuation of the stop band \[dB\].
const ATTENUATION: f64 = 60.0;
/// Length of the low-pass in steps of the new grid.
const STEPS_OF_LOW_PASS: f64 = 37.0;
/// Ratio of the new step to that of the series from which on the low-pass is needed.
const MIN_RATIO_OF_COARSER: f64 = 1.05;
/// Step between two samples over the median from which on it is a gap.
const MIN_RATIO_OF_GAP: f64 = 3.0;
/// Samples of a grid at most, also of the fine one in front of a low-pass.
const MAX_SAMPLES: f64 = 1e7;

/// How a signal goes from sample to sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// On straight lines, behind a low-pass where the grid is coarser.
    #[default]
    Filter,
    /// On straight lines, without a low-pass: frequencies beyond half the new rate come back as lower ones.
    Linear,
    /// It keeps the value of its last sample.
    Hold,
}

/// A series on a uniform grid, and what was done, one sentence each.
#[derive(Debug, Clone)]
pub struct Uniform {
    /// The series; its first time is that of the source.
    pub series: TimeSeries,
    /// Description of the work done, for the user.
    pub notes: Vec<String>,
}

/// Why a series cannot be put on a grid.
#[derive(Debug, thiserror::Error)]
pub enum Problem {
    /// The step does not fit.
    #[error(
        "a step of {step} s does not fit a series of {samples} samples over {span} s; give one above zero and up to {most} s"
    )]
    Step {
        /// New step \[s\].
        step: f64,
        /// Samples of the series.
        samples: usize,
        /// Length \[s\].
        span: f64,
        /// Longest step \[s\].
        most: f64,
    },
    /// The grid has too many samples.
    #[error(
        "a step of {step} s makes {count:.1e} samples of {span} s, and at most {MAX_SAMPLES:e} are possible; give a step of {least:.1e} s or more"
    )]
    TooMany {
        /// New step \[s\].
        step: f64,
        /// Samples of the grid.
        count: f64,
        /// Length \[s\].
        span: f64,
        /// Shortest step \[s\].
        least: f64,
    },
    /// The low-pass needs too fine a grid: most samples lie far closer to each other than the rest.
    #[error(
        "samples {median:.3e} s apart (the median) over {span} s are too many for the low-pass of a coarser grid; cut the file, or take a method without low-pass"
    )]
    TooFine {
        /// Median step of the series \[s\].
        median: f64,
        /// Length \[s\].
        span: f64,
    },
    /// A channel is not there.
    #[error("there is no column `{name}`; there are: {known}")]
    Channel {
        /// Name given.
        name: String,
        /// Names known.
        known: String,
    },
    /// See [`Error`].
    #[error(transparent)]
    Series(#[from] Error),
}

/// Puts a series on a grid of `step` \[s\] from its first time on; `method` for all signals but those of `held`, which
/// keep their last sample, as truth values do.
///
/// # Errors
/// [`Problem`].
pub fn uniform(source: &TimeSeries, step: f64, method: Method, held: &[String]) -> Result<Uniform, Problem> {
    let time = source.time();
    let span = time.last().copied().unwrap_or(0.0) - time.first().copied().unwrap_or(0.0);
    if !(step > 0.0 && time.len() > 1 && step <= span) {
        return Err(Problem::Step { step, samples: time.len(), span, most: span });
    }
    let count = span / step;
    if count >= MAX_SAMPLES {
        return Err(Problem::TooMany { step, count, span, least: 1.1 * span / MAX_SAMPLES });
    }
    if let Some(name) = held.iter().find(|name| source.channel(name).is_none()) {
        let known: Vec<&str> = source.channels().iter().map(|channel| channel.name.as_str()).collect();
        return Err(Problem::Channel { name: name.clone(), known: known.join(", ") });
    }
    let own = median(&time.windows(2).map(|pair| pair[1] - pair[0]).collect::<Vec<_>>());
    let coarser = step > MIN_RATIO_OF_COARSER * own;
    // So many steps of the fine grid make one of the new, and none is longer than those of the series.
    // A whole ratio stays one although stamps are rounded.
    let parts = if coarser { (step / own - 1e-3).ceil().max(1.0) as usize } else { 1 };
    let is_held = |channel: &Channel| method == Method::Hold || channel.words || held.contains(&channel.name);
    let needs_filter = coarser && method == Method::Filter && !source.channels().iter().all(is_held);
    if needs_filter && (span / step).max(STEPS_OF_LOW_PASS) * parts as f64 >= MAX_SAMPLES {
        return Err(Problem::TooFine { median: own, span });
    }
    let count = (span / step * (1.0 + 1e-12)) as usize + 1;
    let axis = |parts: usize, count: usize| {
        (0..count).map(|k| time[0] + k as f64 * step / parts as f64).collect::<Vec<f64>>()
    };
    let on_hold = source.resample(axis(1, count), Interpolation::Hold)?;
    let on_lines = if needs_filter {
        let fine_count = (span / step * parts as f64 * (1.0 + 1e-12)) as usize + 1;
        source.resample(axis(parts, fine_count), Interpolation::Linear)?
    } else {
        source.resample(axis(1, count), Interpolation::Linear)?
    };
    let filter = LowPass::new(if needs_filter { parts } else { 1 });
    let mut series = TimeSeries::new(axis(1, count))?;
    let (mut kept, mut filtered) = (Vec::new(), Vec::new());
    for (index, channel) in source.channels().iter().enumerate() {
        let values = if is_held(channel) {
            kept.push(channel.name.as_str());
            on_hold.channels()[index].values.clone()
        } else if needs_filter {
            filtered.push(channel.name.as_str());
            let values = &on_lines.channels()[index].values;
            (0..count).map(|k| filter.at(values, k * parts)).collect()
        } else {
            on_lines.channels()[index].values.clone()
        };
        series.push(channel.name.clone(), channel.unit.clone(), values)?;
        if let Some(channel_of) = series.channels.last_mut() {
            channel_of.words = channel.words;
        }
    }
    let notes = notes(source, (step, own, count), (&kept, &filtered), coarser);
    Ok(Uniform { series, notes })
}

/// A number with six decimals at most, without zeros at its end.
fn tidy(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

/// Sentences on what was done.
fn notes(
    source: &TimeSeries,
    (step, own, count): (f64, f64, usize),
    (kept, filtered): (&[&str], &[&str]),
    coarser: bool,
) -> Vec<String> {
    let steps: Vec<f64> = source.time().windows(2).map(|pair| pair[1] - pair[0]).collect();
    let (least, most) = steps.iter().fold((f64::INFINITY, 0.0f64), |(a, b), &s| (a.min(s), b.max(s)));
    let even = format!("{least:.6}") == format!("{most:.6}");
    let apart = match even {
        true => format!("{} s apart", tidy(own)),
        false => format!("{} to {} s apart (median {} s)", tidy(least), tidy(most), tidy(own)),
    };
    let mut found = vec![format!(
        "{} samples, {apart}, give {count} samples every {step} s, by their own time stamps",
        source.len()
    )];
    let gaps = steps.iter().filter(|own_step| **own_step > MIN_RATIO_OF_GAP * own).count();
    if gaps > 0 {
        let (gaps, are) = (counted(gaps, "gap"), if gaps == 1 { "is" } else { "are" });
        found.push(format!("{gaps} longer than {MIN_RATIO_OF_GAP} times the median step {are} bridged; cut the file there if that matters"));
    }
    if !kept.is_empty() {
        let lost =
            if coarser { "; changes between two samples of the grid are seen at the next" } else { "" };
        found.push(format!("held between samples: {}{lost}", kept.join(", ")));
    }
    if !filtered.is_empty() {
        found.push(format!(
            "low-pass of zero phase against aliasing (passes up to {} Hz, takes away {ATTENUATION} dB from {} Hz on): {}",
            tidy(PASS_BAND / step),
            tidy(STOP_BAND / step),
            filtered.join(", ")
        ));
    } else if coarser && kept.len() < source.channels().len() {
        found.push(format!(
            "no low-pass: what is faster than {:.4} Hz comes back as lower frequencies",
            STOP_BAND / step
        ));
    }
    if step < own / MIN_RATIO_OF_COARSER {
        found.push(
            "the grid is finer than the samples: what lies between them is interpolated, not measured".into(),
        );
    }
    found
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

/// Windowed sinc of zero phase (Kaiser 1974) on a grid that is finer by a whole number.
struct LowPass {
    /// Coefficients from the middle on; those of the other half are the same.
    half: Vec<f64>,
}

impl LowPass {
    /// For a grid of which every `parts`-th sample stays.
    fn new(parts: usize) -> LowPass {
        let parts = parts as f64;
        let width = (STOP_BAND - PASS_BAND) / parts;
        let order = (ATTENUATION - 7.95) / (14.36 * width);
        let count = (order / 2.0).ceil() as usize;
        let beta = 0.1102 * (ATTENUATION - 8.7);
        let corner = 0.5 * (STOP_BAND + PASS_BAND) / parts;
        let one = |k: usize| {
            let x = k as f64;
            let sinc = if k == 0 {
                2.0 * corner
            } else {
                (std::f64::consts::TAU * corner * x).sin() / (std::f64::consts::PI * x)
            };
            sinc * bessel(beta * (1.0 - (x / count as f64).powi(2)).max(0.0).sqrt()) / bessel(beta)
        };
        let mut half: Vec<f64> = (0..=count).map(one).collect();
        let sum = half[0] + 2.0 * half[1..].iter().sum::<f64>();
        half.iter_mut().for_each(|value| *value /= sum);
        LowPass { half }
    }

    /// The filtered signal at a sample; beyond its ends it goes on as if turned about them, so that a line stays one.
    fn at(&self, values: &[f64], center: usize) -> f64 {
        let last = values.len() as isize - 1;
        let value = |k: isize| -> f64 {
            if k < 0 {
                2.0 * values[0] - values[(-k).min(last) as usize]
            } else if k > last {
                2.0 * values[last as usize] - values[(2 * last - k).max(0) as usize]
            } else {
                values[k as usize]
            }
        };
        let center = center as isize;
        let pair = |(k, h): (usize, &f64)| {
            let k = k as isize;
            if k == 0 { h * value(center) } else { h * (value(center - k) + value(center + k)) }
        };
        self.half.iter().enumerate().map(pair).sum()
    }
}

/// Modified Bessel function of the first kind and order zero.
fn bessel(x: f64) -> f64 {
    let (mut sum, mut term, mut k) = (1.0, 1.0, 1.0);
    while term > 1e-16 * sum {
        term *= (0.5 * x / k).powi(2);
        sum += term;
        k += 1.0;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn sine(frequency: f64, stamps: &[f64]) -> TimeSeries {
        let mut series = TimeSeries::new(stamps.to_vec()).unwrap();
        let w = std::f64::consts::TAU * frequency;
        let values = stamps.iter().map(|t| (w * t).sin()).collect();
        series.push("y", Some("m".into()), values).unwrap();
        series
    }

    fn every(step: f64, count: usize) -> Vec<f64> {
        (0..count).map(|k| step * k as f64).collect()
    }

    /// Largest error against the sine itself, without the ends.
    fn off(found: &TimeSeries, frequency: f64) -> f64 {
        let w = std::f64::consts::TAU * frequency;
        let (values, time) = (&found.channels()[0].values, found.time());
        let n = time.len();
        (n / 10..n - n / 10).map(|k| (values[k] - (w * time[k]).sin()).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn what_the_coarser_grid_can_show_stays_and_what_it_cannot_is_taken_away() {
        // 1 kHz to 100 Hz: 30 Hz passes, 70 Hz would come back as 30 Hz.
        let stamps = every(1e-3, 4001);
        let slow = uniform(&sine(30.0, &stamps), 0.01, Method::Filter, &[]).unwrap();
        assert_eq!((slow.series.len(), slow.series.channels()[0].unit.as_deref()), (401, Some("m")));
        // 60 dB of ripple, and 0.15 % by the lines between samples: (w step)^2 / 24.
        assert!(off(&slow.series, 30.0) < 3e-3, "{}", off(&slow.series, 30.0));
        let fast = uniform(&sine(70.0, &stamps), 0.01, Method::Filter, &[]).unwrap();
        let values = &fast.series.channels()[0].values;
        let largest = values[40..360].iter().fold(0.0f64, |a, b| a.max(b.abs()));
        assert!(largest < 2e-3, "{largest}");
        let aliased = uniform(&sine(70.0, &stamps), 0.01, Method::Linear, &[]).unwrap();
        assert!(aliased.series.channels()[0].values.iter().any(|value| *value > 0.9));
        assert!(aliased.notes.iter().any(|note| note.contains("no low-pass")));
    }

    #[test]
    fn jittered_stamps_count_and_a_line_stays_a_line_up_to_its_ends() {
        let mut random = Random::new(3);
        let stamps: Vec<f64> = (0..4000).map(|k| 1e-3 * (k as f64 + 0.4 * random.uniform())).collect();
        let found = uniform(&sine(3.0, &stamps), 5e-3, Method::Filter, &[]).unwrap();
        assert!(off(&found.series, 3.0) < 2e-3, "{}", off(&found.series, 3.0));
        let mut line = TimeSeries::new(stamps.clone()).unwrap();
        line.push("y", None, stamps.iter().map(|t| 1.0 + 2.0 * t).collect()).unwrap();
        let found = uniform(&line, 5e-3, Method::Filter, &[]).unwrap().series;
        for (t, value) in found.time().iter().zip(&found.channels()[0].values) {
            assert!((value - 1.0 - 2.0 * t).abs() < 1e-6, "{t}: {value}");
        }
    }

    #[test]
    fn a_held_command_keeps_its_levels_on_either_grid() {
        let mut series = sine(1.0, &every(1e-2, 400));
        series.push("u", None, (0..400).map(|k| f64::from(k / 37 % 3)).collect()).unwrap();
        for step in [2e-3, 3e-2] {
            let found = uniform(&series, step, Method::Filter, &["u".into()]).unwrap();
            assert!(found.series.channel("u").unwrap().values.iter().all(|value| value.fract() == 0.0));
            assert!(found.notes.iter().any(|note| note.contains("held between samples: u")));
        }
        let finer = uniform(&series, 2e-3, Method::Filter, &[]).unwrap();
        assert!(finer.notes.iter().any(|note| note.contains("interpolated, not measured")));
    }

    #[test]
    fn a_burst_of_stamps_does_not_ask_for_a_grid_without_end() {
        let mut stamps = every(1e-9, 100);
        stamps.extend([1.0, 2.0, 3.0]);
        let problem = uniform(&sine(1.0, &stamps), 0.1, Method::Filter, &[]).unwrap_err().to_string();
        assert!(problem.contains("too many for the low-pass"), "{problem}");
        assert_eq!(uniform(&sine(1.0, &stamps), 0.1, Method::Linear, &[]).unwrap().series.len(), 31);
    }

    #[test]
    fn what_does_not_fit_is_told() {
        let series = sine(1.0, &every(1e-2, 400));
        let many = uniform(&series, 1e-12, Method::Filter, &[]).unwrap_err().to_string();
        assert!(many.contains("makes 4.0e12 samples"), "{many}");
        for step in [0.0, -1.0, f64::NAN, 10.0] {
            assert!(
                matches!(uniform(&series, step, Method::Filter, &[]), Err(Problem::Step { .. })),
                "{step}"
            );
        }
        let problem = uniform(&series, 0.02, Method::Filter, &["v".into()]).unwrap_err().to_string();
        assert!(problem.contains("`v`") && problem.contains('y'), "{problem}");
    }
}
