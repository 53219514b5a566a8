//! Memory that a program needs, and length of its command, said before it is built.

use airloop_ocp::transcription::Transcription;
use airloop_series::memory;

use super::Error;
use super::solve::Settings;
use super::task::Task;

/// Least memory of an interval \[bytes\] over the square of the number of states and inputs, by Hermite-Simpson and by
/// others: of `optimize examples/03_swing_up/problem.toml --intervals 20000 --max-iterations 1`, by GNU `time`. Limits
/// along the path take more.
const BYTES_PER_SQUARE: [f64; 2] = [620.0, 390.0];
/// From here on it is said \[bytes\].
const WORTH_SAYING: f64 = 1e9;

/// Most samples of a command.
const MAX_SAMPLES: f64 = 1e7;

/// Refuses a motion whose command would be too long as a table: its duration and the step of the table \[s\].
///
/// # Errors
/// The number of samples, and what to change.
pub fn check_samples(duration: f64, step: f64) -> Result<(), Error> {
    let samples = duration / step;
    if samples <= MAX_SAMPLES {
        return Ok(());
    }
    let problem = format!(
        "a motion of {duration} s is a command of {samples:.1e} samples, one every {step} s; more than {MAX_SAMPLES:e} are not written: give a shorter duration, or a longer sample_time"
    );
    Err(Error::Place { place: "duration".into(), problem })
}

/// A sentence on the memory that the largest mesh of the settings needs at least, where it is much.
///
/// # Errors
/// It needs more than is free.
pub fn forecast(task: &Task, settings: &Settings) -> Result<Option<String>, Error> {
    let signals = task.signals.states.len() + task.signals.inputs.len();
    let meshes = settings.passes.iter().map(|pass| {
        let count = pass.intervals.iter().sum();
        (bytes(pass.transcription, count, signals), count)
    });
    let Some((bytes, count)) = meshes.max_by(|a, b| a.0.total_cmp(&b.0)) else { return Ok(None) };
    if bytes < WORTH_SAYING { Ok(None) } else { told(bytes, count, memory::free()).map(Some) }
}

/// Least memory of a mesh \[bytes\].
fn bytes(transcription: Transcription, intervals: usize, signals: usize) -> f64 {
    let [hermite_simpson, others] = BYTES_PER_SQUARE;
    let is_hermite_simpson = transcription == Transcription::HermiteSimpson;
    let per_square = if is_hermite_simpson { hermite_simpson } else { others };
    per_square * (signals * signals) as f64 * intervals as f64
}

/// The sentence on a mesh with `count` intervals.
fn told(bytes: f64, count: usize, free: f64) -> Result<String, Error> {
    let gigabytes = |bytes: f64| format!("{:.1} GB", bytes / 1e9);
    let need = format!("{count} intervals need at least {} of memory", gigabytes(bytes));
    if bytes > free {
        let problem = format!("{need}, and {} are free; give fewer", gigabytes(free));
        return Err(Error::Place { place: "intervals".into(), problem });
    }
    Ok(need)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_without_end_is_refused() {
        assert!(check_samples(2.0, 0.001).is_ok());
        let refused = check_samples(1e9, 0.001).unwrap_err().to_string();
        assert!(refused.contains("a motion of 1000000000 s is a command of 1.0e12 samples"), "{refused}");
        assert!(check_samples(f64::NAN, 0.001).is_err());
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let said = |count| told(bytes(Transcription::Trapezoidal, count, 7), count, 8e9);
        assert_eq!(said(200_000).unwrap(), "200000 intervals need at least 3.8 GB of memory");
        let refused = said(1_000_000).unwrap_err().to_string();
        assert!(refused.contains("1000000 intervals need at least 19.1 GB of memory, and 8.0 GB are free"));
    }
}
