//! Signs of measured columns: a column of the other sign is found before the search, not explained by it.

use crate::Error;
use crate::answer::errors;
use crate::case::{Case, Role};
use crate::engine::settings::MAX_RATIO_OF_OTHER_SIGN;
use crate::rig::open::open;
use crate::rig::parameters::neutral;

/// Error over the spread of the measured signals from which on signs are in question.
pub const MIN_ERROR: f64 = 0.3;
/// The same where the declared model predicts worse than the mean of the records, if the other sign predicts better.
const MAX_RATIO_OF_A_BAD_MODEL: f64 = 0.75;
/// Error over the spread up to which the other sign predicts better than the mean.
const MAX_ERROR_OF_OTHER_SIGN: f64 = 0.95;
/// Records that are compared.
pub const RECORDS: usize = 3;

/// Whether the declared model is clearly better with the other sign of a column; errors over the spread of the measured
/// signals, no number where the model diverges.
pub fn is_wrong(stated: f64, other: f64) -> bool {
    // What predicts no better than the mean of the records says nothing, however bad the stated sign is.
    if other.is_nan() || other >= MAX_ERROR_OF_OTHER_SIGN {
        return false;
    }
    if !stated.is_finite() {
        return true;
    }
    let most = if stated > 1.0 { MAX_RATIO_OF_A_BAD_MODEL } else { MAX_RATIO_OF_OTHER_SIGN };
    stated > MIN_ERROR && other < most * stated
}

/// Text of both errors, for the message.
pub fn words(stated: f64, other: f64) -> String {
    let stated = if stated.is_finite() {
        format!("leaves an error of {:.0} % of the spread of the records", 100.0 * stated)
    } else {
        "cannot be simulated over the records".to_owned()
    };
    format!("the declared model {stated}, with the other sign {:.0} %", 100.0 * other)
}

/// Refuses a case one of whose columns has the other sign.
///
/// # Errors
/// Column, errors with both signs, remedy.
pub fn check(case: &Case) -> Result<(), Error> {
    let fitted = case.declaration.files.iter().zip(&case.records);
    let fitted: Vec<_> = fitted.filter(|(file, _)| file.role == Role::Estimation).take(RECORDS).collect();
    let error = |column: Option<&str>| -> Option<f64> {
        let mut own = case.clone();
        own.declaration.files = fitted.iter().map(|(file, _)| (*file).clone()).collect();
        own.records = fitted
            .iter()
            .map(|(_, series)| column.map_or((*series).clone(), |name| series.negated(name)))
            .collect();
        let rig = open(&own).ok()?;
        let records: Vec<usize> = (0..rig.system.records()).collect();
        let found = errors(rig.system.as_ref(), &records, &neutral()).nrmse;
        let square = found.values().map(|error| error * error).sum::<f64>() / found.len().max(1) as f64;
        Some(square.sqrt()).filter(|error| error.is_finite())
    };
    let stated = error(None).unwrap_or(f64::NAN);
    if stated <= MIN_ERROR {
        return Ok(());
    }
    let flipped = case.declaration.sensors.keys().filter_map(|name| Some((name, error(Some(name))?)));
    let best = flipped.min_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, other)| is_wrong(stated, *other));
    let Some((name, other)) = best else { return Ok(()) };
    Err(Error::Case {
        path: format!("{}/case.toml", case.declaration.id).into(),
        problem: format!(
            "column `{name}` has the other sign than in the declared model: {}; multiply the column by -1 in all files, or correct the declared model",
            words(stated, other)
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_clear_gain_says_that_a_sign_is_wrong() {
        for (stated, other) in [(2.0, 0.1), (1.5, 0.87), (1.0, 0.4), (f64::NAN, 0.3), (0.4, 0.1)] {
            assert!(is_wrong(stated, other), "{stated} {other}");
        }
        for (stated, other) in
            [(0.2, 0.01), (0.9, 0.8), (1.3, 1.2), (3.0, 1.4), (0.9, f64::NAN), (f64::NAN, 1.2)]
        {
            assert!(!is_wrong(stated, other), "{stated} {other}");
        }
    }
}
