//! A study as one system of the engine: which candidates act follows from the parameter vector.

use super::model::Study;
use super::simulate::View;
use crate::engine::noise::Noise;
use crate::engine::{Span, System};

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

/// Candidates whose parameters are not all zero.
pub fn active(study: &Study, p: &[f64]) -> Vec<usize> {
    let acts = |&c: &usize| study.candidates[c].entries.clone().any(|index| p[index] != 0.0);
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
    fn whiten(&self, record: usize, predicted: &[f64]) -> Vec<f64> {
        self.view.whiten(record, predicted)
    }
    fn redraw(&self, record: usize, predicted: &[f64], noise: &mut Noise) -> Vec<f64> {
        self.view.redraw(record, predicted, noise)
    }
    fn stage(&self, name: &str) {
        (self.say)(name);
    }
}
