//! The integrator between communication points on the parts of one instance, with location of state events.

use crate::definition::Definition;
use crate::input_ramp::set_inputs;
use crate::instance::Instance;
use crate::integrator::{Workspace, dopri5, rk4};
use crate::model::{Model, Outcome, Refusal};
use crate::values::{Real, Values};

/// Solver method number of Dormand-Prince in the enumeration `SolverMethod`.
const DOPRI5: i32 = 2;

/// End of an inner step.
pub(crate) enum Side {
    Start,
    End,
}

/// The inner integrator on borrowed parts of an instance.
pub(crate) struct InnerSolver<'a, M: Model> {
    definition: &'static Definition<M>,
    values: &'a mut Values<f64>,
    proposed: &'a mut f64,
    inputs: &'a [Real],
    rates: &'a [f64],
    work: &'a mut Workspace,
    ramped: bool,
    start: f64,
    dopri: bool,
    max_step: f64,
    tolerance: f64,
}

/// A borrowed right-hand side: states in, derivatives out.
macro_rules! right_hand_side {
    ($self:ident) => {{
        let (definition, inputs, rates) = ($self.definition, $self.inputs, $self.rates);
        let (ramped, start) = ($self.ramped, $self.start);
        let values = &mut *$self.values;
        let base: &[f64] = &$self.work.inputs;
        move |t: f64, x: &[f64], dx: &mut [f64]| -> Outcome {
            values.time = t;
            if ramped {
                set_inputs(values, inputs, base, rates, inputs.len(), t - start);
            }
            for (x, state) in x.iter().zip(definition.table.states()) {
                values[*state] = *x;
            }
            definition.model.equations(values)?;
            for (dx, derivative) in dx.iter_mut().zip(definition.table.derivatives()) {
                *dx = values[*derivative];
            }
            Ok(())
        }
    }};
}

impl<'a, M: Model> InnerSolver<'a, M> {
    pub fn of(instance: &'a mut Instance<M>, ramped: bool, start: f64) -> Self {
        let state = &mut instance.state;
        let (dopri, max_step, tolerance) = match instance.definition.table.solver {
            Some(p) => (
                state.values[p.method] == DOPRI5,
                state.values[p.max_step],
                state.tolerance.unwrap_or(state.values[p.tolerance]),
            ),
            None => (false, f64::INFINITY, 1e-8),
        };
        Self {
            definition: instance.definition,
            values: &mut state.values,
            proposed: &mut state.proposed_step,
            inputs: &instance.inputs,
            rates: &state.input_rates,
            work: &mut instance.work,
            ramped,
            start,
            dopri,
            max_step,
            tolerance,
        }
    }

    /// One inner step from `(t, x0)` toward `target`; gives its length, the state goes to `x1`.
    pub fn step(&mut self, t: f64, target: f64) -> Result<f64, Refusal> {
        let left = target - t;
        if !self.dopri {
            // Equal steps of at most max_step; the small subtraction forgives rounding of the quotient.
            let n = (left / self.max_step - 1e-9).ceil().max(1.0);
            let h = left / n;
            self.single(t, h)?;
            return Ok(h);
        }
        let mut h = if *self.proposed > 0.0 { *self.proposed } else { self.max_step / 10.0 };
        loop {
            h = h.min(self.max_step);
            let clipped = h >= left;
            let used = if clipped { left } else { h };
            let error = self.single(t, used)?;
            let factor = if error > 0.0 { (0.9 * error.powf(-0.2)).clamp(0.2, 5.0) } else { 5.0 };
            if error <= 1.0 {
                if !clipped || factor < 1.0 {
                    *self.proposed = used * factor;
                }
                return Ok(used);
            }
            h = used * if error.is_finite() { factor.min(0.9) } else { 0.2 };
            if t + h <= t {
                return Err(Refusal::Discard(format!(
                    "the inner step size fell to {h:e} s at t = {t} s; try a larger tolerance or smaller inputs"
                )));
            }
        }
    }

