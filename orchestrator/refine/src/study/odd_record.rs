//! One record among several with a column of another sign, unit or zero, or with two exchanged: told before the
//! search, which would mix it into every answer, or blame validation records for it.

use super::declaration::{File, Role};
use super::errors::errors;
use super::fits::Fits;
use super::mistaken::{Mistake, causes, mistakes};
use super::model::Study;
use super::rescaled::{MAX_RATIO_OF_EQUALS, MAX_RATIO_OF_MENDED, factors};
use super::simulate::Piece;
use crate::Error;
use crate::engine::fit::Fit;
use crate::engine::stop;
use crate::order::ascending;
use crate::regime::deviation;
use crate::sign::{MAX_ERROR_OF_OTHERS, goes_with, is_odd, median, of_spread};

/// Records up to which the declared model is fitted without each of them where it follows none.
const MAX_RECORDS_LEFT_OUT: usize = 12;
/// Spread of an output in multiples of its noise below which a record says nothing of it.
const MIN_SPREAD_OVER_NOISE: f64 = 5.0;

/// Refuses a study one of whose records goes with the others only if the sign or the unit of a column is another. A
/// search that must end judges nothing: its declared model may not be fitted yet.
///
/// # Errors
/// Record, column, errors as it is, mended, and of the others, and what to do.
pub fn check(file: &File, study: &mut Study, declared: &Fit) -> Result<(), Error> {
    let counts = |r: &usize| {
        let role = study.records[*r].role;
        role == Role::Estimation || role == Role::Validation
    };
    let records: Vec<usize> = (0..study.records.len()).filter(counts).collect();
    if stop::asked() {
        return Ok(());
    }
    let all = Fitted::new(study, &records, declared.parameters.clone());
    let is_far = |o: usize| all.others(o, None).is_some_and(|error| error > MAX_ERROR_OF_OTHERS);
    let is_quick = records.len() <= MAX_RECORDS_LEFT_OUT && !study.declared_free().is_empty();
    let is_pulled = is_quick && (0..study.outputs.len()).any(is_far);
    for (k, &r) in records.iter().enumerate() {
        if stop::asked() {
            return Ok(());
        }
        // Parameters that were fitted to the odd record, too, fit none.
        let is_fitted = study.records[r].role == Role::Estimation;
        let without = (is_pulled && is_fitted).then(|| Fitted::without(study, &records, r));
        let rest = without.as_ref().unwrap_or(&all);
        let others: Vec<Option<f64>> = (0..study.outputs.len()).map(|o| rest.others(o, Some(k))).collect();
        let odd = rest.left[k].iter().zip(&others).enumerate();
        let odd = odd.filter_map(|(o, (left, others))| Some((o, (*left)?, (*others)?)));
        let odd = odd.filter(|&(_, left, others)| is_odd(left, others));
        // No number is the largest error.
        let Some((o, left, others_there)) = odd.max_by(|a, b| a.1.total_cmp(&b.1)) else { continue };
        let mended = mended(study, r, &rest.parameters, (&rest.left[k], &others), o);
        if let Some(best) = mended.first() {
            return Err(refusal(file, study, (r, o), &mended, [left, best.error, others_there]));
        }
    }
    Ok(())
}

/// A record that goes with the others once a mistake in its columns is undone.
struct Mended {
    /// Of the odd output over its spread.
    error: f64,
    mistake: Mistake,
}

