//! From a case to the system, its candidates and the corrections of its declared parameters.

use super::catalog::{Scope, candidates};
use super::corrections::{Correction, corrections};
use super::coupled::{Coupled, Trial};
use super::cylinder::EXCHANGE;
use super::motion::skew;
use super::record::Measured;
use super::sense::Reach;
use super::sweep::{Sweep, Sweeps};
use crate::Error;
use crate::case::{Actuator, Case, Experiment, Kind, Role};
use crate::engine::System;
use crate::engine::candidate::Candidate;
use airloop_series::TimeSeries;

/// A case ready for the search.
pub struct Rig {
    /// System.
    pub system: Box<dyn System>,
    /// The same, if it has an actuator: a coupled rig, or one with the rod fixed.
    pub series: Option<Coupled>,
    /// The same, if it is a coupled rig: for the trace by measured forces.
    pub coupled: Option<Coupled>,
    /// Candidates that its records can show.
    pub candidates: Vec<Candidate>,
    /// Declared parameters that may be off.
    pub corrections: Vec<Correction>,
    /// Motion range of the estimation records.
    pub reach: Reach,
    /// Effects of the vocabulary that cannot be looked for, and why.
    pub not_testable: Vec<(String, String)>,
}

impl Rig {
    /// Corrections that the actuator of the parameter vector `p` knows, the declared one or a cylinder.
    pub fn known<'a>(&'a self, p: &'a [f64]) -> impl Iterator<Item = &'a Correction> {
        self.corrections.iter().filter(|own| own.is_known(p))
    }
}

fn values<'a>(records: impl Iterator<Item = &'a TimeSeries>, name: &str) -> (f64, f64) {
    records
        .filter_map(|record| record.channel(name))
        .flat_map(|channel| channel.values.iter())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &value| (low.min(value), high.max(value)))
}

fn refused(case: &Case, problem: &str) -> Error {
    Error::Case { path: format!("{}/case.toml", case.declaration.id).into(), problem: problem.into() }
}

/// Coupled trials, or the actuator with the rod fixed.
///
/// # Errors
/// [`Error::Case`] where the sample times of actuator and records differ, or a record lacks a column that its kind
/// needs.
pub fn coupled(case: &Case, actuator: Actuator) -> Result<Coupled, Error> {
    let declaration = &case.declaration;
    let refused = |problem: &str| refused(case, problem);
    if (actuator.sample_time * declaration.sample_rate_hz - 1.0).abs() > 1e-6 {
        return Err(refused(
            "model.actuator.sample_time and sample_rate_hz do not belong together; resample the records",
        ));
    }
    let mut trials = Vec::new();
    for (series, file) in case.records.iter().zip(&declaration.files) {
        let Some(u) = series.channel("u") else {
            return Err(refused(&format!("{} has no column `u`", file.name)));
        };
        let measured = ["F_hat", "F_p", "x", "theta"].iter().filter_map(|&name| {
            let channel = series.channel(name)?;
            Some(Measured::new(name, channel.values.clone(), declaration.sensors[name].noise_rms))
        });
        let measured: Vec<Measured> = measured.collect();
        let needed: &[&str] =
            if declaration.kind == Kind::Cartpole { &["x", "theta"] } else { &["F_hat", "F_p"] };
        if let Some(missing) = needed.iter().find(|name| !measured.iter().any(|m| m.name == **name)) {
            return Err(refused(&format!(
                "{} has no column `{missing}`, which this kind of record needs",
                file.name
            )));
        }
        let (estimation, fixed) = (file.role == Role::Estimation, declaration.kind == Kind::Actuator);
        trials.push(Trial { u: u.values.clone(), measured, estimation, fixed, restart: None });
    }
    let (declared, cylinder) = (declaration.model.clone(), declaration.model.cylinder.cylinder());
    Ok(Coupled { declared, actuator, cylinder, exchange: EXCHANGE, trials, extra: None })
}

