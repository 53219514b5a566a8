//! The first iterate: X moved inside its bounds, slacks, multipliers, barrier parameter.

use super::iterate::push_inside;
use super::{Memory, Run};
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
        mut memory: Memory,
    ) -> Result<Self, Error> {
        length("the start", start.x.len(), form.n)?;
        let warm = start.multipliers.is_some();
        let push = if warm { WARM_DISTANCE_FROM_BOUNDS } else { COLD_DISTANCE_FROM_BOUNDS };
        let Memory { at, point, .. } = &mut memory;
        at.x.clear();
        at.x.extend_from_slice(&start.x);
        at.x.resize(form.total(), 0.0);
        push_inside(form, &mut at.x, push);
        form.scale(&at.x, settings.scaling_gradient).map_err(Error::Start)?;
        point.resize(form);
        form.rows_at(&at.x, &mut point.rows).map_err(Error::Start)?;
        for (slack, s) in form.slacks.iter().zip(&mut at.x[form.n..]) {
            *s = point.rows[slack.row];
        }
        push_inside(form, &mut at.x, push);
        at.y.clear();
        at.y.resize(form.m, 0.0);
        at.lower.clear();
        at.upper.clear();
        let mut run = Self::new(form, kkt, settings, log, memory, settings.initial_barrier);
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
