//! Memory that a program needs, said before it is built.

use airloop_ocp::transcription::Transcription;
use airloop_plan::Error;

/// Least memory of an interval \[bytes\] over the square of the number of states and inputs, by Hermite-Simpson and by
/// others: of `optimize examples/03_swing_up/problem.toml --intervals 20000 --max-iterations 1`, by GNU `time`. Limits
/// along the path take more.
const BYTES_PER_SQUARE: [f64; 2] = [620.0, 390.0];
/// From here on it is said \[bytes\].
const WORTH_SAYING: f64 = 1e9;

/// A sentence on the memory that a mesh with so many `intervals`, `[phases]`, needs at least, where it is much;
/// `signals`: number of states and inputs, `free`: memory that is free \[bytes\].
///
/// # Errors
/// It needs more than is free.
pub fn forecast(
    transcription: Transcription,
    intervals: &[usize],
    signals: usize,
    free: f64,
) -> Result<Option<String>, Error> {
    let count: usize = intervals.iter().sum();
    let [hermite_simpson, others] = BYTES_PER_SQUARE;
    let is_hermite_simpson = transcription == Transcription::HermiteSimpson;
    let per_square = if is_hermite_simpson { hermite_simpson } else { others };
    let bytes = per_square * (signals * signals) as f64 * count as f64;
    let gigabytes = |bytes: f64| format!("{:.1} GB", bytes / 1e9);
    if bytes > free {
        let problem = format!(
            "{count} intervals need at least {} of memory, and {} are free; give fewer",
            gigabytes(bytes),
            gigabytes(free)
        );
        return Err(Error::Place { place: "intervals".into(), problem });
    }
    let said = || format!("{count} intervals need at least {} of memory", gigabytes(bytes));
    Ok((bytes >= WORTH_SAYING).then(said))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_refused_and_much_is_said() {
        assert!(matches!(forecast(Transcription::Trapezoidal, &[200], 7, 8e9), Ok(None)));
        let said = forecast(Transcription::Trapezoidal, &[100_000, 100_000], 7, 8e9).unwrap().unwrap();
        assert_eq!(said, "200000 intervals need at least 3.8 GB of memory");
        let refused = forecast(Transcription::Trapezoidal, &[1_000_000], 7, 8e9).unwrap_err().to_string();
        assert!(refused.contains("1000000 intervals need at least 19.1 GB of memory, and 8.0 GB are free"));
    }
}
