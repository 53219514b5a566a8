//! Trajectories: what a program means at its variables, evaluated at any time.

use super::error::Error;

/// Interpolation of an input between the knots.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Interpolation {
    /// Held from each knot to the next.
    Held,
    /// On straight lines.
    Linear,
    /// On parabolas through the value in the middle.
    Quadratic,
}

/// Trajectory of a phase. N intervals between N + 1 knots.
#[derive(Debug, Clone, PartialEq)]
pub struct PhaseTrajectory {
    /// Name of the phase.
    pub name: String,
    /// Times of the knots, s, increasing, `[N + 1]`.
    pub times: Vec<f64>,
    /// States, `[N + 1][n_x]`.
    pub states: Vec<Vec<f64>>,
    /// Inputs at the knots, `[N + 1][n_u]`; held ones repeat the last.
    pub inputs: Vec<Vec<f64>>,
    /// Inputs in the middle of the intervals, `[N][n_u]`, where the interpolation is quadratic; else empty.
    pub middle_inputs: Vec<Vec<f64>>,
    /// Interpolation of the inputs between the knots.
    pub interpolation: Interpolation,
    /// Rates of the states at the beginning and at the end of every interval, `[N][2][n_x]`; empty where they are not
    /// known: states then run on straight lines, else on Hermite's cubics.
    pub rates: Vec<[Vec<f64>; 2]>,
    /// Outputs at the knots, `[N + 1][n_g]`; empty where they are not known.
    pub outputs: Vec<Vec<f64>>,
    /// Multipliers of the defects, `[N][n_x]`: costates, the change of the objective by a disturbance of the states,
    /// with the sign of `L = f + y . c`; empty where they are not known.
    pub costates: Vec<Vec<f64>>,
}

impl PhaseTrajectory {
    /// From values at knots, as a guess: states on straight lines. `times` \[s\] `[N + 1]`, `states` `[N + 1][n_x]`,
    /// `inputs` `[N + 1][n_u]`.
    ///
    /// # Errors
    /// [`Error::Trajectory`] when lengths differ, times do not increase or a value is not finite.
    pub fn from_knots(
        name: &str,
        times: Vec<f64>,
        states: Vec<Vec<f64>>,
        inputs: Vec<Vec<f64>>,
        interpolation: Interpolation,
    ) -> Result<PhaseTrajectory, Error> {
        let wrong = |reason: String| Err(Error::Trajectory(format!("phase `{name}`: {reason}")));
        let count = times.len();
        if count < 2 || states.len() != count || inputs.len() != count {
            return wrong(format!(
                "{count} times, {} states and {} inputs; give the same number of each, at least 2",
                states.len(),
                inputs.len()
            ));
        }
        if let Some(k) = (1..count).find(|&k| times[k].is_nan() || times[k] <= times[k - 1]) {
            return wrong(format!("time {} s of knot {k} is not after {} s", times[k], times[k - 1]));
        }
        for (what, rows) in [("states", &states), ("inputs", &inputs)] {
            for (k, row) in rows.iter().enumerate() {
                if row.len() != rows[0].len() {
                    return wrong(format!("knot {k} has {} {what}, the first {}", row.len(), rows[0].len()));
                }
                if let Some(i) = row.iter().position(|value| !value.is_finite()) {
                    return wrong(format!("number {i} of the {what} of knot {k} is {}", row[i]));
                }
            }
        }
        let middle_inputs = match interpolation {
            Interpolation::Quadratic => {
                inputs.windows(2).map(|pair| between(&pair[0], &pair[1], 0.5)).collect()
            }
            _ => Vec::new(),
        };
        Ok(PhaseTrajectory {
            name: name.to_owned(),
            times,
            states,
            inputs,
            middle_inputs,
            interpolation,
            rates: Vec::new(),
            outputs: Vec::new(),
            costates: Vec::new(),
        })
    }

    /// Number of intervals N.
    pub fn intervals(&self) -> usize {
        self.times.len() - 1
    }

    /// Time at which the phase begins \[s\].
    pub fn begin(&self) -> f64 {
        self.times[0]
    }

    /// Time at which the phase ends \[s\].
    pub fn end(&self) -> f64 {
        self.times[self.intervals()]
    }

    /// Interval that contains `time` \[s\], the later one at a knot, and the part 0..1 of it that has passed; clamped
    /// to the ends.
    pub fn locate(&self, time: f64) -> (usize, f64) {
        let k = self.times.partition_point(|&t| t <= time).clamp(1, self.intervals()) - 1;
        let (a, b) = (self.times[k], self.times[k + 1]);
        (k, ((time - a) / (b - a)).clamp(0.0, 1.0))
    }

    /// States at a time, `[n_x]`.
    pub fn states_at(&self, time: f64) -> Vec<f64> {
        let (k, s) = self.locate(time);
        self.states_in(k, s)
    }

    /// States `[n_x]` in interval `k` after the part `s` (0..1) of it.
    pub fn states_in(&self, k: usize, s: f64) -> Vec<f64> {
        let (a, b) = (&self.states[k], &self.states[k + 1]);
        let Some([fa, fb]) = self.rates.get(k) else { return between(a, b, s) };
        let h = self.times[k + 1] - self.times[k];
        let (p, q) = (s * s * (3.0 - 2.0 * s), s * (1.0 - s));
        (0..a.len()).map(|i| a[i] + p * (b[i] - a[i]) + h * q * ((1.0 - s) * fa[i] - s * fb[i])).collect()
    }