/// Friction sweeps.
fn sweeps(case: &Case) -> Result<Sweeps, Error> {
    let declaration = &case.declaration;
    let dt = 1.0 / declaration.sample_rate_hz;
    let values = |series: &'_ TimeSeries, name: &str| series.channel(name).map(|c| c.values.clone());
    let fitted = case.records.iter().zip(&declaration.files).filter(|(_, f)| f.role == Role::Estimation);
    let both = fitted.filter_map(|(series, _)| Some([values(series, "x")?, values(series, "v")?]));
    let both: Vec<[Vec<f64>; 2]> = both.collect();
    let both: Vec<[&[f64]; 2]> = both.iter().map(|[x, v]| [&x[..], &v[..]]).collect();
    let skew = skew(&both, dt);
    let mut sweeps = Vec::new();
    for (series, file) in case.records.iter().zip(&declaration.files) {
        let record =
            |name: &str| Some((&series.channel(name)?.values[..], declaration.sensors.get(name)?.noise_rms));
        let cart = match file.experiment {
            Experiment::SweepPiston => false,
            Experiment::SweepCart => true,
            _ => {
                return Err(refused(
                    case,
                    &format!("{}: a case of kind `friction` has sweep_piston and sweep_cart only", file.name),
                ));
            }
        };
        let Some((values, noise)) = record("F_p") else {
            return Err(refused(case, &format!("{} has no column `F_p`", file.name)));
        };
        let (x, v) = (record("x"), record("v"));
        if x.is_none() && v.is_none() {
            return Err(refused(
                case,
                &format!("{} has neither `x` nor `v`; the motion of the drive is needed", file.name),
            ));
        }
        let force = Measured::new("F_p", values.to_vec(), noise);
        let estimation = file.role == Role::Estimation;
        let mut sweep = Sweep::new([x, v], force, (cart, estimation), (dt, skew));
        sweep.weigh(&declaration.model);
        sweeps.push(sweep);
    }
    Ok(Sweeps { declared: declaration.model.clone(), dt, sweeps })
}

/// Motion range of records; the speed where none is measured from the positions, over 20 ms.
fn reach<'a>(records: impl Iterator<Item = &'a TimeSeries>, rate: f64) -> Reach {
    let mut found = Reach::default();
    let over = ((0.02 * rate).round() as usize).max(1);
    for record in records {
        let values = |name: &str| record.channel(name).map_or(&[][..], |channel| &channel.values[..]);
        let (x, v) = (values("x"), values("v"));
        found.positions.extend_from_slice(x);
        let steps = x.windows(over + 1).map(|window| (window[over] - window[0]) * rate / over as f64);
        let fastest = |speed: f64, own: f64| speed.max(own.abs());
        found.speed = match v.is_empty() {
            true => steps.fold(found.speed, fastest),
            false => v.iter().copied().fold(found.speed, fastest),
        };
    }
    found.positions.sort_by(f64::total_cmp);
    found
}

/// Makes the system of a case.
///
/// # Errors
/// A part of the model that its records need is not declared, or a signal is missing.
pub fn open(case: &Case) -> Result<Rig, Error> {
    let declaration = &case.declaration;
    let refused = |problem: &str| refused(case, problem);
    let need = |there: bool, what: &str| {
        if there {
            Ok(())
        } else {
            Err(refused(&format!("[model.{what}] is missing; records of this kind need it")))
        }
    };
    let actuator = declaration.model.actuator.clone();
    let model = &declaration.model;
    if declaration.kind != Kind::Friction {
        need(actuator.is_some(), "actuator")?;
    }
    if declaration.kind == Kind::Cartpole {
        need(model.piston_friction.is_some(), "piston_friction")?;
        need(model.cart_friction.is_some(), "cart_friction")?;
        need(model.cart_pole.is_some(), "cart_pole")?;
    }
    if declaration.kind == Kind::Friction {
        need(model.piston_friction.is_some(), "piston_friction")?;
        need(model.cart_friction.is_some(), "cart_friction")?;
    }
    let series = match actuator {
        Some(actuator) if declaration.kind != Kind::Friction => Some(coupled(case, actuator)?),
        _ => None,
    };
    let system: Box<dyn System> = match &series {
        Some(series) => Box::new(series.clone()),
        None => Box::new(sweeps(case)?),
    };
    let coupled = series.clone().filter(|_| declaration.kind == Kind::Cartpole);
    let fitted = || {
        case.records
            .iter()
            .zip(&declaration.files)
            .filter(|(_, f)| f.role == Role::Estimation)
            .map(|(r, _)| r)
    };
    let (low, high) = values(fitted(), "u");
    let scope = Scope {
        declared: model,
        kind: declaration.kind,
        signals: declaration.sensors.keys().map(String::as_str).filter(|name| *name != "u").collect(),
        command: low.abs().max(high.abs()),
        positions: values(fitted(), "x"),
    };
    let corrections = corrections(&scope, &declaration.tolerance);
    let candidates = candidates(&scope);
    let reach = reach(fitted(), declaration.sample_rate_hz);
    let mut not_testable = Vec::new();
    if declaration.kind != Kind::Friction {
        not_testable
            .push(("act.area".into(), "no chamber pressure is measured; it would look like act.gain".into()));
    }
    if declaration.kind == Kind::Cartpole {
        not_testable
            .push(("sensor.offset(x)".into(), "the initial position is unknown and takes it up".into()));
    }
    if declaration.kind == Kind::Friction {
        not_testable.push(("sensor.offset(x)".into(), "only its changes tell of friction".into()));
        not_testable.push(("pf.pressure".into(), "the cylinder is vented".into()));
    }
    Ok(Rig { system, series, coupled, candidates, corrections, reach, not_testable })
}
