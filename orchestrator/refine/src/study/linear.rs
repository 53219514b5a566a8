//! A simulation with its linearization from sample to sample: derivatives by the heights of a free form, and by the
//! states at the beginning, without a simulation for each.
//!
//! Between two samples the states move by `A dx + B w`, where `w` is what a change of a height adds to the value at the
//! port; the outputs move by `C dx + D w`. A and C come from steps that begin beside the trajectory, B and D from one
//! with a constant added at the port. What a height adds is known along the trajectory, so that its derivative is a
//! product of small matrices.

use std::cell::RefCell;

use super::law::{Law, Point};
use super::model::{Action, Study};
use super::simulate::{Shift, View};
use crate::engine::fit::Free;
use crate::engine::system::Derivatives;
use crate::engine::{System, stop};
use crate::law::surface::Surface;

/// Difference step of a state over its size so far, and the least size.
const STEP: f64 = 1e-6;
const LEAST_SIZE: f64 = 1e-3;

/// Linearization of a simulation, recorded sample by sample.
#[derive(Debug, Default)]
pub(super) struct Linear {
    /// Constant added at the port for B and D.
    pub(super) offset: f64,
    /// Attachment where the form acts.
    pub(super) tap: usize,
    /// Number of states.
    pub(super) nx: usize,
    /// By sample: A, shape \[nx, nx\], by column; then B, shape \[nx\]. Zero behind the last sample.
    moves: Vec<f64>,
    /// By sample: C, shape \[outputs, nx\], by column; then D, shape \[outputs\].
    shows: Vec<f64>,
    /// By sample: what the port shows there, and at the end of the step.
    points: Vec<[Point; 2]>,
    /// By sample: whether the simulation begins anew there, from the states that are measured.
    restarts: Vec<bool>,
    /// Whether each state is measured, `[nx]`.
    measured: Vec<bool>,
    /// Sizes of the states so far, `[nx]`.
    sizes: Vec<f64>,
    /// Room for states and outputs.
    from: Vec<f64>,
    base: (Vec<f64>, Vec<f64>),
    moved: (Vec<f64>, Vec<f64>),
}

impl Linear {
    /// For a system with so many states and outputs, a form at the attachment `tap`.
    fn new(measured: Vec<bool>, outputs: usize, tap: usize, offset: f64) -> Linear {
        let nx = measured.len();
        let room = || (vec![0.0; nx], vec![0.0; outputs]);
        let (sizes, from) = (vec![LEAST_SIZE; nx], vec![0.0; nx]);
        Linear { offset, tap, nx, measured, sizes, from, base: room(), moved: room(), ..Linear::default() }
    }

    /// Records a sample with states `x`, `[nx]`. `advance(from, offset, to, outputs)`: outputs there, and the states a
    /// step later, with a constant added at the port; gives the point of the port at both ends.
    pub(super) fn record<E>(
        &mut self,
        x: &[f64],
        restarts: bool,
        mut advance: impl FnMut(&[f64], f64, &mut [f64], &mut [f64]) -> Result<[Point; 2], E>,
    ) -> Result<(), E> {
        let points = advance(x, 0.0, &mut self.base.0, &mut self.base.1)?;
        self.points.push(points);
        self.restarts.push(restarts);
        for i in 0..=self.nx {
            self.from.copy_from_slice(x);
            let (step, offset) = match self.sizes.get_mut(i) {
                Some(size) => {
                    *size = size.max(x[i].abs());
                    self.from[i] += STEP * *size;
                    (self.from[i] - x[i], 0.0)
                }
                None => (self.offset, self.offset),
            };
            advance(&self.from, offset, &mut self.moved.0, &mut self.moved.1)?;
            let slope = |(moved, base): (&f64, &f64)| (moved - base) / step;
            self.moves.extend(self.moved.0.iter().zip(&self.base.0).map(slope));
            self.shows.extend(self.moved.1.iter().zip(&self.base.1).map(slope));
        }
        Ok(())
    }

