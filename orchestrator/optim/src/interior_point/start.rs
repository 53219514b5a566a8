//! The first iterate: X moved inside its bounds, slacks, multipliers, barrier parameter.

use super::iterate::push_inside;
use super::{Iterate, Run};
use crate::error::Error;
use crate::form::{Form, length};
use crate::kkt::Kkt;
use crate::log::Log;
use crate::outcome::Start;
use crate::settings::Settings;

/// Distance from the bounds at a cold and at a warm start, relative to the bound and to the range.
const COLD_DISTANCE_FROM_BOUNDS: f64 = 1e-2;
const WARM_DISTANCE_FROM_BOUNDS: f64 = 1e-7;
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
        let push = if warm { WARM_DISTANCE_FROM_BOUNDS } else { COLD_DISTANCE_FROM_BOUNDS };
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
                run.at.take_multipliers(run.form, multipliers)?;
                let mean = run.at.mean_complementarity(run.form);
                run.barrier = start.barrier.unwrap_or(mean).clamp(run.smallest_barrier(), WARM_BARRIER);
                run.at.bound_multipliers(run.form, run.barrier);
            }
        }
        Ok(run)
    }
}
