//! Friction sweeps: a part is moved at an imposed velocity, the load cell reads what that takes.

use std::path::Path;

use super::{Error, Recording, open, output, run};
use airloop_cosim::master::Algorithm;
use airloop_ident::excite::{self, Band, Signal, chirp::Sweep, times};
use airloop_series::TimeSeries;

/// Settings of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Amplitudes of the velocity \[m/s\]; the last is for validation.
    pub amplitudes: Vec<f64>,
    /// Band of the velocity \[Hz\]: a chirp.
    pub band: Band,
    /// Length of each record \[s\].
    pub duration: f64,
    /// Sample time \[s\].
    pub sample_time: f64,
    /// Stroke \[m\].
    pub stroke: f64,
}

impl Default for Plan {
    fn default() -> Plan {
        Plan {
            amplitudes: vec![0.3, 0.12, 0.2],
            band: 0.4..1.5,
            duration: 20.0,
            sample_time: 1e-3,
            stroke: 0.3,
        }
    }
}

/// A part that is moved.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// `piston` or `cart`.
    pub name: &'static str,
    /// `sweep_piston` or `sweep_cart`.
    pub experiment: &'static str,
    /// Start values of its friction FMU.
    pub set: Vec<(String, String)>,
    /// Mass that the load cell accelerates \[kg\].
    pub mass: f64,
}

/// Records `x`, `v` and `F_p = mass a + f(v)` of a friction FMU (input `v`, output `f`).
///
/// # Errors
/// A velocity out of range, a motion beyond the stroke, an FMU without these signals, a run that fails.
pub fn record(friction: &Path, part: &Part, plan: &Plan) -> Result<Vec<Recording>, Error> {
    let graph = open(friction, Algorithm::Monolithic, &part.set)?;
    let mut recordings = Vec::new();
    for (index, &amplitude) in plan.amplitudes.iter().enumerate() {
        let settings = excite::Settings {
            amplitude,
            duration: plan.duration,
            sample_time: plan.sample_time,
            ..excite::Settings::default()
        };
        let signal = Signal::Chirp { band: plan.band.clone(), sweep: Sweep::Logarithmic };
        let v = signal.samples(&settings)?;
        let x = positions(&v, plan.sample_time);
        let travel = 2.0 * x.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        if travel > plan.stroke {
            let (from, stroke) = (plan.band.start.min(plan.band.end), plan.stroke);
            return Err(Error::Stroke { amplitude, from, travel, stroke });
        }
        let a = accelerations(&v, plan.sample_time);
        let mut inputs = TimeSeries::new(times(v.len(), plan.sample_time))?;
        inputs.push("v", Some("m/s".into()), v)?;
        let result = run(&graph, Algorithm::Monolithic, &inputs)?;
        let friction_force = output(&result, "f", friction)?;
        let force = friction_force.iter().zip(&a).map(|(f, a)| f + part.mass * a).collect();
        let mut signals = TimeSeries::new(inputs.time().to_vec())?;
        signals.push("x", Some("m".into()), x)?;
        signals.push("v", Some("m/s".into()), inputs.channels()[0].values.clone())?;
        signals.push("F_p", Some("N".into()), force)?;
        let group = format!("{}_{}", part.name, index + 1);
        let estimation = index + 1 < plan.amplitudes.len();
        let name = format!("{group}.csv");
        recordings.push(Recording { name, estimation, experiment: part.experiment, group, signals });
    }
    Ok(recordings)
}

/// Positions about the middle of the motion \[m\], by Simpson's rule on the cubic through neighboring samples.
fn positions(v: &[f64], dt: f64) -> Vec<f64> {
    let n = v.len();
    let mut x = vec![0.0; n];
    for k in 1..n {
        let (before, after) = (v[k.saturating_sub(2)], v[(k + 1).min(n - 1)]);
        x[k] = x[k - 1] + dt * (13.0 * (v[k - 1] + v[k]) - before - after) / 24.0;
    }
    let (low, high) = x.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (x.min(l), x.max(h)));
    x.iter().map(|x| x - 0.5 * (low + high)).collect()
}

/// Accelerations \[m/s2\] by differences of fourth order, of second at the ends.
fn accelerations(v: &[f64], dt: f64) -> Vec<f64> {
    let n = v.len();
    (0..n)
        .map(|k| match k {
            _ if n < 3 => 0.0,
            0 => (-3.0 * v[0] + 4.0 * v[1] - v[2]) / (2.0 * dt),
            _ if k == n - 1 => (3.0 * v[k] - 4.0 * v[k - 1] + v[k - 2]) / (2.0 * dt),
            _ if k == 1 || k == n - 2 => (v[k + 1] - v[k - 1]) / (2.0 * dt),
            _ => (8.0 * (v[k + 1] - v[k - 1]) - v[k + 2] + v[k - 2]) / (12.0 * dt),
        })
        .collect()
}
