//! A study before its search: records read and cleaned, the declared model fitted, the candidates filled in.

use super::catalog;
use super::declaration::{Attachment, File, Role};
use super::fits::{Fits, pieces};
use super::horizon;
use super::integration;
use super::mistaken::MIN_STEP_OF_MILLISECONDS;
use super::model::Study;
use super::observability;
use super::odd_record;
use super::open::open;
use super::scale;
use super::search::Say;
use super::settled;
use super::sign;
use super::simulate::Piece;
use super::spiked;
use super::starts;
use super::tolerance;
use crate::Error;
use crate::engine::System;
use crate::engine::fit::Fit;
use crate::vocabulary::attach;

/// A study before the search.
pub struct Prepared {
    /// With its candidates.
    pub study: Study,
    /// Where effects may act.
    pub attachments: Vec<Attachment>,
    /// The fitted declared model.
    pub declared: Fit,
    /// A column whose sign the answer has to settle.
    pub suspicion: Option<sign::Suspicion>,
}

/// Reads a study, fits its declared model with at least so many steps of integration per sample, and fills in the
/// candidates.
///
/// # Errors
/// A declaration, records or a system that do not fit together, and a declared model that cannot be simulated.
pub fn prepared(file: &File, least_substeps: usize, say: Say) -> Result<Prepared, Error> {
    let (mut study, attachments) = open(file)?;
    study.substeps = integration::substeps(&study).max(least_substeps);
    study.unobservable = observability::unobservable(&study);
    say("fitting the declared model");
    let fitted = declared(file, &study);
    let fitted = fitted.map(|declared| (played(&study, &declared), declared));
    if let Ok((played, declared)) = &fitted {
        odd_record::check(file, &mut study, declared)?;
        if study.windows.is_some() {
            scale::check_columns(file, &mut study, declared, played)?;
        }
        horizon::check(file, &study, declared, played)?;
    }
    let suspicion = sign::check(file, &mut study)?;
    let (played, declared) = fitted?;
    scale::check(file, &study, &played)?;
    settled::check(file, &study, &played)?;
    if study.windows.is_none() {
        scale::check_columns(file, &mut study, &declared, &played)?;
    }
    spiked::silence(&mut study, &declared);
    study.starts = starts::starts(&study, &[], &declared.parameters);
    let (mut survey, trace) = {
        let fits = Fits::new(&study, vec![1.0; study.outputs.len()]);
        let view = fits.view(&[], &fits.pieces);
        (view.survey(&declared.parameters, &declared.locals), fits.trace(&[], &declared))
    };
    study.ranges.clone_from(&survey.ranges);
    let inputs: Vec<String> = study.graph.inputs.iter().map(|input| input.name.clone()).collect();
    let fed: Vec<bool> =
        (0..inputs.len()).map(|i| study.records.iter().all(|record| record.inputs[i].is_some())).collect();
    let place = |name: &str| inputs.iter().position(|input| input == name).filter(|&i| fed[i]);
    survey.trace(&trace);
    catalog::fill(&mut study, &attachments, &survey, &place);
    attach::fill(&mut study, &attachments, &file.effects, &trace);
    tolerance::fill(&mut study, file);
    if study.candidates.is_empty() {
        return Err(file.refuse_all(
            "there is no effect to look for; add an [[attachment]] with an input, its channels, and the signals of velocity and position",
        ));
    }
    Ok(Prepared { study, attachments, declared, suspicion })
}

/// An estimation record beside what the fitted declared model gives.
pub(super) struct Played {
    /// Record, by its place.
    pub record: usize,
    /// Outputs of the model, `[outputs][n]` in one.
    pub given: Vec<f64>,
    /// Those of the record.
    pub measured: Vec<f64>,
}

impl Played {
    /// Output `o` of model and record, `[n]` each.
    pub fn output(&self, o: usize, outputs: usize) -> [&[f64]; 2] {
        let n = self.given.len() / outputs.max(1);
        [&self.given, &self.measured].map(|own| &own[o * n..(o + 1) * n])
    }
}

fn played(study: &Study, declared: &Fit) -> Vec<Played> {
    let fits = Fits::new(study, vec![1.0; study.outputs.len()]);
    let view = fits.view(&[], &fits.pieces);
    let one = |(piece, own): (usize, &Piece)| Played {
        record: own.record,
        given: view.predict(
            piece,
            &declared.parameters,
            declared.locals.get(piece).map_or(&[], Vec::as_slice),
        ),
        measured: view.measured(piece),
    };
    fits.pieces.iter().enumerate().map(one).collect()
}

/// A hint where samples are far apart.
fn slow_samples(step: f64) -> String {
    if step < MIN_STEP_OF_MILLISECONDS {
        return String::new();
    }
    format!(
        ". Its samples are {step:.4} s apart: if its time is in milliseconds, the header has to say so, as in `time [ms]`"
    )
}

/// Fits the declared model: its free parameters and initial states.
fn declared(file: &File, study: &Study) -> Result<Fit, Error> {
    let fits = Fits::new(study, study.spreads());
    for role in [Role::Estimation, Role::Validation] {
        let pieces = if role == Role::Estimation { fits.pieces.clone() } else { pieces(study, role) };
        let view = fits.view(&[], &pieces);
        for (piece, local) in Fits::locals(&view).iter().enumerate() {
            let residuals = view.residuals(piece, &study.start(), local);
            let Some(at) = residuals.iter().position(|value| !value.is_finite()) else { continue };
            let record = &study.records[view.pieces[piece].record];
            let cause = match study.failure() {
                Some(failure) => failure,
                // Fitted parameters and initial states may keep it from that.
                None if role == Role::Validation => continue,
                None => format!(
                    "it diverges after {:.3} s; check parameters, units, initial states and step_s{}",
                    (at % record.n) as f64 * record.step,
                    slow_samples(record.step)
                ),
            };
            return Err(file
                .refuse_all(format!("the declared model cannot be simulated on {}: {cause}", record.name)));
        }
    }
    Ok(fits.declared().fit)
}
