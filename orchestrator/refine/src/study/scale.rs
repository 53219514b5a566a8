//! Sizes of the columns of a study: a column of another unit is found before the search, not explained by it as an
//! effect.

use super::declaration::File;
use super::errors::errors;
use super::fits::Fits;
use super::mistaken::{MIN_STEP_OF_MILLISECONDS, Mistake, causes, mistakes, remedy};
use super::model::Study;
use super::prepared::Played;
use super::rescaled::{MAX_RATIO_OF_EQUALS, MAX_RATIO_OF_MENDED, UNITS};
use crate::Error;
use crate::engine::fit::Fit;
use crate::engine::settings::{MAX_ERROR_OF_OTHER_UNIT, MIN_FACTOR_OF_OTHER_UNIT};
use crate::engine::stop;
use crate::order::ascending;
use crate::sign::of_spread;

/// Ratio of the factors of outputs up to which one command may be the reason of all.
const MAX_RATIO_OF_FACTORS: f64 = 1.2;

/// Ratio of the errors of the other outputs with another unit and as it is up to which they are no worse.
const MAX_RATIO_OF_AS_GOOD: f64 = 1.1;
/// Records that are compared.
const RECORDS: usize = 3;

/// A measured output against what the declared model gives there.
struct Size {
    output: usize,
    /// Factor from the model to the record.
    factor: f64,
    /// Errors over the spread of the records: without and with the factor.
    errors: [f64; 2],
}

/// Refuses a study one of whose outputs, or the command of all, has another unit than in the declared model.
///
/// # Errors
/// Column, factor, errors without and with it, and what to write where.
pub fn check(file: &File, study: &Study, played: &[Played]) -> Result<(), Error> {
    let outputs = study.outputs.len();
    let sizes: Vec<Size> = (0..outputs).filter_map(|o| size(played, o, outputs)).collect();
    let other = |own: &Size| {
        let factor = own.factor.abs();
        own.errors[1] <= MAX_ERROR_OF_OTHER_UNIT
            && (factor >= MIN_FACTOR_OF_OTHER_UNIT || factor <= 1.0 / MIN_FACTOR_OF_OTHER_UNIT)
    };
    let Some(worst) =
        sizes.iter().filter(|own| other(own)).min_by(|a, b| a.errors[1].total_cmp(&b.errors[1]))
    else {
        return Ok(());
    };
    let alike = |own: &Size| {
        let ratio = own.factor / worst.factor;
        (1.0 / MAX_RATIO_OF_FACTORS..MAX_RATIO_OF_FACTORS).contains(&ratio)
    };
    let by_command = sizes.len() == outputs && sizes.len() > 1 && sizes.iter().all(alike);
    let output = &study.outputs[worst.output];
    let key = match by_command {
        true => "the input that drives them".to_owned(),
        false => format!("outputs.{}", output.port),
    };
    let percent = worst.errors.map(|error| format!("{:.0} %", 100.0 * error));
    let problem = format!(
        "{} {:.3e} times as large as in the declared model, which leaves an error of {} of the spread of the records, and {} with that factor: another unit? Its column says it behind the name, as in `p [bar]`, or `unit` or `scale` at {key}; else correct the model",
        if by_command { "all outputs are".to_owned() } else { format!("column `{}` is", output.name) },
        worst.factor,
        percent[0],
        percent[1],
    );
    match file.declaration.outputs.get(&output.port).filter(|_| !by_command) {
        Some(at) => Err(file.refuse(at, problem)),
        None => Err(file.refuse_all(problem)),
    }
}

