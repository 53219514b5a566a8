//! A system of FMUs on the records of a study, as the study compares them: windows, fitted initial states, derived
//! inputs.
//!
//! With the amended system of a report the errors are those that the report prints.

use std::collections::BTreeMap;
use std::path::Path;

use toml::Spanned;

use super::declaration::{File, Initial, InitialWord, Role};
use super::errors::{errors_from, initial};
use super::fits::{Fits, pieces};
use super::integration;
use super::model::Study;
use super::observability;
use super::open::{self, open};
use super::plant::Plant;
use super::simulate::{Piece, View};
use crate::Error;
use crate::answer::Errors;
use crate::engine::System;
use airloop_cosim::system::SystemGraph;
use airloop_series::TimeSeries;

/// Fewest samples of the beginning of a free run to which its initial states are fitted.
const MIN_FITTED_SAMPLES: usize = 16;

/// A system on one record.
#[derive(Debug, Clone)]
pub struct Replayed {
    /// Name of the record.
    pub record: String,
    /// Use of the record.
    pub role: Role,
    /// Errors by output.
    pub errors: Errors,
    /// Time \[s\]; each output as measured (its column) and as simulated (`COLUMN simulated`).
    pub series: TimeSeries,
}

/// Errors on all estimation and on all validation records, and every record alone.
#[derive(Debug, Clone)]
pub struct Replay {
    /// Estimation, validation.
    pub errors: [Errors; 2],
    /// Records in the order of the study.
    pub records: Vec<Replayed>,
}

/// Simulates `system` (`.ssd`, `.ssp`, `.fmu`, or `airloop:NAME`) with the inputs, initial states and windows of a
/// study.
///
/// Parameters are those of the system: what the study declares or leaves free has its values there. Only offsets of
/// sensors and initial states that the study fits are fitted. With `beginning` \[s\] every record is one free run
/// instead: its initial states are fitted to so much of its beginning, and errors are those of the rest.
///
/// # Errors
/// Names of the study that the system does not have, a simulation that fails, and a beginning that leaves nothing of a
/// record.
pub fn replay(file: &File, system: &Path, beginning: Option<f64>) -> Result<Replay, Error> {
    let file = with_system(file, system)?;
    let mut study = opened(&file)?;
    if let Some(beginning) = beginning {
        free_run(&file, &mut study, beginning)?;
    }
    let fits = Fits::new(&study, study.outputs.iter().map(|output| output.noise).collect());
    let p = declared(&fits);
    let samples = |piece: &Piece| beginning.map(|time| first_samples(&study, piece, time));
    let initial = |pieces: &[Piece]| {
        let fitted: Vec<Piece> = pieces
            .iter()
            .map(|own| Piece { range: 0..samples(own).unwrap_or(own.range.end), ..own.clone() })
            .collect();
        initial(&fits, &[], &fitted, &p)
    };
    let compared = |pieces: &[Piece], locals: &[Vec<f64>]| {
        let from: Vec<usize> = pieces.iter().map(|own| samples(own).unwrap_or(0)).collect();
        errors_from(&fits, &[], (pieces, &from), &p, locals)
    };
    let of_role = |role: Role| {
        let own = pieces(&study, role);
        compared(&own, &initial(&own))
    };
    let roles = [of_role(Role::Estimation), of_role(Role::Validation)];
    let mut records = Vec::new();
    for role in ROLES {
        for piece in pieces(&study, role) {
            let record = &study.records[piece.record];
            let own = [piece];
            let locals = initial(&own);
            let (predicted, measured) = on_record(&file, &fits, &own, &p, &locals[0])?;
            let refused = |error: airloop_series::Error| file.refuse_all(format!("{}: {error}", record.name));
            let time = (0..record.n).map(|k| k as f64 * record.step).collect();
            let mut series = TimeSeries::new(time).map_err(refused)?;
            for (span, output) in fits.view(&[], &own).signals(0).into_iter().zip(&study.outputs) {
                let unit = Some(output.unit.clone());
                let simulated = format!("{} simulated", span.signal);
                let values = measured[span.range.clone()].to_vec();
                series.push(span.signal, unit.clone(), values).map_err(refused)?;
                series.push(simulated, unit, predicted[span.range].to_vec()).map_err(refused)?;
            }
            let errors = compared(&own, &locals);
            records.push(Replayed { record: record.name.clone(), role, errors, series });
        }
    }
    Ok(Replay { errors: roles, records })
}

