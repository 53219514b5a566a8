//! Between trajectories and the variables of a program: guesses, warm starts, solutions.

use super::error::Error;
use super::part::Part;
use super::problem::Duration;
use super::program::Program;
use super::trajectory::{Interpolation, PhaseTrajectory, Trajectory};
use airloop_optim::{EvaluationError, Multipliers, Nlp, Start};

impl Program<'_> {
    /// Variables that follow a trajectory, whatever its knots; `[n]`. Where a duration is fixed, the phase of the
    /// trajectory is stretched to it. Durations beyond their bounds are moved into them.
    ///
    /// # Errors
    /// [`Error::Trajectory`] when phases or numbers of states and inputs differ.
    pub fn vector(&self, trajectory: &Trajectory) -> Result<Vec<f64>, Error> {
        if trajectory.phases.len() != self.parts.len() {
            let (found, needed) = (trajectory.phases.len(), self.parts.len());
            return Err(Error::Trajectory(format!("it has {found} phases, the problem {needed}")));
        }
        let mut x = vec![0.0; self.variables];
        for (part, phase) in self.parts.iter().zip(&trajectory.phases) {
            fill(part, phase, &mut x)?;
        }
        Ok(x)
    }

    /// The trajectory that variables `x` `[n]` mean; with the multipliers of a solution its costates.
    ///
    /// # Errors
    /// Fails where the dynamics have no value at a knot.
    pub fn trajectory(
        &mut self,
        x: &[f64],
        multipliers: Option<&Multipliers>,
    ) -> Result<Trajectory, EvaluationError> {
        let objective = self.objective(x)?;
        let begins = self.phase_times(x);
        let mut phases = Vec::with_capacity(self.parts.len());
        for (p, part) in self.parts.iter().enumerate() {
            let worker = &mut self.workers[p][0];
            let costates = multipliers.map(|m| &m.constraints[..]);
            phases.push(read(part, worker.dynamics.as_mut(), x, begins[p], costates)?);
        }
        Ok(Trajectory { phases, objective })
    }

    /// A start along a trajectory, with the multipliers of the defects from its costates where they are known. Of
    /// another solution [`Program::warm_start`] takes over all multipliers.
    ///
    /// # Errors
    /// See [`Program::vector`].
    pub fn start(&self, trajectory: &Trajectory) -> Result<Start, Error> {
        let x = self.vector(trajectory)?;
        let mut multipliers = vec![0.0; self.constraints()];
        for (part, phase) in self.parts.iter().zip(&trajectory.phases) {
            let states = part.layout.states;
            for (k, &first) in part.interval_constraints.iter().enumerate() {
                let s = 0.5 * (part.fractions[k] + part.fractions[k + 1]);
                let Some(costates) = phase.costates_at(along(phase, s)) else { return Ok(Start::cold(x)) };
                multipliers[first..first + states].copy_from_slice(&costates);
            }
        }
        // Those of the bounds as the barrier has them at x.
        let barrier = super::solve::WARM_BARRIER;
        let of = |gap: f64| if gap.is_finite() { barrier / gap.max(barrier) } else { 0.0 };
        let bounds = &self.bounds.bounds;
        let lower = x.iter().zip(&bounds.lower).map(|(x, bound)| of(x - bound)).collect();
        let upper = x.iter().zip(&bounds.upper).map(|(x, bound)| of(bound - x)).collect();
        let multipliers = Multipliers { constraints: multipliers, lower, upper };
        Ok(Start { x, multipliers: Some(multipliers), barrier: Some(barrier) })
    }

    /// Typical magnitudes of the variables, `[n]`: nominal values of the dynamics, 1 for durations.
    pub fn scales(&self) -> Vec<f64> {
        let mut scales = vec![1.0; self.variables];
        for part in &self.parts {
            let layout = &part.layout;
            for a in layout.free..layout.node_width() {
                let nominal = part.nominals[a - layout.free].abs();
                let scale = if nominal > 0.0 && nominal.is_finite() { nominal } else { 1.0 };
                (0..=layout.intervals).for_each(|k| scales[layout.point(k, a)] = scale);
                for variable in (0..layout.intervals).filter_map(|k| layout.midpoint(k, a)) {
                    scales[variable] = scale;
                }
            }
        }
        scales
    }
}

/// Time at a fraction of a phase.
fn along(phase: &PhaseTrajectory, fraction: f64) -> f64 {
    phase.begin() + fraction * (phase.end() - phase.begin())
}

