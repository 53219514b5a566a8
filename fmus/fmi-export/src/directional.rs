//! `fmi2GetDirectionalDerivative`: passes of the equations with dual numbers.

use crate::ctypes::Status;
use crate::dual::Dual;
use crate::instance::Instance;
use crate::model::{Model, Outcome};
use crate::table::{Causality, Variable};
use crate::values::Real;

impl<M: Model> Instance<M> {
    /// `unknown = (∂unknown/∂known) seed`, exact to rounding.
    ///
    /// Knowns are Real inputs, states and parameters; unknowns any Real variables. Lengths of `known` and `seed`
    /// and of `unknown` and `out` agree in pairs.
    pub(crate) fn directional_derivative(
        &mut self,
        unknown: &[u32],
        known: &[u32],
        seed: &[f64],
        out: &mut [f64],
    ) -> Status {
        const F: &str = "fmi2GetDirectionalDerivative";
        let table = &self.definition.table;
        let mut parameters = false;
        for (reference, seed) in known.iter().zip(seed) {
            let Some(variable) = table.real_variable(*reference) else {
                return self.unknown_reference(F, "Real", *reference);
            };
            if !is_known(variable) {
                return self.error(F, &format!("`{}` is neither input, state nor parameter", variable.name));
            }
            if !seed.is_finite() {
                return self.discard(F, &format!("the seed {seed} of `{}` is not finite", variable.name));
            }
            parameters |= variable.causality == Causality::Parameter;
        }
        for reference in unknown {
            if table.real_variable(*reference).is_none() {
                return self.unknown_reference(F, "Real", *reference);
            }
        }
        let whole = parameters || self.is_before_start();
        if let Err(refusal) = if whole { self.update() } else { self.approach() } {
            return self.refuse(F, &refusal);
        }
        if let ([known], [1.0]) = (known, seed)
            && !whole
        {
            match self.columns.along(&self.definition.model, &self.state.values, *known) {
                Ok(None) => {}
                Ok(Some(column)) => {
                    unknown.iter().zip(out).for_each(|(unknown, out)| *out = column.of(Real(*unknown)));
                    if self.state.dirty {
                        self.state.values.take_values_of(column.values());
                        self.state.dirty = false;
                    }
                    return Status::OK;
                }
                Err(refusal) => return self.refuse(F, &refusal),
            }
        }
        if let Err(refusal) = self.seeded(known, seed, parameters) {
            return self.refuse(F, &refusal);
        }
        for (reference, out) in unknown.iter().zip(out) {
            [*out] = self.duals[Real(*reference)].eps;
        }
        if self.state.dirty {
            self.state.values.take_values_of(&self.duals);
            self.state.dirty = false;
        }
        Status::OK
    }

    /// Values that the equations need, without their derivatives: a pass with derivatives computes both.
    fn approach(&mut self) -> Outcome {
        if self.state.dirty {
            self.columns.forget();
            self.prepare()?;
        }
        Ok(())
    }

    fn seeded(&mut self, known: &[u32], seed: &[f64], parameters: bool) -> Outcome {
        self.duals.copy_from_f64(&self.state.values);
        for (reference, seed) in known.iter().zip(seed) {
            self.duals[Real(*reference)].eps[0] += seed; // a repeated known adds up
        }
        if parameters {
            self.definition.model.prepare(&mut self.duals)?;
        }
        if self.is_before_start() {
            self.definition.model.initialize(&mut self.duals)?;
        }
        self.definition.model.equations(&mut self.duals)
    }

    /// Seeds along time: states with their derivatives, inputs with their slopes at the end of the last step.
    pub(crate) fn seed_time_direction(&mut self) -> Outcome {
        self.duals.copy_from_f64(&self.state.values);
        self.duals.time = Dual::new(self.state.values.time, 1.0);
        let table = &self.definition.table;
        for (state, derivative) in table.states().iter().zip(table.derivatives()) {
            self.duals[*state].eps = [self.state.values[*derivative]];
        }
        for (input, slope) in self.inputs.iter().zip(&self.state.end_rates) {
            self.duals[*input].eps = [*slope];
        }
        self.definition.model.equations(&mut self.duals)
    }
}

fn is_known(variable: &Variable) -> bool {
    matches!(variable.causality, Causality::Input | Causality::Parameter) || variable.is_state
}
