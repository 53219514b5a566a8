//! Free forms at a port over measured signals that are no motion of a port: a friction that falls as a motor heats up
//! depends on a temperature, a valve on a pressure.

use super::elsewhere::least;
use super::finder::Finder;
use super::free_form::FreeForm;
use super::place::{SCREENING_KNOTS, SURFACE_KNOTS};
use crate::engine::stop;
use crate::study::catalog;
use crate::study::declaration::Role;
use crate::study::fits::{Model, pieces};
use crate::study::law::{Point, Variable};
use crate::study::model::{Study, Tap};
use crate::study::names;

/// Pairs of a port and a signal at most; with more the search takes too long.
const MAX_PAIRS: usize = 8;
/// Knots of such a signal beside those of a variable of the port.
const SIGNAL_KNOTS: usize = 4;

impl Finder<'_> {
    /// The best form over a measured signal that belongs to no port, with the velocity at the port or the value that
    /// passes where they are known, at its optimum, if it leaves much less than `own`.
    pub(super) fn observed(
        &mut self,
        study: &mut Study,
        declared: &Model,
        own: &FreeForm,
    ) -> Option<FreeForm> {
        let pairs = pairs(study);
        if pairs.is_empty() || pairs.len() > MAX_PAIRS || stop::asked() {
            return None;
        }
        (self.say)("free forms over other measured signals");
        let most = own.excess(self.noise);
        self.instead_of(own, study, |finder, study| finder.over_signals(study, declared, &pairs, most))
    }

    /// The best form over the signals of some pairs of a port and a measured output, at its optimum, if its excess over
    /// noise is less than `most` before.
    fn over_signals(
        &mut self,
        study: &mut Study,
        declared: &Model,
        pairs: &[(usize, usize)],
        most: f64,
    ) -> Option<FreeForm> {
        let mut forms = Vec::new();
        for &(port, output) in pairs {
            let tap = self.observe(study, port, output);
            let two = [Variable::Velocity, Variable::Value].map(|other| [Variable::Position, other]);
            let before = forms.len();
            for variables in two {
                if stop::asked() || catalog::channel_of(&study.taps[tap].attachment, variables[1]).is_none() {
                    continue;
                }
                let knots = [SIGNAL_KNOTS, SURFACE_KNOTS];
                forms.extend(self.over(study, declared, tap, &variables, &knots));
            }
            if forms.len() == before && !stop::asked() {
                forms.extend(self.over(study, declared, tap, &[Variable::Position], &[SCREENING_KNOTS]));
            }
        }
        let noise = self.noise;
        let best = least(forms).filter(|form| form.is_hopeful(noise) && form.excess(noise) < most)?;
        self.toward(study, best)
    }

    /// An attachment at a port that shows a measured output in place of the position there.
    fn observe(&mut self, study: &mut Study, port: usize, output: usize) -> usize {
        let (own, signal) = (&study.taps[port], &study.outputs[output]);
        let unit = names::unit_of(&study.graph, &signal.port).unwrap_or_else(|| signal.unit.clone());
        let mut attachment = own.attachment.clone();
        attachment.position = Some(signal.port.clone());
        let tap = Tap {
            signals: [own.signals[0], Some(signal.slot), None, None],
            words: [own.words[0].clone(), signal.name.clone()],
            units: [own.units[0].clone(), own.units[1].clone(), unit],
            attachment,
            crossed: Some(port),
            ..own.clone()
        };
        let estimation = pieces(study, Role::Estimation);
        let measured = estimation
            .iter()
            .flat_map(|piece| &study.records[piece.record].outputs[output][piece.range.clone()]);
        let points = self.trace[port].iter().zip(measured);
        let points = points.map(|(point, value)| Point { position: *value, ..*point }).collect();
        self.attach(study, tap, points)
    }
}

/// Ports, each with the measured outputs that are no motion at a port; where a port itself does not move, with every
/// output.
fn pairs(study: &Study) -> Vec<(usize, usize)> {
    let of_a_port = |slot: usize| study.taps.iter().any(|tap| tap.signals.contains(&Some(slot)));
    let mut ports: Vec<usize> = Vec::new();
    for (tap, own) in study.taps.iter().enumerate() {
        let known = ports.iter().any(|&other| study.taps[other].name == own.name);
        if own.crossed.is_none() && !known {
            ports.push(tap);
        }
    }
    let moves = |tap: &Tap| tap.signals[..2].iter().any(Option::is_some);
    let outputs = |port: usize| {
        let still = !moves(&study.taps[port]);
        let here = move |o: &usize| still || !of_a_port(study.outputs[*o].slot);
        (0..study.outputs.len()).filter(here).map(move |o| (port, o))
    };
    ports.into_iter().flat_map(outputs).collect()
}
