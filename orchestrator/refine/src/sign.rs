//! Signs of measured columns: a column of the other sign is found before the search, not explained by it.

use crate::Error;
use crate::answer::errors;
use crate::case::{Case, Declaration, File, Role};
use crate::engine::settings::MAX_RATIO_OF_OTHER_SIGN;
use crate::order::ascending;
use crate::rig::open::{Rig, open};
use crate::rig::parameters::neutral;

/// Error over the spread of the measured signals from which on signs are in question.
pub const MIN_ERROR: f64 = 0.3;
/// The same where the declared model predicts worse than the mean of the records, if the other sign predicts better.
const MAX_RATIO_OF_A_BAD_MODEL: f64 = 0.75;
/// Error over the spread up to which the other sign predicts better than the mean.
const MAX_ERROR_OF_OTHER_SIGN: f64 = 0.95;
/// Error of the other records above which the declared model cannot judge one of them.
pub const MAX_ERROR_OF_OTHERS: f64 = 0.5;
/// Error of a record, and ratio to that of the others, above which it does not go with them.
const MIN_ERROR_OF_ODD: f64 = 0.1;
const MIN_RATIO_OF_ODD: f64 = 2.0;
/// Error of a mended record, and ratio to that of the others, up to which it goes with them.
const MAX_ERROR_OF_MENDED: f64 = 0.3;
const MAX_RATIO_TO_OTHERS: f64 = 2.0;
/// Error above which it is told in times.
const MIN_ERROR_IN_TIMES: f64 = 10.0;
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

/// Whether the declared model follows other records and not this one; errors over the spread of each record.
pub fn is_odd(own: f64, others: f64) -> bool {
    let follows = own <= MIN_ERROR_OF_ODD.max(MIN_RATIO_OF_ODD * others);
    others <= MAX_ERROR_OF_OTHERS && !follows
}

/// Whether a record with a column mended goes with the others.
pub fn goes_with(mended: f64, others: f64) -> bool {
    mended <= MAX_ERROR_OF_MENDED.max(MAX_RATIO_TO_OTHERS * others)
}

/// The middle one of some errors; no number counts as largest.
pub fn median(errors: &[f64]) -> f64 {
    let mut errors = errors.to_vec();
    ascending(&mut errors, |own| *own);
    errors.get(errors.len() / 2).copied().unwrap_or(f64::NAN)
}

/// An error over the spread, in times where percent are no measure any more.
pub fn of_spread(error: f64) -> String {
    if error > MIN_ERROR_IN_TIMES {
        format!("{error:.0} times")
    } else {
        format!("{:.0} % of", 100.0 * error)
    }
}

/// Text of both errors, for the message.
pub fn compared(stated: f64, other: f64) -> String {
    let stated = if stated.is_finite() {
        format!("leaves an error of {} the spread of the records", of_spread(stated))
    } else {
        "cannot be simulated over the records".to_owned()
    };
    format!("{stated}, with the other sign {:.0} %", 100.0 * other)
}

/// Refuses a case one of whose columns has the other sign, in all records or in one.
///
/// # Errors
/// Column, errors with both signs, remedy.
pub fn check(case: &Case) -> Result<(), Error> {
    let declaration = &case.declaration;
    let columns = || declaration.sensors.keys().map(String::as_str);
    let refused =
        |problem: String| Err(Error::Case { path: format!("{}/case.toml", declaration.id).into(), problem });
    let each = 0..declaration.files.len();
    let Ok(rig) = open(case) else { return Ok(()) };
    let left: Vec<f64> = each.clone().map(|k| error(&rig, &[k])).collect();
    for k in each.clone() {
        let others = median(&[&left[..k], &left[k + 1..]].concat());
        if !is_odd(left[k], others) {
            continue;
        }
        let other = columns().map(|name| (name, negated(case, &[k], name)));
        let mended = other.filter(|own| is_wrong(left[k], own.1) && goes_with(own.1, others));
        let mut mended: Vec<(&str, f64)> = mended.collect();
        ascending(&mut mended, |own| own.1);
        if let Some(&(name, other)) = mended.first() {
            return refused(format!(
                "column `{name}` has the other sign in {} than in the other records: the declared model {}, and leaves {:.0} % on the others; multiply the column by -1 in that file, or leave its [[files]] out",
                declaration.files[k].name,
                compared(left[k], other),
                100.0 * others,
            ));
        }
    }
    let fitted = each.filter(|&k| declaration.files[k].role == Role::Estimation);
    let fitted: Vec<usize> = fitted.take(RECORDS).collect();
    let stated = error(&rig, &fitted);
    if stated <= MIN_ERROR {
        return Ok(());
    }
    let flipped = columns().map(|name| (name, negated(case, &fitted, name)));
    let best = flipped.min_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, other)| is_wrong(stated, *other));
    let Some((name, other)) = best else { return Ok(()) };
    refused(format!(
        "column `{name}` has the other sign than in the declared model: the declared model {}; multiply the column by -1 in all files, or correct the declared model",
        compared(stated, other)
    ))
}

/// Error of the declared model over the spread of some records; no number where it diverges.
fn error(rig: &Rig, records: &[usize]) -> f64 {
    let found = errors(rig.system.as_ref(), records, &neutral()).nrmse;
    let square = found.values().map(|error| error * error).sum::<f64>() / found.len().max(1) as f64;
    square.sqrt()
}

/// The same with a column negated; no number where the records do not fit the declared model then.
fn negated(case: &Case, records: &[usize], column: &str) -> f64 {
    let file = |&k: &usize| File { role: Role::Estimation, ..case.declaration.files[k].clone() };
    let files = records.iter().map(file).collect();
    let own = Case {
        declaration: Declaration { files, ..case.declaration.clone() },
        records: records.iter().map(|&k| case.records[k].negated(column)).collect(),
        notes: Vec::new(),
    };
    let all: Vec<usize> = (0..records.len()).collect();
    open(&own).map_or(f64::NAN, |rig| error(&rig, &all))
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