    /// One step of exactly `h` with the chosen method; gives its error estimate (0 for RK4).
    fn single(&mut self, t: f64, h: f64) -> Result<f64, Refusal> {
        let (dopri, tolerance) = (self.dopri, self.tolerance);
        let mut k = std::mem::take(&mut self.work.k);
        let mut stage = std::mem::take(&mut self.work.stage);
        let x0 = std::mem::take(&mut self.work.x0);
        let mut x1 = std::mem::take(&mut self.work.x1);
        let result = {
            let f = right_hand_side!(self);
            if dopri {
                dopri5(f, t, h, tolerance, &x0, &mut x1, &mut k, &mut stage)
            } else {
                rk4(f, t, h, &x0, &mut x1, &mut k, &mut stage).map(|()| 0.0)
            }
        };
        self.work.k = k;
        self.work.stage = stage;
        self.work.x0 = x0;
        self.work.x1 = x1;
        result
    }

    pub fn check_finite(&self, t: f64) -> Outcome {
        match self.work.x1.iter().position(|x| !x.is_finite()) {
            None => Ok(()),
            Some(i) => {
                let table = &self.definition.table;
                let name = &table.variables()[table.index_of(table.states()[i])].name;
                Err(Refusal::Discard(format!(
                    "the state `{name}` became {} at t = {t} s; try a smaller step",
                    self.work.x1[i]
                )))
            }
        }
    }

    /// Event indicators of the state at the start or end of the inner step.
    pub fn indicators(&mut self, t: f64, side: Side) -> Outcome {
        self.values.time = t;
        if self.ramped {
            let n = self.inputs.len();
            set_inputs(self.values, self.inputs, &self.work.inputs, self.rates, n, t - self.start);
        }
        let (x, z) = match side {
            Side::Start => (&self.work.x0, &mut self.work.z0),
            Side::End => (&self.work.x1, &mut self.work.z1),
        };
        for (x, state) in x.iter().zip(self.definition.table.states()) {
            self.values[*state] = *x;
        }
        self.definition.model.equations(self.values)?;
        self.definition.model.event_indicators(self.values, z);
        Ok(())
    }

    /// An indicator changed between the domains z > 0 and z <= 0 (FMI 2.0, section 3.1.1).
    pub fn crossed(&self) -> bool {
        self.work.z0.iter().zip(&self.work.z1).any(|(a, b)| (*a > 0.0) != (*b > 0.0))
    }

    /// Time of the first crossing in `(t0, t1]`; leaves the state just behind it in `x1`.
    pub fn locate(&mut self, t0: f64, t1: f64) -> Result<f64, Refusal> {
        let (mut before, mut behind) = (t0, t1);
        let width = |t: f64| 4.0 * f64::EPSILON * t.abs().max(t1 - t0);
        while behind - before > width(behind) {
            let middle = before + (behind - before) / 2.0;
            if middle <= before || middle >= behind {
                break;
            }
            self.single(t0, middle - t0)?;
            self.indicators(middle, Side::End)?;
            if self.crossed() {
                behind = middle;
            } else {
                before = middle;
            }
        }
        self.single(t0, behind - t0)?;
        self.indicators(behind, Side::End)?;
        Ok(behind)
    }

    /// The end of the inner step becomes the start of the next and the present state of the instance.
    pub fn accept(&mut self, t: f64) {
        std::mem::swap(&mut self.work.x0, &mut self.work.x1);
        std::mem::swap(&mut self.work.z0, &mut self.work.z1);
        self.values.time = t;
        if self.ramped {
            let n = self.inputs.len();
            set_inputs(self.values, self.inputs, &self.work.inputs, self.rates, n, t - self.start);
        }
        for (x, state) in self.work.x0.iter().zip(self.definition.table.states()) {
            self.values[*state] = *x;
        }
    }
}