/// A record as a system gives it, and as it was measured.
#[derive(Debug, Clone)]
pub(super) struct Simulated {
    /// Name of the record.
    pub record: String,
    /// Use of the record.
    pub role: Role,
    /// Number of outputs.
    pub outputs: usize,
    /// Samples from one restart of the simulation to the next.
    pub window: Option<usize>,
    /// Outputs one after the other.
    pub predicted: Vec<f64>,
    /// As `predicted`.
    pub measured: Vec<f64>,
}

/// All records as `system` gives them (none: the declared one with its free parameters fitted), initial states fitted
/// where the study says so.
///
/// # Errors
/// Those of [`replay`].
pub(super) fn simulated(file: &File, system: Option<&Path>) -> Result<Vec<Simulated>, Error> {
    let file = system.map_or_else(|| Ok(file.clone()), |system| with_system(file, system))?;
    let study = opened(&file)?;
    let fits = Fits::new(&study, study.outputs.iter().map(|output| output.noise).collect());
    let p = declared(&fits);
    let own = ROLES.into_iter().flat_map(|role| pieces(&study, role));
    own.map(|piece| {
        let record = &study.records[piece.record];
        let own = [piece];
        let locals = initial(&fits, &[], &own, &p);
        let (predicted, measured) = on_record(&file, &fits, &own, &p, &locals[0])?;
        let window = study.window(record.step);
        let (name, outputs) = (record.name.clone(), study.outputs.len());
        Ok(Simulated { record: name, role: record.role, outputs, window, predicted, measured })
    })
    .collect()
}

/// Uses of records in the order in which they are told.
const ROLES: [Role; 4] = [Role::Estimation, Role::Validation, Role::Repeat, Role::Rest];

/// A study with its steps of integration, no candidates.
fn opened(file: &File) -> Result<Study, Error> {
    let (mut study, _) = open(file)?;
    study.substeps = integration::substeps(&study);
    study.unobservable = observability::unobservable(&study);
    Ok(study)
}

/// Parameter vector of the declared model, what it has free fitted.
fn declared(fits: &Fits) -> Vec<f64> {
    if fits.study.declared > 0 { fits.declared().fit.parameters } else { fits.study.start() }
}

/// Outputs of a record as simulated and as measured, one after the other.
fn on_record(
    file: &File,
    fits: &Fits,
    own: &[Piece; 1],
    p: &[f64],
    locals: &[f64],
) -> Result<(Vec<f64>, Vec<f64>), Error> {
    let record = &fits.study.records[own[0].record];
    let view = View { corrected: false, ..fits.view(&[], own) };
    let (predicted, measured) = (view.predict(0, p, locals), view.measured(0));
    if let Some(at) = predicted.iter().position(|value| !value.is_finite()) {
        let diverges = || format!("it diverges after {:.3} s", (at % record.n) as f64 * record.step);
        return Err(file.refuse_all(format!(
            "the system cannot be simulated on {}: {}",
            record.name,
            fits.study.failure().unwrap_or_else(diverges)
        )));
    }
    Ok((predicted, measured))
}

/// Samples of a record in the first `time` \[s\] of it.
fn first_samples(study: &Study, piece: &Piece, time: f64) -> usize {
    (time / study.records[piece.record].step).round() as usize
}

