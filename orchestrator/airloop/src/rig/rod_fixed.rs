//! The actuator with its rod held in the middle: chirps and random stairs (paper section IV.A).

use std::path::Path;

use super::{Error, Recording, has_variable, open, output, run, sensor};
use airloop_cosim::master::Algorithm;
use airloop_ident::excite::{self, Band, Signal, chirp::Sweep, times};
use airloop_series::TimeSeries;

/// Settings of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Amplitudes of the chirps for estimation \[N\].
    pub chirps: Vec<f64>,
    /// Amplitude of the stairs \[N\].
    pub stairs: f64,
    /// Band of the chirps \[Hz\].
    pub band: Band,
    /// Time at a level of the stairs, shortest and longest \[s\].
    pub hold: std::ops::Range<f64>,
    /// Length of each record \[s\].
    pub duration: f64,
    /// Sample time \[s\].
    pub sample_time: f64,
    /// Seed of the stairs.
    pub seed: u64,
}

impl Default for Plan {
    fn default() -> Plan {
        Plan {
            chirps: vec![10.0, 20.0, 40.0],
            stairs: 40.0,
            band: 0.1..12.0,
            hold: 0.2..1.0,
            duration: 20.0,
            sample_time: 1e-3,
            seed: 1,
        }
    }
}

/// Records `u`, `F_hat` and `F_p` (the load cell reads the force of the actuator) of an actuator FMU with input `u` and
/// outputs `F_hat`, `F_act`; a Boolean `rod_fixed` of the FMU is set. For validation there are a chirp that runs
/// backwards at three quarters of the largest amplitude, and other stairs.
///
/// # Errors
/// A command out of range, an FMU without these signals, a run that fails.
pub fn record(actuator: &Path, plan: &Plan, set: &[(String, String)]) -> Result<Vec<Recording>, Error> {
    let mut graph = open(actuator, Algorithm::GaussSeidel, set)?;
    if has_variable(&graph, "rod_fixed") && !set.iter().any(|(name, _)| name == "rod_fixed") {
        graph.set_start("rod_fixed", "true", "rod fixed")?;
    }
    let chirp = |band: Band| Signal::Chirp { band, sweep: Sweep::Linear };
    let stairs = || Signal::Stairs { hold: plan.hold.clone() };
    let mut wanted: Vec<(String, Signal, f64, u64, bool)> = Vec::new();
    for &amplitude in &plan.chirps {
        wanted.push((format!("chirp_{amplitude}"), chirp(plan.band.clone()), amplitude, 0, true));
    }
    wanted.push(("stairs".into(), stairs(), plan.stairs, plan.seed, true));
    let largest = plan.chirps.iter().copied().fold(0.0, f64::max);
    let backwards = plan.band.end..plan.band.start;
    if largest > 0.0 {
        wanted.push(("chirp_validation".into(), chirp(backwards), 0.75 * largest, 0, false));
    }
    wanted.push(("stairs_validation".into(), stairs(), plan.stairs, plan.seed.wrapping_add(1), false));
    let mut recordings = Vec::new();
    for (name, signal, amplitude, seed, estimation) in wanted {
        let settings = excite::Settings {
            amplitude,
            duration: plan.duration,
            sample_time: plan.sample_time,
            seed,
            ..excite::Settings::default()
        };
        // The command is sent as it is written.
        let step = sensor::usual("u").step;
        let u: Vec<f64> = signal.samples(&settings)?.iter().map(|u| sensor::quantize(*u, step)).collect();
        let mut inputs = TimeSeries::new(times(u.len(), plan.sample_time))?;
        inputs.push("u", Some("N".into()), u)?;
        let result = run(&graph, Algorithm::GaussSeidel, &inputs)?;
        let mut signals = inputs;
        for (column, from) in [("F_hat", "F_hat"), ("F_p", "F_act")] {
            signals.push(column, Some("N".into()), output(&result, from, actuator)?.to_vec())?;
        }
        let group = name.clone();
        let name = format!("{name}.csv");
        recordings.push(Recording { name, estimation, experiment: "rod_fixed", group, signals });
    }
    Ok(recordings)
}