    /// Derivatives of the outputs by the heights of a form, each `[outputs][n]`, and by the states at the beginning.
    fn derivatives(&self, surface: &Surface, sign: f64) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
        let (n, nx, outputs) = (self.points.len(), self.nx, self.base.1.len());
        let heights = surface.heights();
        let count = heights + nx;
        let mut found = vec![vec![0.0; n * outputs]; count];
        // Changes of the states by each parameter, `[count][nx]`.
        let mut z = vec![0.0; count * nx];
        let mut next = vec![0.0; nx];
        // What each height adds at both ends of a step.
        let mut added = vec![[0.0; 2]; heights];
        for (k, points) in self.points.iter().enumerate() {
            if self.restarts[k] {
                let measured = self.measured.iter().cycle();
                z.iter_mut().zip(measured).filter(|own| *own.1).for_each(|(change, _)| *change = 0.0);
            }
            if k == 0 {
                (0..nx).for_each(|i| z[(heights + i) * nx + i] = 1.0);
            }
            added.fill([0.0; 2]);
            for (end, point) in points.iter().enumerate() {
                surface.each_weight(point, |height, weight| added[height][end] -= sign * weight);
            }
            let moves = &self.moves[k * (nx + 1) * nx..][..(nx + 1) * nx];
            let shows = &self.shows[k * (nx + 1) * outputs..][..(nx + 1) * outputs];
            for (a, own) in found.iter_mut().enumerate() {
                let z = &mut z[a * nx..][..nx];
                let [begin, end] = added.get(a).copied().unwrap_or_default();
                for o in 0..outputs {
                    let by_states: f64 = (0..nx).map(|i| shows[i * outputs + o] * z[i]).sum();
                    own[o * n + k] = by_states + shows[nx * outputs + o] * begin;
                }
                let w = 0.5 * (begin + end);
                for (to, value) in next.iter_mut().enumerate() {
                    let by_states: f64 = (0..nx).map(|i| moves[i * nx + to] * z[i]).sum();
                    *value = by_states + moves[nx * nx + to] * w;
                }
                z.copy_from_slice(&next);
            }
        }
        let begins = found.split_off(heights);
        (found, begins)
    }
}

/// The free form that acts, if nothing beside it has a memory or stands behind the outputs: its surface, its port, and
/// its first parameter.
fn form<'a>(study: &'a Study, active: &[usize]) -> Option<(&'a Surface, usize, usize)> {
    let mut found = None;
    for &c in active {
        let own = &study.candidates[c];
        match own.action {
            Action::Block { law: Law::Surface(index), tap } => {
                let form = (study.surfaces.get(index)?, tap, own.entries.start);
                if found.replace(form).is_some() {
                    return None;
                }
            }
            Action::Block { law: Law::Presliding | Law::Own(_) | Law::Memory(_), .. }
            | Action::Sensor { .. } => return None,
            _ => {}
        }
    }
    found
}