fn fill(part: &Part, phase: &PhaseTrajectory, x: &mut [f64]) -> Result<(), Error> {
    let layout = &part.layout;
    let (free, states) = (layout.free, layout.states);
    let sizes = (phase.states[0].len(), phase.inputs[0].len());
    if sizes != (states, layout.inputs) {
        return Err(Error::Trajectory(format!(
            "phase `{}` has {} states and {} inputs, its dynamics {states} and {}",
            part.name, sizes.0, sizes.1, layout.inputs
        )));
    }
    let duration = match part.duration {
        Duration::Free { lower, upper } => (phase.end() - phase.begin()).clamp(lower, upper),
        Duration::Fixed(duration) => duration,
    };
    let n = layout.intervals;
    for k in 0..=n {
        let s = part.fractions[k];
        if free == 1 {
            x[layout.point(k, 0)] = duration;
        }
        let at = along(phase, s);
        let node = layout.point(k, free);
        x[node..node + states].copy_from_slice(&phase.states_at(at));
        let middle = part.fractions.get(k + 1).map(|next| along(phase, 0.5 * (s + next)));
        if layout.held {
            let Some(middle) = middle else { continue };
            x[node + states..node + states + layout.inputs].copy_from_slice(&phase.inputs_at(middle));
            continue;
        }
        x[node + states..node + states + layout.inputs].copy_from_slice(&phase.inputs_at(at));
        let Some(middle) = middle.filter(|_| layout.middle > 0) else { continue };
        let place = layout.point(k, 0) + layout.node_width();
        let inputs = place + layout.middle - layout.inputs;
        x[inputs..inputs + layout.inputs].copy_from_slice(&phase.inputs_at(middle));
        if layout.middle > layout.inputs {
            x[place..place + states].copy_from_slice(&phase.states_at(middle));
        }
    }
    Ok(())
}

fn read(
    part: &Part,
    dynamics: &mut dyn super::Dynamics,
    x: &[f64],
    begin: f64,
    multipliers: Option<&[f64]>,
) -> Result<PhaseTrajectory, EvaluationError> {
    let layout = &part.layout;
    let (n, free, nx, nu) = (layout.intervals, layout.free, layout.states, layout.inputs);
    let duration = part.duration_at(x);
    let of = |k: usize, from: usize, count: usize| -> Vec<f64> {
        (0..count).map(|a| x[layout.point(k, free + from + a)]).collect()
    };
    let times: Vec<f64> = part.fractions.iter().map(|s| begin + s * duration).collect();
    let states: Vec<Vec<f64>> = (0..=n).map(|k| of(k, 0, nx)).collect();
    let inputs: Vec<Vec<f64>> = (0..=n).map(|k| of(k, nx, nu)).collect();
    let interpolation = match (layout.held, layout.middle) {
        (true, _) => Interpolation::Held,
        (false, 0) => Interpolation::Linear,
        _ => Interpolation::Quadratic,
    };
    let middle = |k: usize| {
        let end = layout.point(k, 0) + layout.stride();
        x[end - nu..end].to_vec()
    };
    let middle_inputs = match interpolation {
        Interpolation::Quadratic => (0..n).map(middle).collect(),
        _ => Vec::new(),
    };
    let mut values = vec![0.0; dynamics.size().values()];
    let mut at = |k: usize, inputs: &[f64]| {
        let point = super::Point { time: times[k], states: &states[k], inputs };
        dynamics.evaluate(point, &mut values).map(|()| (values[..nx].to_vec(), values[nx..].to_vec()))
    };
    let (mut rates, mut outputs): (Vec<[Vec<f64>; 2]>, Vec<Vec<f64>>) = (Vec::new(), Vec::new());
    for k in 0..=n {
        let (rate, output) = at(k, &inputs[k])?;
        if k > 0 {
            // Before a jump of held inputs the rate is another one.
            rates[k - 1][1] = if layout.held { at(k, &inputs[k - 1])?.0 } else { rate.clone() };
        }
        if k < n {
            rates.push([rate, Vec::new()]);
        }
        outputs.push(output);
    }
    let costates = multipliers.map_or_else(Vec::new, |m| {
        part.interval_constraints.iter().map(|&first| m[first..first + nx].to_vec()).collect()
    });
    Ok(PhaseTrajectory {
        name: part.name.clone(),
        times,
        states,
        inputs,
        middle_inputs,
        interpolation,
        rates,
        outputs,
        costates,
    })
}
