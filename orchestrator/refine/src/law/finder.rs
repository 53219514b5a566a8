//! The search for a law at the ports of a study: what all its steps share, and the fits beside a law.

use std::sync::OnceLock;

use super::grammar::Axis;
use super::study::{Aim, motion};
use super::surface::{Surface, knots};
use super::windows::{WINDOWS, Windows};
use super::written::name;
use crate::answer::Errors;
use crate::engine::System;
use crate::engine::fit::Free;
use crate::engine::normal::Columns;
use crate::engine::stop;
use crate::study::changed::corrected;
use crate::study::colored;
use crate::study::explain::{self, Judge};
use crate::study::fits::{Fits, Model};
use crate::study::law::{Point, Variable};
use crate::study::model::Study;
use crate::study::search::Say;

/// Ratio of the error of a free form on estimation records to that which a law may leave on validation records, or to
/// what counts as noise, from which on no formula for it is looked for.
const MAX_ERROR_OF_FREE_FORM: f64 = 2.0;
/// The same where a law is to explain a share: a curve through a few knots leaves more of a narrow law than a formula.
const MAX_ERROR_OF_FREE_FORM_OF_SHARE: f64 = 3.0;
/// Ratio of the error without an effect to that with it, up to which the law beside it does without it.
const MAX_ERROR_WITHOUT: f64 = 1.01;

/// Error in multiples of that of white noise above which no noise of a sensor is what a law leaves.
const MAX_FLOORS_OF_NOISE: f64 = 10.0;

/// Where a law is looked for, and what it may leave.
pub(super) struct Scope<'a> {
    /// Errors on validation records of the model that lacks the law.
    pub(super) lacking: &'a Errors,
    /// Error on estimation records that a law may leave where it leaves more than noise, in units of the scales.
    pub(super) enough: f64,
    /// See [`Finder::wide`].
    pub(super) wide: bool,
    /// See [`Finder::max_tolerances`].
    pub(super) max_tolerances: f64,
}

/// A search for a law beside a model of a study.
pub(super) struct Finder<'a> {
    pub(super) aim: Aim,
    pub(super) scale: &'a [f64],
    pub(super) say: Say<'a>,
    /// Corrections of the declared model that are fitted beside a law.
    pub(super) corrections: Vec<Free>,
    /// Simulations with steps of second order, where they change the error of the declared model by next to nothing.
    pub(super) quick: bool,
    /// Signals at the attachments, `[taps][n]`.
    pub(super) trace: Vec<Vec<Point>>,
    /// Windows in which free forms are compared; none: whole records.
    pub(super) windows: Option<Windows>,
    /// Sum of squares that the noise of the sensors gives.
    pub(super) noise: f64,
    /// Error of a free form from which on no formula for it is looked for.
    pub(super) max_error: f64,
    /// Whether laws over the motion at other ports and laws with a memory are tried.
    pub(super) wide: bool,
    /// Tolerances up to which declared parameters are corrected beside a law that leaves noise.
    pub(super) max_tolerances: f64,
    /// Effects beside which a law is looked for, fitted along with it: candidates.
    pub(super) beside: Vec<usize>,
    /// Errors on validation records of the model that lacks the law.
    pub(super) lacking: Errors,
    /// Residuals where free forms begin, and their derivatives by what is fitted along with them.
    pub(super) unmoved: OnceLock<Vec<Columns>>,
}

impl<'a> Finder<'a> {
    /// A search beside a model: the declared one with its corrections, or that with effects.
    pub(super) fn new(
        study: &Study,
        scale: &'a [f64],
        (judge, base): (&Judge, &Model),
        aim: Aim,
        scope: Scope,
        say: Say<'a>,
    ) -> Finder<'a> {
        let fits = Fits::new(study, scale.to_vec());
        let samples: usize = fits.pieces.iter().map(|piece| piece.range.len()).sum();
        let noise: f64 = study.outputs.iter().zip(scale).map(|(o, s)| (o.noise / s).powi(2)).sum();
        let ratio = if aim.is_share() { MAX_ERROR_OF_FREE_FORM_OF_SHARE } else { MAX_ERROR_OF_FREE_FORM };
        Finder {
            aim,
            scale,
            say,
            corrections: corrected(study, &base.fit),
            trace: motion(&fits, base),
            windows: Windows::new(&fits, base, WINDOWS),
            quick: fits.quickened(base).quick,
            noise: noise * samples as f64,
            max_error: ratio * scope.enough.max(judge.tolerated.max(judge.power).sqrt()),
            wide: scope.wide,
            max_tolerances: scope.max_tolerances,
            beside: base.added.clone(),
            lacking: scope.lacking.clone(),
            unmoved: OnceLock::new(),
        }
    }
}