impl View<'_> {
    /// Derivatives of the residuals by the heights of a free form among `free`, and by states at the beginning that are
    /// fitted along; none where simulations are as fast, or the system is not smooth between samples.
    pub(super) fn linearized(
        &self,
        record: usize,
        p: &[f64],
        locals: &[f64],
        free: &[Free],
    ) -> Option<Derivatives> {
        let (study, outputs) = (self.study, self.study.outputs.len());
        let (surface, tap, first) = form(study, &self.active)?;
        let place = |free: &Free| free.index.checked_sub(first).filter(|k| *k < surface.heights());
        let offset = free.iter().find(|free| place(free).is_some())?.step;
        let plant = study.take().ok()?;
        let (is_smooth, nx) = (!study.sampled && plant.is_smooth(), plant.nx);
        study.give(plant);
        let piece = &self.pieces[record];
        // Steps of the linearization for each sample: beside each state, at the port, and along the way twice.
        let simulations = free.iter().filter(|free| place(free).is_some()).count();
        if !is_smooth || simulations <= nx + 3 || self.begin(piece) != piece.range.start || stop::asked() {
            return None;
        }
        let mut blocks = self.blocks(p, false);
        let states = &study.records[piece.record].states;
        let measured = (0..nx).map(|i| states.get(i).is_some_and(Option::is_some)).collect();
        blocks.linear = Some(RefCell::new(Linear::new(measured, outputs, tap, offset)));
        self.simulate(piece, p, locals, &mut blocks, &Shift::default());
        let linear = blocks.linear.map(RefCell::into_inner);
        let linear = linear.filter(|own| own.points.len() == piece.range.len())?;
        let (heights, begins) = linear.derivatives(surface, study.taps[tap].sign);
        let n = piece.range.len();
        let residual = |mut own: Vec<f64>| {
            own.iter_mut().enumerate().for_each(|(i, value)| *value /= -self.scale[i / n]);
            self.silence(record, &mut own);
            self.without_starts(record, &mut own);
            own
        };
        let mut heights: Vec<Option<Vec<f64>>> = heights.into_iter().map(|own| Some(residual(own))).collect();
        let shared: Vec<_> = free.iter().map(|free| place(free).and_then(|k| heights[k].take())).collect();
        let locals = (!self.begins.is_empty()).then(|| begins.into_iter().map(residual).collect());
        let finite = |own: &Vec<f64>| own.iter().all(|value| value.is_finite());
        shared.iter().flatten().all(finite).then_some(Derivatives { shared, locals })
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use airloop_testing::carriage;

    use super::*;
    use crate::engine::System;
    use crate::engine::normal::{columns, dot};
    use crate::law::study::push;
    use crate::study::declaration::File;
    use crate::study::fits::Fits;
    use crate::study::law::Variable;
    use crate::study::model::{Entry, Target};
    use crate::study::prepared::prepared;
    use crate::study::simulate::Piece;

    /// Derivatives that are simulated.
    const FEW: usize = 5;

    /// A carriage whose record shows dry friction; a form over its motion, its candidate, and parameters with which it
    /// is a stiff friction that rises with the position.
    fn with_form(folder: &Path) -> (Study, usize, Vec<f64>) {
        carriage::fmu(folder);
        carriage::record(&folder.join("record.csv"), 3.0, 0.3);
        carriage::record(&folder.join("other.csv"), 3.0, 1.1);
        let text = "name = \"carriage\"\nsystem = \"carriage.fmu\"\n[inputs]\ndrive = { column = \"force\", unit = \"N\", hold = true }\n[outputs]\nplace = { column = \"position\", unit = \"m\", noise = 1e-5 }\nspeed = { column = \"speed\", unit = \"m/s\", noise = 2e-4 }\n[[segment]]\nfile = \"record.csv\"\nrole = \"estimation\"\ninitial = { place = 0.0, speed = 0.0 }\n[[segment]]\nfile = \"other.csv\"\nrole = \"validation\"\ninitial = { place = 0.0, speed = 0.0 }\n[parameters]\n\"weight\" = 4.0\n\"drag\" = 6.0\n";
        let path = folder.join("study.toml");
        fs::write(&path, text).unwrap();
        let mut study = prepared(&File::read(&path).unwrap(), 1, &|_| {}).unwrap().study;
        let knots = vec![vec![-2.0, -1.0, 0.0, 1.0, 2.0], vec![-2.0, -0.2, 0.2, 2.0]];
        let surface = Surface::new(vec![Variable::Position, Variable::Velocity], knots);
        let heights = surface.heights_of(|at| (1.0 + 0.2 * at[0]) * (3.0 * at[1]).tanh());
        let first = study.entries.len();
        let entries = heights.iter().enumerate().map(|(k, height)| {
            let bounds = (f64::NEG_INFINITY, f64::INFINITY);
            let free = Free { index: first + k, bounds, step: 1e-4, prior: None };
            Entry {
                name: format!("height {k}"),
                unit: "N".into(),
                target: Target::Effect,
                start: *height,
                free,
            }
        });
        let entries = entries.collect();
        study.surfaces.push(surface);
        let action = Action::Block { law: Law::Surface(0), tap: 0 };
        let candidate = push(&mut study, action, entries, "", "form".into());
        let mut p = study.start();
        p[first..].copy_from_slice(&heights);
        (study, candidate, p)
    }

    #[test]
    fn derivatives_are_those_of_simulations() {
        let folder = tempfile::tempdir().unwrap();
        let (study, candidate, p) = with_form(folder.path());
        let fits = Fits::new(&study, vec![1e-3, 1e-2]);
        let windows = [0..400, 400..900, 2000..2300];
        let view = View {
            begins: vec![vec![0.1, 0.4], vec![-0.3, 0.0], vec![0.2, -1.0]],
            ..fits.view(&[candidate], &windows.map(|range| Piece { record: 0, range }))
        };
        let free: Vec<Free> =
            study.candidates[candidate].entries.clone().map(|index| study.entries[index].free).collect();
        let locals: Vec<Vec<f64>> =
            (0..3).map(|r| view.locals(r).iter().map(|own| own.0).collect()).collect();
        let starts: Vec<&[f64]> = locals.iter().map(Vec::as_slice).collect();
        for quick in [false, true] {
            let view = View { quick, ..view.clone() };
            assert!((0..3).all(|r| {
                let own = view.derivatives(r, &p, &locals[r], &free).unwrap();
                own.shared.iter().all(Option::is_some) && own.locals.unwrap().len() == 2
            }));
            let of =
                |free: &[Free], locals: bool| columns(&view, &[0, 1, 2], &p, free, &starts, locals, None);
            let fast = of(&free, true);
            // A few derivatives alone are as fast by simulations.
            assert!(view.derivatives(0, &p, &locals[0], &free[..FEW]).is_none());
            let mut slow = of(&[], false);
            for few in free.chunks(FEW) {
                slow.iter_mut().zip(of(few, false)).for_each(|(all, own)| all.columns.extend(own.columns));
            }
            slow.iter_mut().zip(of(&[], true)).for_each(|(all, own)| all.columns.extend(own.columns));
            for (fast, slow) in fast.iter().zip(&slow) {
                assert_eq!((fast.columns.len(), &fast.residuals), (22, &slow.residuals));
                let largest = slow.columns.iter().map(|own| dot(own, own)).fold(0.0, f64::max);
                for (own, simulated) in fast.columns.iter().zip(&slow.columns) {
                    let apart: f64 = own.iter().zip(simulated).map(|(a, b)| (a - b).powi(2)).sum();
                    assert!(apart < 1e-6 * dot(simulated, simulated) + 1e-10 * largest, "{apart} {largest}");
                }
            }
        }
    }
}