/// Refuses a study whose declared model follows its records only once a mistake in a column of all of them is undone:
/// sensors in a larger unit than that of the model or inputs in a smaller one, another zero, two columns exchanged.
/// With windows, which start from measured values, whatever the error is; else where it is large.
///
/// # Errors
/// Columns, mistake, errors as it is and with it undone, and what to write.
pub fn check_columns(file: &File, study: &mut Study, declared: &Fit, played: &[Played]) -> Result<(), Error> {
    let outputs = study.outputs.len();
    let first = &played[..played.len().min(RECORDS)];
    let is_far = (0..outputs).any(|o| error(first, o, outputs) > MAX_ERROR_OF_OTHER_UNIT);
    if study.windows.is_none() && !is_far || stop::asked() {
        return Ok(());
    }
    let stated = errors_on_first(study, &declared.parameters);
    // Fits to columns of another unit may have led the free parameters anywhere; a fit for each unit takes too long.
    let mut parameters = vec![declared.parameters.clone()];
    parameters.extend((!study.declared_free().is_empty()).then(|| study.start()));
    let mut found: Vec<(f64, Mistake, usize)> = Vec::new();
    let kept = study.records.clone();
    let units = |drives: bool| UNITS.map(|unit| if drives { unit } else { 1.0 / unit }).to_vec();
    let slow = study.records.iter().all(|record| record.step >= MIN_STEP_OF_MILLISECONDS);
    let times = (slow && study.windows.is_none()).then_some(Mistake::Milliseconds);
    for mistake in mistakes(study, &units).into_iter().chain(times) {
        if stop::asked() {
            return Ok(());
        }
        mistake.undo(&mut study.records);
        for p in &parameters {
            let other = errors_on_first(study, p);
            let as_good = |(own, stated): (&f64, &f64)| {
                *own <= MAX_RATIO_OF_AS_GOOD * stated || own.is_finite() && !stated.is_finite()
            };
            let all_as_good = other.iter().zip(&stated).all(as_good);
            let shows = |&o: &usize| {
                let mended = other[o] <= MAX_RATIO_OF_MENDED * stated[o] || !stated[o].is_finite();
                all_as_good && other[o] <= MAX_ERROR_OF_OTHER_UNIT && mended
            };
            let most = (0..stated.len()).filter(shows).max_by(|&a, &b| stated[a].total_cmp(&stated[b]));
            found.extend(most.map(|o| (other[o], mistake.clone(), o)));
        }
        study.records.clone_from(&kept);
    }
    ascending(&mut found, |own| own.0);
    let Some(least) = found.first().map(|own| own.0) else { return Ok(()) };
    found.retain(|own| own.0 <= MAX_RATIO_OF_EQUALS * least);
    let o = found[0].2;
    let place = if study.windows.is_some() { "in windows the declared model" } else { "the declared model" };
    let stated = match stated[o] {
        error if error.is_finite() => {
            format!("leaves an error of {} the spread of `{}`", of_spread(error), study.outputs[o].name)
        }
        _ => format!("cannot follow `{}`", study.outputs[o].name),
    };
    Err(file.refuse_all(format!(
        "{}: {place} {stated}, and {:.0} % without that. {}",
        causes(study, found.iter().map(|own| &own.1)),
        100.0 * least,
        remedy(&found[0].1),
    )))
}

/// Errors of the declared model over the spread of the outputs on the first estimation records.
fn errors_on_first(study: &Study, p: &[f64]) -> Vec<f64> {
    let fits = Fits::new(study, study.spreads());
    let pieces = &fits.pieces[..fits.pieces.len().min(RECORDS)];
    let found = errors(&fits, &[], pieces, p, None);
    study.outputs.iter().map(|output| found.nrmse.get(&output.name).copied().unwrap_or(0.0)).collect()
}

/// Error of the declared model over the spread of an output.
fn error(played: &[Played], output: usize, outputs: usize) -> f64 {
    let (mut left, mut spread) = (0.0, 0.0);
    for own in played {
        let [given, measured] = own.output(output, outputs);
        let mean = measured.iter().sum::<f64>() / measured.len().max(1) as f64;
        left += given.iter().zip(measured).map(|(m, y)| (y - m).powi(2)).sum::<f64>();
        spread += measured.iter().map(|y| (y - mean).powi(2)).sum::<f64>();
    }
    (left / spread).sqrt()
}

/// Least squares of an output over what the model gives, each about its mean on the second half of every record.
fn size(played: &[Played], output: usize, outputs: usize) -> Option<Size> {
    // Sums of products: model with itself, model with record, record with itself, error with itself.
    let mut sums = [0.0; 4];
    for own in played {
        // Initial states that were fitted to another size show at the beginning.
        let [given, measured] = own.output(output, outputs).map(|values| &values[values.len() / 2..]);
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
        let means = [mean(given), mean(measured)];
        for (m, y) in given.iter().zip(measured) {
            let (m, y) = (m - means[0], y - means[1]);
            let products = [m * m, m * y, y * y, (y - m).powi(2)];
            sums.iter_mut().zip(products).for_each(|(sum, own)| *sum += own);
        }
    }
    let [model, both, record, error] = sums;
    let factor = both / model;
    let left = record - factor * both;
    let errors = [error, left].map(|square| (square.max(0.0) / record).sqrt());
    let finite = factor.is_finite() && errors.iter().all(|own| own.is_finite());
    finite.then_some(Size { output, factor, errors })
}