impl Finder<'_> {
    /// The effects beside which a law is looked for, and one of its candidates.
    pub(super) fn acting(&self, candidate: usize) -> Vec<usize> {
        self.beside.iter().copied().chain([candidate]).collect()
    }

    /// A model without the effects that the law in it does without.
    pub(super) fn needed(&self, fits: &Fits, model: Model) -> Model {
        let mut found = model;
        for c in self.beside.iter().rev() {
            let rest: Vec<usize> = found.added.iter().copied().filter(|own| own != c).collect();
            if rest.iter().any(|own| fits.study.candidates[*own].needs == Some(*c)) || stop::asked() {
                continue;
            }
            let without = fits.fit_from(rest, &found.fit.parameters, &found.fit.locals);
            let most = MAX_ERROR_WITHOUT * found.error;
            found = without.filter(|own| own.error <= most).unwrap_or(found);
        }
        found
    }

    pub(super) fn fits<'s>(&self, study: &'s Study) -> Fits<'s> {
        let corrections = self.corrections.clone();
        Fits { quick: self.quick, corrections, ..Fits::new(study, self.scale.to_vec()) }
    }

    /// The same with all steps of integration of the study, by which an answer is weighed.
    pub(super) fn fits_with_all_steps<'s>(&self, study: &'s Study) -> Fits<'s> {
        Fits { quick: false, ..self.fits(study) }
    }

    pub(super) fn unit(study: &Study, tap: usize, variable: Variable) -> String {
        let [value, velocity, position] = &study.taps[tap].units;
        match variable {
            Variable::Velocity => velocity.clone(),
            Variable::Position => position.clone(),
            Variable::Time => "s".into(),
            _ => value.clone(),
        }
    }

    /// Parameters that are fitted beside a law.
    pub(super) fn shared(&self, study: &Study) -> Vec<Free> {
        let entries = |c: &usize| study.candidates[*c].entries.clone();
        let beside = self.beside.iter().flat_map(entries).map(|index| study.entries[index].free);
        study.declared_free().into_iter().chain(self.corrections.iter().copied()).chain(beside).collect()
    }

    pub(super) fn axes(&self, study: &Study, tap: usize, surface: &Surface) -> Vec<Axis> {
        let axis = |(variable, knots): (&Variable, &Vec<f64>)| Axis {
            name: name(*variable),
            unit: Self::unit(study, tap, *variable),
            range: (knots[0], knots[knots.len() - 1]),
        };
        surface.variables.iter().zip(&surface.knots).map(axis).collect()
    }

    /// Knots of a variable that moves at an attachment and is known there.
    pub(super) fn knots(
        &self,
        study: &Study,
        tap: usize,
        variable: Variable,
        count: usize,
    ) -> Option<Vec<f64>> {
        let known = study.taps[tap].signals;
        let there = match variable {
            Variable::Velocity => known[0].is_some(),
            Variable::Position => known[1].is_some(),
            _ => true,
        };
        let values: Vec<f64> = self.trace[tap].iter().map(|point| point.of(variable)).collect();
        knots(variable, &values, count).filter(|_| there)
    }

    /// Fits with residuals in units of the noise, in which tolerances of corrections have their weight.
    pub(super) fn fits_in_noise<'s>(&self, study: &'s Study, corrections: Vec<Free>) -> Fits<'s> {
        Fits { corrections, ..Fits::new(study, explain::noises(study)) }
    }

    /// A model fitted beside corrections in units of the noise.
    pub(super) fn in_noise(&self, study: &Study, corrections: &[Free], model: &Model) -> Option<Model> {
        let fits = self.fits_in_noise(study, corrections.to_vec());
        let model = fits.fit_from(model.added.clone(), &model.fit.parameters, &model.fit.locals)?;
        Some(Model { error: self.error(study, &model), ..model })
    }

    /// Whether a model leaves so little that it may be noise of the sensors, white or not.
    pub(super) fn may_leave_noise(&self, judge: &Judge, model: &Model) -> bool {
        judge.floors(model.error.powi(2)) < MAX_FLOORS_OF_NOISE
    }

    /// Noise by output that a model fitted beside `corrections` leaves, if it leaves nothing else; see
    /// [`colored::left`].
    pub(super) fn noise_left(
        &self,
        study: &Study,
        judge: &Judge,
        corrections: &[Free],
        model: &Model,
    ) -> Option<Vec<f64>> {
        colored::left(&self.fits_in_noise(study, corrections.to_vec()), judge, model)
    }

    /// Error of a model in the units of the search.
    pub(super) fn error(&self, study: &Study, model: &Model) -> f64 {
        let fits = self.fits_with_all_steps(study);
        let view = fits.view(&model.added, &fits.pieces);
        let residuals = |r: usize| view.residuals(r, &model.fit.parameters, &model.fit.locals[r]);
        fits.rms((0..fits.pieces.len()).flat_map(residuals).map(|own| own * own).sum())
    }
}
