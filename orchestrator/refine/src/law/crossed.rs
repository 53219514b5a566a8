//! Free forms at a port over the motion at other ports: a force that couples two joints or tanks depends on both
//! motions.

use super::elsewhere::least;
use super::finder::Finder;
use super::free_form::FreeForm;
use super::place::{CURVE_KNOTS, MAX_ERROR_WITHOUT_SECOND, SCREENING_KNOTS, SURFACE_KNOTS};
use crate::engine::stop;
use crate::study::fits::Model;
use crate::study::law::Variable;
use crate::study::model::{Study, Tap};

/// Pairs of ports of which one may depend on the motion at the other; with more the search takes too long.
const MAX_PAIRS_OF_PORTS: usize = 6;

/// Place of velocity and position in a motion: port (0 the port itself, 1 the other) and variable there.
type Shown = (usize, Variable);

/// Velocity and position of the motions at a port `a` that are looked at beside its own, `b` another port.
const MOTIONS: [[Shown; 2]; 5] = [
    [(1, Variable::Velocity), (1, Variable::Position)],
    [(1, Variable::Velocity), (0, Variable::Position)],
    [(0, Variable::Velocity), (1, Variable::Position)],
    [(0, Variable::Velocity), (1, Variable::Velocity)],
    [(1, Variable::Position), (0, Variable::Position)],
];

impl Finder<'_> {
    /// The best form over the motion at other ports, at its optimum, if it leaves much less than `own`.
    pub(super) fn crossed(
        &mut self,
        study: &mut Study,
        declared: &Model,
        own: &FreeForm,
    ) -> Option<FreeForm> {
        let pairs = pairs(study);
        if pairs.is_empty() || pairs.len() > MAX_PAIRS_OF_PORTS || stop::asked() {
            return None;
        }
        (self.say)("free forms over the motion at other ports");
        self.instead_of(own, study, |finder, study| finder.over_motions(study, declared, &pairs))
    }

    /// The best form over the motions of some pairs of ports, at its optimum.
    fn over_motions(
        &mut self,
        study: &mut Study,
        declared: &Model,
        pairs: &[[usize; 2]],
    ) -> Option<FreeForm> {
        let mut forms = Vec::new();
        for &pair in pairs {
            let tap = self.show(study, pair, MOTIONS[0]);
            for variable in [Variable::Position, Variable::Velocity] {
                forms.extend(self.over(study, declared, tap, &[variable], &[SCREENING_KNOTS]));
            }
        }
        let noise = self.noise;
        let hopeful = |form: &FreeForm| form.is_hopeful(noise);
        let mut best = least(forms).filter(hopeful).and_then(|form| {
            let variable = form.surface.variables[0];
            let fine = self.over(study, declared, form.tap, &[variable], &[CURVE_KNOTS])?;
            self.toward(study, fine)
        });
        let alone = |best: &Option<FreeForm>| {
            let limit = MAX_ERROR_WITHOUT_SECOND * noise;
            best.as_ref().is_some_and(|form| form.at.smooth.held_out < limit)
        };
        if !alone(&best) {
            let mut forms = Vec::new();
            for &pair in pairs {
                for motion in MOTIONS {
                    if !stop::asked() {
                        let tap = self.show(study, pair, motion);
                        let both = [Variable::Position, Variable::Velocity];
                        forms.extend(self.over(study, declared, tap, &both, &[SURFACE_KNOTS; 2]));
                    }
                }
            }
            let two = least(forms).filter(hopeful).and_then(|form| self.toward(study, form));
            let better =
                |two: &FreeForm| best.as_ref().is_none_or(|one| two.excess(noise) < 0.5 * one.excess(noise));
            best = two.filter(better).or(best);
        }
        best
    }

    /// An attachment at the first port of a pair that shows a motion of both.
    fn show(&mut self, study: &mut Study, pair: [usize; 2], motion: [Shown; 2]) -> usize {
        let own = &study.taps[pair[0]];
        let slot = |(port, variable): Shown| study.taps[pair[port]].signals[place(variable)];
        let name = |(port, variable): Shown| {
            let at = &study.taps[pair[port]].attachment;
            if variable == Variable::Velocity { at.velocity.clone() } else { at.position.clone() }
        };
        let unit = |(port, variable): Shown| study.taps[pair[port]].units[1 + place(variable)].clone();
        let [velocity, position] = motion;
        let mut attachment = own.attachment.clone();
        (attachment.velocity, attachment.position) = (name(velocity), name(position));
        let tap = Tap {
            signals: [slot(velocity), slot(position), None, None],
            words: motion.map(|shown| name(shown).unwrap_or_default()),
            units: [own.units[0].clone(), unit(velocity), unit(position)],
            attachment,
            crossed: Some(pair[0]),
            ..own.clone()
        };
        let [v, x] = motion.map(|(port, variable)| (&self.trace[pair[port]], variable));
        let points = self.trace[pair[0]].iter().enumerate().map(|(k, point)| {
            let mut point = *point;
            (point.velocity, point.position) = (v.0[k].of(v.1), x.0[k].of(x.1));
            point
        });
        let points = points.collect();
        self.attach(study, tap, points)
    }
}

/// Place of a variable among the signals of an attachment.
fn place(variable: Variable) -> usize {
    usize::from(variable == Variable::Position)
}

/// Ports that forces are looked for at, each with every other one whose motion is known.
fn pairs(study: &Study) -> Vec<[usize; 2]> {
    let moves = |tap: &Tap| {
        let forces = tap.attachment.port.is_none_or(|duty| duty.forces);
        forces && tap.crossed.is_none() && tap.signals[..2].iter().any(Option::is_some)
    };
    let ports: Vec<usize> = (0..study.taps.len()).filter(|&tap| moves(&study.taps[tap])).collect();
    let apart = |a: usize, b: usize| study.taps[a].signals[..2] != study.taps[b].signals[..2];
    ports.iter().flat_map(|&a| ports.iter().filter(move |&&b| apart(a, b)).map(move |&b| [a, b])).collect()
}
