//! Fit of a simulation to a measurement: the NRMSE fit of the paper (eq. 9) and the RMS error.

/// Measures of agreement between a simulated signal and the measured one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    /// NRMSE fit \[%\]: 100 is perfect, 0 is no better than the mean of the measurement, negative is worse.
    /// `None` if the measured signal is constant: eq. 9 then divides by zero.
    pub nrmse_percent: Option<f64>,
    /// Root mean square of measured minus simulated, in the unit of the signal.
    pub rms_error: f64,
    /// Number of samples compared.
    pub samples: usize,
}

/// Reason why two signals cannot be compared.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum Error {
    /// Different numbers of samples.
    #[error(
        "{measured} measured samples cannot be compared with {simulated} simulated ones; resample one of them"
    )]
    Length {
        /// Samples of the measurement.
        measured: usize,
        /// Samples of the simulation.
        simulated: usize,
    },
    /// Nothing to compare.
    #[error("there is no common sample to compare; the time ranges do not overlap")]
    Empty,
}

/// Compares a simulated with a measured signal, sample by sample.
///
/// `fit = 100 (1 - ||y - y_hat|| / ||y - mean(y)||)` (eq. 9), `rms = ||y - y_hat|| / sqrt(n)`.
///
/// | name | shape | unit |
/// |------|-------|------|
/// | `measured` y | \[n\] | that of the signal |
/// | `simulated` y_hat | \[n\] | the same |
///
/// # Errors
/// [`Error::Length`] for slices of different length, [`Error::Empty`] for none.
///
/// ```
/// let fit = airloop_ident::fit::nrmse(&[0.0, 2.0], &[0.5, 2.0]).unwrap();
/// assert!((fit.nrmse_percent.unwrap() - 100.0 * (1.0 - 0.5 / 2f64.sqrt())).abs() < 1e-12);
/// ```
pub fn nrmse(measured: &[f64], simulated: &[f64]) -> Result<Fit, Error> {
    let n = measured.len();
    if n != simulated.len() {
        return Err(Error::Length { measured: n, simulated: simulated.len() });
    }
    if n == 0 {
        return Err(Error::Empty);
    }
    // The mean is taken about the first sample, so that a constant signal has exactly no spread.
    let y0 = measured[0];
    let mean = y0 + measured.iter().map(|y| y - y0).sum::<f64>() / n as f64;
    let error = norm(measured.iter().zip(simulated).map(|(y, y_hat)| y - y_hat));
    let spread = norm(measured.iter().map(|y| y - mean));
    Ok(Fit {
        nrmse_percent: (spread > 0.0).then(|| 100.0 * (1.0 - error / spread)), // eq. 9
        rms_error: error / (n as f64).sqrt(),
        samples: n,
    })
}

fn norm(values: impl Iterator<Item = f64>) -> f64 {
    values.map(|value| value * value).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_perfect_simulation_fits_to_100_percent() {
        let y = [1.0, -2.0, 4.0];
        let fit = nrmse(&y, &y).unwrap();
        assert_eq!((fit.nrmse_percent, fit.rms_error, fit.samples), (Some(100.0), 0.0, 3));
    }

    #[test]
    fn the_mean_of_the_measurement_fits_to_0_percent() {
        let fit = nrmse(&[1.0, 2.0, 6.0], &[3.0, 3.0, 3.0]).unwrap();
        assert!(fit.nrmse_percent.unwrap().abs() < 1e-12);
        // sqrt((4 + 1 + 9) / 3) by hand
        assert!((fit.rms_error - (14.0f64 / 3.0).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn a_constant_measurement_has_no_fit_but_an_error() {
        let fit = nrmse(&[0.1, 0.1, 0.1], &[0.1, 0.4, 0.1]).unwrap();
        assert_eq!(fit.nrmse_percent, None);
        assert!((fit.rms_error - 0.3 / 3f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn signals_of_different_length_or_none_are_refused() {
        assert_eq!(nrmse(&[1.0], &[]), Err(Error::Length { measured: 1, simulated: 0 }));
        assert_eq!(nrmse(&[], &[]), Err(Error::Empty));
    }
}
