//! The first iterate: X moved inside its bounds, slacks, multipliers, barrier parameter.

use super::iterate::push_inside;
use super::{Iterate, Run};
use crate::optim::error::Error;
use crate::optim::form::{Form, length};
use crate::optim::kkt::Kkt;
use crate::optim::log::Log;
use crate::optim::outcome::Start;
use crate::optim::settings::Settings;

/// Distance from the bounds at a cold and at a warm start, relative to the bound and to the range.
const COLD: f64 = 1e-2;
const WARM: f64 = 1e-7;
/// Largest barrier parameter of a warm start.
const WARM_BARRIER: f64 = 0.1;

impl<'r, 'n, 'm> Run<'r, 'n, 'm> {
    /// A run from a start, evaluated and scaled there.
    pub fn begin(
        form: &'r mut Form<'n>,
        kkt: &'r mut Kkt,
        settings: &'r Settings,
        log: &'r mut Log<'m>,
        start: &Start,
    ) -> Result<Self, Error> {
        length("the start", start.x.len(), form.n)?;
        let warm = start.multipliers.is_some();
        let mut x = start.x.clone();
        x.resize(form.total(), 0.0);
        let push = if warm { WARM } else { COLD };
        push_inside(form, &mut x, push);
        form.scale(&x, settings.scaling_gradient).map_err(Error::Start)?;
        let mut rows = vec![0.0; form.m];
        form.rows_at(&x, &mut rows).map_err(Error::Start)?;
        for (slack, s) in form.slacks.iter().zip(&mut x[form.n..]) {
            *s = rows[slack.row];
        }
        push_inside(form, &mut x, push);
        let at = Iterate { x, y: vec![0.0; form.m], ..Iterate::default() };
        let mut run = Self::new(form, kkt, settings, log, at, settings.initial_barrier);
        run.evaluate().map_err(Error::Start)?;
        match &start.multipliers {
            None => {
                run.at.unit_multipliers(run.form);
                run.estimate_multipliers();
            }
            Some(multipliers) => {
                length("the multipliers of the constraints", multipliers.constraints.len(), run.form.constraints())?;
                length("the multipliers of the lower bounds", multipliers.lower.len(), run.form.n)?;
                length("the multipliers of the upper bounds", multipliers.upper.len(), run.form.n)?;
                run.warm(multipliers, start.barrier);
            }
        }
        Ok(run)
    }

    fn warm(&mut self, multipliers: &crate::optim::outcome::Multipliers, barrier: Option<f64>) {
        let scale = self.form.objective_scale;
        self.at.y = self.form.scaled_multipliers(&multipliers.constraints);
        let scaled = |z: &[f64]| z.iter().map(|z| scale * z.max(0.0)).collect::<Vec<f64>>();
        (self.at.lower, self.at.upper) = (scaled(&multipliers.lower), scaled(&multipliers.upper));
        // A slack s = c(x) is bounded by the constraint's bounds: its multipliers are the parts of y.
        for slack in &self.form.slacks {
            let y = self.at.y[slack.row];
            self.at.lower.push((-y).max(0.0));
            self.at.upper.push(y.max(0.0));
        }
        self.barrier = barrier
            .unwrap_or_else(|| self.at.mean_complementarity(self.form))
            .clamp(self.smallest_barrier(), WARM_BARRIER);
        self.at.bound_multipliers(self.form, self.barrier);
    }
}