    /// Rates of the interpolant of the states in interval `k` after the part `s` of it, `[n_x]`.
    pub fn slopes_in(&self, k: usize, s: f64) -> Vec<f64> {
        let (a, b) = (&self.states[k], &self.states[k + 1]);
        let h = self.times[k + 1] - self.times[k];
        let Some([fa, fb]) = self.rates.get(k) else {
            return a.iter().zip(b).map(|(a, b)| (b - a) / h).collect();
        };
        let (p, q, r) = (6.0 * s * (1.0 - s), (1.0 - s) * (1.0 - 3.0 * s), s * (3.0 * s - 2.0));
        (0..a.len()).map(|i| p * (b[i] - a[i]) / h + q * fa[i] + r * fb[i]).collect()
    }

    /// Inputs at a time, `[n_u]`.
    pub fn inputs_at(&self, time: f64) -> Vec<f64> {
        let (k, s) = self.locate(time);
        self.inputs_in(k, s)
    }

    /// Inputs `[n_u]` in interval `k` after the part `s` (0..1) of it.
    pub fn inputs_in(&self, k: usize, s: f64) -> Vec<f64> {
        let (a, b) = (&self.inputs[k], &self.inputs[k + 1]);
        match (self.interpolation, self.middle_inputs.get(k)) {
            (Interpolation::Held, _) => a.clone(),
            (Interpolation::Quadratic, Some(m)) => {
                let (wa, wm, wb) = ((1.0 - s) * (1.0 - 2.0 * s), 4.0 * s * (1.0 - s), s * (2.0 * s - 1.0));
                (0..a.len()).map(|i| wa * a[i] + wm * m[i] + wb * b[i]).collect()
            }
            _ => between(a, b, s),
        }
    }

    /// Costates at a time, `[n_x]`, on straight lines between the middles of the intervals; none where they are not
    /// known.
    pub fn costates_at(&self, time: f64) -> Option<Vec<f64>> {
        let first = self.costates.first()?;
        let middle = |k: usize| 0.5 * (self.times[k] + self.times[k + 1]);
        let n = self.costates.len();
        let after = (0..n).collect::<Vec<_>>().partition_point(|&k| middle(k) <= time);
        Some(match after {
            0 => first.clone(),
            after if after == n => self.costates[n - 1].clone(),
            after => {
                let s = (time - middle(after - 1)) / (middle(after) - middle(after - 1));
                between(&self.costates[after - 1], &self.costates[after], s)
            }
        })
    }
}

/// On the straight line from `a` to `b`.
fn between(a: &[f64], b: &[f64], s: f64) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + s * (b - a)).collect()
}

/// Trajectory of a problem: phases one after another.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    /// Phases; each begins where the one before ends.
    pub phases: Vec<PhaseTrajectory>,
    /// Objective; NaN for a guess.
    pub objective: f64,
}

impl Trajectory {
    /// A guess of phases.
    pub fn guess(phases: Vec<PhaseTrajectory>) -> Trajectory {
        Trajectory { phases, objective: f64::NAN }
    }

    /// The phase at `time` \[s\], the later one where two meet.
    ///
    /// # Panics
    /// Without phases.
    pub fn phase_at(&self, time: f64) -> &PhaseTrajectory {
        let after = self.phases.partition_point(|phase| phase.begin() <= time);
        &self.phases[after.saturating_sub(1)]
    }

    /// States `[n_x]` at `time` \[s\].
    pub fn states_at(&self, time: f64) -> Vec<f64> {
        self.phase_at(time).states_at(time)
    }

    /// Inputs `[n_u]` at `time` \[s\].
    pub fn inputs_at(&self, time: f64) -> Vec<f64> {
        self.phase_at(time).inputs_at(time)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// x = t^3 - t with its rates on knots 0, 0.5, 2; u = t^2.
    fn cubic() -> PhaseTrajectory {
        let times = vec![0.0, 0.5, 2.0];
        let x = |t: f64| t * t * t - t;
        let rate = |t: f64| vec![3.0 * t * t - 1.0];
        let states = times.iter().map(|&t| vec![x(t)]).collect();
        let inputs = times.iter().map(|&t| vec![t * t]).collect();
        let mut phase =
            PhaseTrajectory::from_knots("p", times, states, inputs, Interpolation::Quadratic).unwrap();
        phase.rates = vec![[rate(0.0), rate(0.5)], [rate(0.5), rate(2.0)]];
        phase.middle_inputs = vec![vec![0.0625], vec![1.5625]];
        phase
    }

    #[test]
    fn cubics_and_parabolas_are_met_between_the_knots() {
        let phase = cubic();
        for t in [0.0, 0.1, 0.5, 0.7, 1.9, 2.0f64] {
            assert!((phase.states_at(t)[0] - (t * t * t - t)).abs() < 1e-14);
            assert!((phase.inputs_at(t)[0] - t * t).abs() < 1e-14);
            let (k, s) = phase.locate(t);
            assert!((phase.slopes_in(k, s)[0] - (3.0 * t * t - 1.0)).abs() < 1e-13);
        }
    }

    #[test]
    fn beyond_its_ends_a_phase_keeps_its_values() {
        let phase = cubic();
        assert_eq!(phase.states_at(-1.0), phase.states_at(0.0));
        assert_eq!(phase.inputs_at(9.0), phase.inputs_at(2.0));
    }

    #[test]
    fn a_guess_of_the_wrong_length_is_refused() {
        let knots = |times, states| {
            PhaseTrajectory::from_knots("p", times, states, vec![vec![]; 2], Interpolation::Linear)
        };
        assert!(knots(vec![0.0, 1.0], vec![vec![0.0]]).is_err());
        assert!(knots(vec![1.0, 1.0], vec![vec![0.0]; 2]).is_err());
        let error = knots(vec![0.0, 1.0], vec![vec![0.0], vec![f64::NAN]]).unwrap_err().to_string();
        assert!(error.contains("phase `p`") && error.contains("knot 1"), "{error}");
    }
}
