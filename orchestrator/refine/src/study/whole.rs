//! A study as one system of the engine, with its candidates and models as the engine has them: the parameter vector
//! says which candidates act.

use super::command::Command;
use super::fits::{self, Fits};
use super::law::Law;
use super::model::{Action, Study};
use super::simulate::{Piece, View};
use crate::engine::candidate::{Candidate, Start};
use crate::engine::fit::Free;
use crate::engine::noise::Noise;
use crate::engine::search::Model;
use crate::engine::{Span, System};

/// Least samples of the beginning of a record.
const MIN_SAMPLES_OF_BEGINNING: usize = 16;

/// Pieces of a study in which every candidate acts whose parameters are not all zero.
pub struct Whole<'a> {
    /// Nothing active; residuals in units of the floor.
    view: View<'a>,
    /// Sentences for a progress display.
    say: &'a (dyn Fn(&str) + Sync),
}

impl<'a> Whole<'a> {
    /// Pieces with the error that sensors give, by output.
    pub fn new(view: &View<'a>, floor: Vec<f64>, say: &'a (dyn Fn(&str) + Sync)) -> Whole<'a> {
        Whole { view: View { active: Vec::new(), scale: floor, ..view.clone() }, say }
    }

    /// The view in which the candidates of a parameter vector act.
    fn at(&self, p: &[f64]) -> View<'a> {
        View { active: active(self.view.study, p), ..self.view.clone() }
    }
}

/// Candidates whose parameters are not all zero; vectors from before a candidate came have none of it.
pub fn active(study: &Study, p: &[f64]) -> Vec<usize> {
    let is_set = |index: usize| p.get(index).is_some_and(|value| *value != 0.0);
    let acts = |&c: &usize| study.candidates[c].entries.clone().any(is_set);
    (0..study.candidates.len()).filter(acts).collect()
}

impl System for Whole<'_> {
    fn records(&self) -> usize {
        self.view.records()
    }
    fn estimation(&self, record: usize) -> bool {
        self.view.estimation(record)
    }
    fn locals(&self, record: usize) -> Vec<(f64, f64)> {
        self.view.locals(record)
    }
    fn signals(&self, record: usize) -> Vec<Span> {
        self.view.signals(record)
    }
    fn predict(&self, record: usize, parameters: &[f64], locals: &[f64]) -> Vec<f64> {
        self.at(parameters).predict(record, parameters, locals)
    }
    fn measured(&self, record: usize) -> Vec<f64> {
        self.view.measured(record)
    }
    fn silence(&self, record: usize, residuals: &mut [f64]) {
        self.view.silence(record, residuals);
    }

    fn whiten(&self, record: usize, predicted: &[f64]) -> Vec<f64> {
        self.view.whiten(record, predicted)
    }
    fn redraw(&self, record: usize, predicted: &[f64], noise: &mut Noise) -> Vec<f64> {
        self.view.redraw(record, predicted, noise)
    }
    fn beginning(&self, share: f64) -> Option<Box<dyn System + '_>> {
        if self.view.study.windows.is_some() {
            return None;
        }
        let cut = |piece: &Piece| {
            let n = (piece.range.len() as f64 * share) as usize;
            let n = n.max(MIN_SAMPLES_OF_BEGINNING).min(piece.range.len());
            Piece { record: piece.record, range: piece.range.start..piece.range.start + n }
        };
        let pieces = self.view.pieces.iter().map(cut).collect();
        Some(Box::new(Whole { view: View { pieces, ..self.view.clone() }, say: self.say }))
    }
    fn stage(&self, name: &str) {
        (self.say)(name);
    }
}

/// Id of an effect that others contain or that contains one, that of the contained one, and its place.
fn special_case(action: Action) -> (&'static str, Option<&'static str>, usize) {
    let memory = match action {
        Action::Command { kind, .. } | Action::Block { law: Law::Memory(kind), .. } => Some(kind),
        _ => None,
    };
    let (id, contains) = match (memory, action) {
        (Some(Command::Lag), _) => ("lag", None),
        (Some(Command::Fill), _) => ("fill", Some("lag")),
        // With much damping.
        (Some(Command::Mode), _) => ("mode", Some("lag")),
        (_, Action::Block { law: Law::Saturation, .. }) => ("saturation", None),
        (_, Action::Block { law: Law::Limits, .. }) => ("limits", Some("saturation")),
        (_, Action::Block { law: Law::Leakage, .. }) => ("linear_leakage", None),
        (_, Action::Block { law: Law::Overflow, .. }) => ("overflow", None),
        (_, Action::Block { law: Law::CaughtOverflow, .. }) => ("caught_overflow", Some("overflow")),
        // Far above the pressure outside.
        (_, Action::Block { law: Law::Choked, .. }) => ("choked_flow", Some("linear_leakage")),
        _ => ("", None),
    };
    let place = match action {
        Action::Command { input, .. } => input,
        Action::Block { tap, .. } => tap,
        _ => 0,
    };
    (id, contains, place)
}

/// A candidate as the engine sees it; names stay in the study.
pub fn candidate(study: &Study, c: usize) -> Candidate {
    let own = &study.candidates[c];
    let free: Vec<Free> = own.entries.clone().map(|index| study.entries[index].free).collect();
    let first = own.entries.start;
    let start = |values: &Vec<f64>| {
        let (open, set): (Vec<usize>, Vec<usize>) = (0..values.len()).partition(|&k| values[k] == 0.0);
        let idle = !open.is_empty();
        Start { values: set.into_iter().map(|k| (first + k, values[k])).collect(), open, idle }
    };
    let starts = own.starts.iter().map(start).collect();
    let (id, contains, place) = special_case(own.action);
    Candidate { id, channel: own.channel, signal: None, free, starts, place, contains }
}

/// A model of the engine as one of the study.
pub fn model(fits: &Fits, own: &Model) -> fits::Model {
    let p = &own.fit.parameters;
    let records: Vec<usize> = (0..fits.pieces.len()).collect();
    // Changes of declared parameters are no candidates of the study.
    let added: Vec<usize> = own.added.iter().copied().filter(|&c| c < fits.study.candidates.len()).collect();
    let view = fits.view(&added, &fits.pieces);
    // Local parameters of whole records; spans of them had their own.
    let locals = if own.fit.locals.len() == fits.pieces.len() {
        own.fit.locals.clone()
    } else {
        fits.grow(&added, &fits.pieces, p, &[], &[1.0], 8).locals
    };
    let chi2: f64 =
        records.iter().flat_map(|&r| view.residuals(r, p, &locals[r])).map(|value| value * value).sum();
    let mut fit = own.fit.clone();
    (fit.locals, fit.chi2) = (locals, chi2);
    let error = fits.rms(chi2);
    fits::Model::new(added, fit, error)
}