/// Makes every record of a study one simulation from fitted initial states.
fn free_run(file: &File, study: &mut Study, beginning: f64) -> Result<(), Error> {
    study.windows = None;
    let plant = study.take().map_err(|problem| file.refuse_all(problem.to_string()))?;
    for record in &mut study.records {
        let (fitted, length) = (beginning / record.step, record.n as f64 * record.step);
        if !(fitted >= MIN_FITTED_SAMPLES as f64 && fitted + 1.0 < record.n as f64) {
            return Err(file.refuse_all(format!(
                "a free run cannot fit initial states to the first {beginning} s of {}, which has {length:.3} s in steps of {:.3e} s; give a time between {:.3} s and that",
                record.name,
                record.step,
                MIN_FITTED_SAMPLES as f64 * record.step
            )));
        }
        // Fits begin where the study says, or where the states were measured.
        if let Initial::Given(values) = &record.initial {
            for (name, value) in values {
                if let Some(state) = plant.state(name) {
                    record.states[state].get_or_insert_with(|| vec![*value; record.n]);
                }
            }
        }
        record.initial = Initial::Word(InitialWord::Fit);
    }
    study.give(plant);
    Ok(())
}

/// Refuses an input for which the study has no column and which its own system does not have: those it leaves at their
/// start values.
fn fed(file: &File, graph: &SystemGraph) -> Result<(), Error> {
    let own = open::system(file);
    let known = |name: &str| {
        let left = own.as_ref().is_ok_and(|own| own.inputs.iter().any(|input| input.name == name));
        let declared = &file.declaration;
        left || declared.inputs.contains_key(name) || declared.signals.contains_key(name)
    };
    match graph.inputs.iter().find(|input| !known(&input.name)) {
        None => Ok(()),
        Some(input) => Err(file.refuse_all(format!(
            "the system has an input `{0}`, for which the study has no column; add [inputs] {0} = {{ column = \"...\" }} with the column that feeds it, or run the system with --measured, where it keeps its start value",
            input.name
        ))),
    }
}

/// The study of another system: no parameters, nothing to look for; states by the names that they have there.
fn with_system(file: &File, system: &Path) -> Result<File, Error> {
    let mut own = file.clone();
    let span = file.declaration.system.span();
    let path = if system.to_string_lossy().starts_with(open::OWN) {
        system.to_owned()
    } else {
        let path = system.canonicalize();
        path.map_err(|error| Error::Case { path: system.into(), problem: error.to_string() })?
    };
    let declaration = &mut own.declaration;
    declaration.system = Spanned::new(span, path.to_string_lossy().into_owned());
    declaration.parameters.clear();
    declaration.tolerance.clear();
    declaration.free.clear();
    declaration.fit_identified = Some(false);
    declaration.attachment.clear();
    declaration.error.force = None;
    let graph = open::system(&own)?;
    fed(file, &graph)?;
    // Signals of the study that blocks of the amended system see are inputs of it.
    for input in &graph.inputs {
        if let Some(signal) = file.declaration.signals.get(&input.name) {
            own.declaration.inputs.entry(input.name.clone()).or_insert_with(|| signal.clone());
        }
    }
    let plant = Plant::new(&graph, &[], &[], &[])
        .map_err(|problem| file.refuse(&file.declaration.system, problem))?;
    let named = |name: &str| -> String {
        if plant.state(name).is_some() {
            return name.to_owned();
        }
        let known = |path: &String| plant.state(path).is_some() || Plant::parameter(&graph, path).is_some();
        let owners = graph.components.iter().map(|component| format!("{}.{name}", component.name));
        owners.into_iter().find(known).unwrap_or_else(|| name.to_owned())
    };
    let states = std::mem::take(&mut own.declaration.states);
    own.declaration.states = states.into_iter().map(|(name, signal)| (named(&name), signal)).collect();
    for segment in &mut own.declaration.segment {
        let span = segment.span();
        let mut inner = segment.get_ref().clone();
        if let Some(Initial::Given(values)) = &mut inner.initial {
            let old = std::mem::take(values);
            *values = old.into_iter().map(|(name, value)| (named(&name), value)).collect::<BTreeMap<_, _>>();
        }
        *segment = Spanned::new(span, inner);
    }
    Ok(own)
}