/// Ways to mend the output `o` of a record that make no other one worse, best first, if they do so equally. `left`,
/// `others`: errors of the outputs as they are, and on the other records.
fn mended(
    study: &mut Study,
    record: usize,
    p: &[f64],
    (left, others): (&[Option<f64>], &[Option<f64>]),
    o: usize,
) -> Vec<Mended> {
    let (kept, mut found) = (study.records[record].clone(), Vec::new());
    let before = left[o].unwrap_or(f64::NAN);
    for mistake in mistakes(study, &|_| factors().collect()) {
        if stop::asked() {
            return Vec::new();
        }
        mistake.undo(&mut study.records[record..=record]);
        let with = errors_of_outputs(study, record, p);
        study.records[record].clone_from(&kept);
        let goes = |o: usize| {
            let known = with[o].zip(left[o]).zip(others[o]);
            known.is_none_or(|((own, left), others)| goes_with(own, others) || own <= left)
        };
        let error = with[o].unwrap_or(f64::NAN);
        let is_better = error <= MAX_RATIO_OF_MENDED * before || before.is_nan() && error.is_finite();
        let fits = others[o].is_some_and(|others| goes_with(error, others));
        if is_better && fits && (0..with.len()).all(goes) {
            found.push(Mended { error, mistake });
        }
    }
    ascending(&mut found, |own| own.error);
    let least = found.first().map_or(f64::NAN, |own| own.error);
    found.retain(|own| own.error <= MAX_RATIO_OF_EQUALS * least);
    found
}

/// The declared model with parameters fitted to some records, and its errors on all.
struct Fitted {
    parameters: Vec<f64>,
    /// Over the spread of each output of each record; none where a record shows nothing but noise of it.
    left: Vec<Vec<Option<f64>>>,
}

impl Fitted {
    fn new(study: &Study, records: &[usize], parameters: Vec<f64>) -> Fitted {
        let one = |&r: &usize| {
            let mut found = errors_of_outputs(study, r, &parameters);
            for (error, (output, values)) in
                found.iter_mut().zip(study.outputs.iter().zip(&study.records[r].outputs))
            {
                *error = error.filter(|_| deviation(values) > MIN_SPREAD_OVER_NOISE * output.noise);
            }
            found
        };
        Fitted { left: records.iter().map(one).collect(), parameters }
    }

    /// Fitted to the estimation records but one.
    fn without(study: &Study, records: &[usize], record: usize) -> Fitted {
        let mut fits = Fits::new(study, study.spreads());
        fits.pieces.retain(|piece| piece.record != record);
        let parameters = if fits.pieces.is_empty() { study.start() } else { fits.declared().fit.parameters };
        Fitted::new(study, records, parameters)
    }

    /// The middle one of the errors of an output on records but one; none where no other shows it.
    fn others(&self, output: usize, record: Option<usize>) -> Option<f64> {
        let others = self.left.iter().enumerate().filter(|(k, _)| Some(*k) != record);
        let errors: Vec<f64> = others.filter_map(|(_, left)| left[output]).collect();
        (!errors.is_empty()).then(|| median(&errors))
    }
}

/// Errors of the declared model over the spread of the outputs of one record, its initial states fitted where the study
/// says so; no number where it diverges.
fn errors_of_outputs(study: &Study, record: usize, p: &[f64]) -> Vec<Option<f64>> {
    let fits = Fits::new(study, vec![1.0; study.outputs.len()]);
    let own = &study.records[record];
    let found = errors(&fits, &[], &[Piece { record, range: 0..own.n }], p, None);
    study.outputs.iter().map(|output| found.nrmse.get(&output.name).copied()).collect()
}

fn refusal(
    file: &File,
    study: &Study,
    (record, output): (usize, usize),
    mended: &[Mended],
    [left, least, others]: [f64; 3],
) -> Error {
    let own = &study.records[record];
    let share = |error: f64| format!("{:.0} %", 100.0 * error);
    let stated = if left.is_finite() {
        format!("leaves an error of {} the spread of `{}`", of_spread(left), study.outputs[output].name)
    } else {
        "cannot be simulated over it".to_owned()
    };
    let problem = format!(
        "{} does not go with the other records: {}. There the declared model {stated}, {} without that, and {} on the others. Mend the file (a unit behind the name of a column, as in `p [bar]`, is converted), or leave its [[segment]] out",
        own.name,
        causes(study, mended.iter().map(|own| &own.mistake)),
        share(least),
        share(others),
    );
    let segment = file.declaration.segment.iter();
    let mut segment = segment.filter(|segment| {
        let segment = segment.get_ref();
        segment.role == own.role && own.name.starts_with(&segment.file)
    });
    match segment.next() {
        Some(at) => file.refuse(at, problem),
        None => file.refuse_all(problem),
    }
}
