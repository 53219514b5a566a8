//! Signs of the columns of a study: the declared model is fitted with the other sign of every column, and of every
//! signal where a column makes several.

use toml::Spanned;

use super::declaration::{File, Signal};
use super::fits::Fits;
use super::model::Study;
use super::rescaled::{MAX_RATIO_OF_EQUALS, Place, by_column, multiply};
use crate::Error;
use crate::answer::{Answer, Verdict};
use crate::order::ascending;
use crate::sign::{MIN_ERROR, RECORDS, compared, is_wrong};

/// Error with the other sign, over the spread of the records, up to which the sign is wrong whatever the model lacks.
/// Above, an effect that is missing may turn the phase of a signal as a wrong sign does: a stiff spring at a free mass.
const MAX_ERROR_OF_CLEAR_SIGN: f64 = 0.5;
/// Ratio of the errors of an answer and of the declared model with the other sign up to which the answer explains what
/// looked like a wrong sign.
const MAX_RATIO_OF_ANSWER: f64 = 0.5;

/// A column that may have the other sign, if the search finds nothing better.
pub struct Suspicion {
    other: f64,
    refusal: Error,
}

impl Suspicion {
    /// Refuses the study unless the answer leaves much less than the other sign does.
    ///
    /// # Errors
    /// That of [`check`].
    pub fn settle(self, found: &Answer) -> Result<(), Error> {
        let named = matches!(found.verdict, Verdict::Effect | Verdict::Law);
        let left = &found.after[0].nrmse;
        let power = left.values().map(|error| error * error).sum::<f64>() / left.len().max(1) as f64;
        if named && power.sqrt() <= MAX_RATIO_OF_ANSWER * self.other { Ok(()) } else { Err(self.refusal) }
    }
}

/// Refuses a study one of whose columns has the other sign; call it where the declared model is fitted. A column that
/// is not clear before the search is returned.
///
/// # Errors
/// Column, errors with both signs, and `scale` to be written, at the place of the signal.
pub fn check(file: &File, study: &mut Study) -> Result<Option<Suspicion>, Error> {
    let stated = error(study);
    if stated <= MIN_ERROR {
        return Ok(None);
    }
    let mut found: Vec<(f64, Vec<Place>)> = Vec::new();
    for places in by_column(study) {
        multiply(&mut study.records, &places, -1.0);
        let other = error(study);
        multiply(&mut study.records, &places, -1.0);
        if is_wrong(stated, other) {
            found.push((other, places));
        }
    }
    // In a linear system a command and a sensor of the other sign leave the same.
    let least = found.iter().map(|own| own.0).fold(f64::INFINITY, f64::min);
    found.retain(|own| own.0 <= MAX_RATIO_OF_EQUALS * least);
    ascending(&mut found, |own| own.0);
    match found.first().map(|own| own.0) {
        Some(other) => {
            let rivals: Vec<&[Place]> = found.iter().map(|own| &own.1[..]).collect();
            let refusal = refusal(file, study, &rivals, (stated, other));
            let clear = other <= MAX_ERROR_OF_CLEAR_SIGN || !stated.is_finite();
            if clear { Err(refusal) } else { Ok(Some(Suspicion { other, refusal })) }
        }
        None => Ok(None),
    }
}

/// Error of the declared model over the spread of the outputs on the first estimation records.
fn error(study: &Study) -> f64 {
    let mut fits = Fits::new(study, study.spreads());
    fits.pieces.truncate(RECORDS);
    fits.declared().error
}

/// The error that tells key and place in the file of the other sign; `rivals`: what may be of it, best first.
fn refusal(file: &File, study: &Study, rivals: &[&[Place]], (stated, other): (f64, f64)) -> Error {
    let mut at: Option<&Spanned<Signal>> = None;
    let (mut columns, mut remedies) = (Vec::new(), Vec::new());
    for places in rivals {
        let mut own = Vec::new();
        for &(list, index) in *places {
            let Some(signal) = &study.sensors.signals[list][index] else { continue };
            let Some(column) = signal.source() else { continue };
            if !columns.contains(column) {
                columns.push(column.clone());
            }
            let (table, name) = stated_as(file, study, (list, index));
            let declaration = &file.declaration;
            at = at.or(match list {
                0 => declaration.inputs.get(&name),
                1 => declaration.states.get(&name),
                2 => declaration.signals.get(&name),
                _ => None,
            });
            own.push(format!("`scale = {}` at {table}.{name}", -signal.scale.unwrap_or(1.0)));
        }
        remedies.push(own.join(", "));
    }
    let columns: Vec<String> = columns.iter().map(|column| format!("`{column}`")).collect();
    let problem = format!(
        "column {} has the other sign than in the declared model: the declared model {}; write {} (a command that acts in the other direction, a sensor that counts in the other), or correct the model",
        columns.join(" or "),
        compared(stated, other),
        remedies.join(", or ")
    );
    match at.filter(|_| columns.len() == 1) {
        Some(at) => file.refuse(at, problem),
        None => file.refuse_all(problem),
    }
}

/// Table and key of a signal in the file.
fn stated_as(file: &File, study: &Study, (list, index): Place) -> (&'static str, String) {
    match list {
        0 => ("inputs", study.graph.inputs[index].name.clone()),
        2 => ("signals", study.extra[index].clone()),
        3 => ("outputs", study.outputs[index].port.clone()),
        _ => {
            let signal = study.sensors.signals[list][index].as_ref();
            let own = file.declaration.states.iter().find(|(_, own)| Some(own.get_ref()) == signal);
            ("states", own.map(|(name, _)| name.clone()).unwrap_or_default())
        }
    }
}
