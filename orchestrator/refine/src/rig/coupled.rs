//! Simulation of the coupled rig, and of the actuator with the rod fixed.

use std::array::from_fn;
use std::sync::Arc;

use super::corrections;
use super::cylinder::{Chambers, Cylinder};
use super::driven::{Driven, Load};
use super::extra::{Extra, Place};
use super::lanes::Lanes;
use super::parameters::*;
use super::plant::{ActuatorTerms, Mechanics, State, actuator, mechanics};
use super::record::{Measured, spans, values, whitened};
use super::windowed::Restart;
use crate::case::{Actuator, Declared};
use crate::engine::System;
use crate::engine::noise::Noise;
use crate::engine::system::{Job, Span};
use crate::study::law::Point;

/// Runge-Kutta steps per sample. The stiffest mode (friction at standstill) has a time constant of 0.8 ms.
const SUBSTEPS: usize = 2;
/// The same with a cylinder, whose valves open and close within a sample.
const SUBSTEPS_WITH_CYLINDER: usize = 4;

/// One record: command and measured signals.
#[derive(Debug, Clone)]
pub struct Trial {
    /// Force command \[N\], shape \[n\].
    pub u: Vec<f64>,
    /// Measured signals.
    pub measured: Vec<Measured>,
    /// Whether it may be fitted.
    pub estimation: bool,
    /// Whether the rod is fixed: no mechanics.
    pub fixed: bool,
    /// Where the simulation begins again from the measured motion; none: nowhere.
    pub restart: Option<Restart>,
}

/// Predicted signals of a record, each of shape \[n\].
#[derive(Debug, Clone, Default)]
struct Prediction {
    /// Pressure force \[N\].
    f_hat: Vec<f64>,
    /// Load cell \[N\].
    f_p: Vec<f64>,
    /// Position \[m\].
    x: Vec<f64>,
    /// Pole angle \[rad\].
    theta: Vec<f64>,
}

/// The sampled actuator during a simulation.
pub struct Running<'a> {
    terms: &'a ActuatorTerms,
    command: Vec<f64>,
    y: [f64; 2],
    before: f64,
    mode: [f64; 2],
}

impl<'a> Running<'a> {
    /// At rest, with the whole command of the record.
    pub fn new(terms: &'a ActuatorTerms, u: &[f64]) -> Running<'a> {
        Running { terms, command: terms.shaped_command(u), y: [0.0; 2], before: 0.0, mode: [0.0; 2] }
    }

    /// Force command \[N\] that arrives at the actuator in sample `k` at time `t` \[s\]; behind the end of the record
    /// it is zero.
    pub fn command(&mut self, k: usize, t: f64, x: f64) -> f64 {
        let terms = self.terms;
        let mut u = self.command.get(k).copied().unwrap_or(0.0) * (1.0 + terms.posgain * x);
        if terms.droop.0 != 0.0 {
            u *= 1.0 - terms.droop.0 * (1.0 - (-t / terms.droop.1).exp());
        }
        u -= terms.taken(Place::Command, &Point { value: u, position: x, time: t, ..Point::default() });
        if let Some((transition, input)) = &terms.mode {
            let q = self.mode;
            self.mode =
                std::array::from_fn(|i| transition[i][0] * q[0] + transition[i][1] * q[1] + input[i] * u);
            u = q[0];
        }
        u
    }

    /// Pressure force and force on the piston \[N\] over sample `k` at time `t` \[s\].
    pub fn sample(&mut self, k: usize, t: f64, x: f64, v: f64) -> [f64; 2] {
        let u = self.command(k, t, x);
        let (terms, y) = (self.terms, self.y);
        self.y = std::array::from_fn(|i| {
            -(terms.a[i][0] * y[0] + terms.a[i][1] * y[1]) + terms.b0[i] * u + terms.b1[i] * self.before // eq. 6
        });
        self.before = u;
        let point = Point { position: x, velocity: v, time: t, ..Point::default() };
        let lost = terms.backpressure * v + terms.taken(Place::Force, &point);
        [self.y[0] - lost, self.y[1] - lost]
    }
}

/// Simulates records side by side from positions and angles `start` \[m, rad\] at rest, or in `windows`: states of the
/// mechanics at the beginnings of windows of so many samples (0: one window).
///
/// The first sample of the actuator has no past: y(-1) = u(-1) = 0.
#[multiversion::multiversion(targets("x86_64+avx2"))]
fn simulate<const L: usize>(
    terms: &[ActuatorTerms; L],
    chambers: Option<&Chambers<L>>,
    plant: &Mechanics<L>,
    u: [&[f64]; L],
    dt: f64,
    start: [Lanes<L>; 2],
    (every, windows): (usize, &[Vec<[f64; 4]>; L]),
) -> [Prediction; L] {
    let mut out: [Prediction; L] = from_fn(|i| {
        let room = || Vec::with_capacity(u[i].len());
        Prediction { f_hat: room(), f_p: room(), x: room(), theta: room() }
    });
    let mut running: [Running; L] = from_fn(|i| Running::new(&terms[i], u[i]));
    let mut plant = plant.clone();
    let none = Lanes::default();
    let mut s: State<L> = [start[0], none, start[1], none, none, none];
    let substeps = if chambers.is_some() { SUBSTEPS_WITH_CYLINDER } else { SUBSTEPS };
    let h = dt / substeps as f64;
    let lost = Lanes(from_fn(|i| terms[i].backpressure));
    let samples = u.iter().map(|command| command.len()).max().unwrap_or(0);
    let mut cylinder = chambers.map(|chambers| Driven::new(chambers, substeps * samples, h));
    for k in 0..samples {
        if every > 0 && k % every == 0 {
            for (i, states) in windows.iter().enumerate() {
                if let Some(state) = states.get(k / every) {
                    (0..4).for_each(|j| s[j].0[i] = state[j]);
                }
            }
        }
        plant.time = k as f64 * dt;
        let (mut f_hat, mut f_act) = (none, none);
        match &mut cylinder {
            Some(cylinder) => {
                let command = from_fn(|i| running[i].command(k, k as f64 * dt, s[0].0[i]));
                [f_hat, f_act] = cylinder.sample(Lanes(command)).map(|force| force - lost * s[1]);
            }
            None => {
                for (i, running) in running.iter_mut().enumerate() {
                    [f_hat.0[i], f_act.0[i]] = running.sample(k, k as f64 * dt, s[0].0[i], s[1].0[i]);
                }
            }
        }
        let p = f_hat.abs();
        let f_p = f_act - plant.piston.force(s[1], s[0], p, s[4]);
        let f_p = plant.taken(Place::Piston, s[0], s[1]).map_or(f_p, |taken| f_p - taken);
        for (i, own) in out.iter_mut().enumerate().filter(|(i, _)| k < u[*i].len()) {
            own.f_hat.push(f_hat.0[i]);
            own.f_p.push(f_p.0[i]);
            own.x.push(s[0].0[i]);
            own.theta.push(s[2].0[i]);
        }
        for _ in 0..substeps {
            s = match &mut cylinder {
                Some(cylinder) => cylinder.step(&s, &Load { plant: &plant, p, lost }),
                None => plant.step(&s, f_act, p, none, h),
            };
        }
    }
    out
}

/// The actuator alone, its rod fixed.
fn simulate_fixed(terms: &ActuatorTerms, u: &[f64], dt: f64) -> Prediction {
    let mut running = Running::new(terms, u);
    let (f_hat, f_p) =
        (0..u.len()).map(|k| running.sample(k, k as f64 * dt, 0.0, 0.0)).map(|[f, p]| (f, p)).unzip();
    Prediction { f_hat, f_p, ..Prediction::default() }
}

/// The rig as a system of the engine: declared model and trials.
#[derive(Debug, Clone)]
pub struct Coupled {
    /// Declared parameters.
    pub declared: Declared,
    /// Declared actuator.
    pub actuator: Actuator,
    /// Cylinder that takes its place where the parameter vector says so.
    pub cylinder: Cylinder,
    /// Time \[s\] after which it and the mechanics of the rig exchange force and motion.
    pub exchange: f64,
    /// Records.
    pub trials: Vec<Trial>,
    /// A law that the vocabulary does not have; its parameters stand behind those of the rig.
    pub extra: Option<Arc<Extra>>,
}

/// Simulations that run side by side: four keep the registers of any processor busy.
pub const SIDE_BY_SIDE: usize = 4;

impl Coupled {
    /// The actuator for a parameter vector, with the law beyond the vocabulary if there is one.
    fn actuator_terms(&self, p: &[f64]) -> ActuatorTerms {
        let extra = self.extra.as_ref().map(|extra| (Arc::clone(extra), p[TABLE.len()..].to_vec()));
        ActuatorTerms { extra, ..actuator(&self.actuator, p) }
    }

    /// The cylinders for parameter vectors.
    fn chambers<const L: usize>(&self, p: [&[f64]; L]) -> Chambers<L> {
        Chambers::new(&p.map(|p| corrections::corrected(&self.cylinder, p)), self.exchange)
    }

    /// Predicted signals of up to [`SIDE_BY_SIDE`] jobs, without sensor effects.
    fn simulate(&self, jobs: &[Job]) -> Vec<Prediction> {
        let dt = self.actuator.sample_time;
        let fixed = |job: &Job| self.trials[job.record].fixed;
        if jobs.iter().any(fixed) {
            let one = |job: &Job| {
                simulate_fixed(&self.actuator_terms(&job.parameters), &self.trials[job.record].u, dt)
            };
            return jobs.iter().map(one).collect();
        }
        let moving = |job: &Job| job.parameters[CYLINDER] != 0.0;
        let cylinder = jobs.first().is_some_and(moving);
        if jobs.iter().any(|job| moving(job) != cylinder) {
            return jobs.iter().flat_map(|job| self.simulate(std::slice::from_ref(job))).collect();
        }
        // Idle lanes repeat the last job, over no samples.
        let job = |i: usize| &jobs[i.min(jobs.len() - 1)];
        let mut plant: Mechanics<SIDE_BY_SIDE> =
            mechanics(&self.declared, from_fn(|i| &job(i).parameters[..]));
        if let Some(extra) = &self.extra {
            let own = from_fn(|i| job(i).parameters[TABLE.len()..].to_vec());
            plant.extra = Some((Arc::clone(extra), own));
        }
        let cylinder = cylinder.then(|| self.chambers(from_fn(|i| &job(i).parameters[..])));
        let start = [0, 1].map(|j| Lanes(from_fn(|i| job(i).locals.get(j).copied().unwrap_or(0.0))));
        let u = from_fn(|i| jobs.get(i).map_or(&[][..], |job| &self.trials[job.record].u[..]));
        let terms = from_fn(|i| self.actuator_terms(&job(i).parameters));
        let windows = from_fn(|i| {
            let restart = jobs.get(i).and_then(|job| self.trials[job.record].restart.as_ref());
            restart.map_or(Vec::new(), |restart| restart.states(&job(i).parameters))
        });
        let every = jobs.iter().find_map(|job| Some(self.trials[job.record].restart.as_ref()?.every));
        let mut found = Vec::from(simulate(
            &terms,
            cylinder.as_ref(),
            &plant,
            u,
            dt,
            start,
            (every.unwrap_or(0), &windows),
        ));
        found.truncate(jobs.len());
        found
    }

    /// Sensor values of a trial for a prediction, all signals one after the other.
    fn shown(&self, record: usize, prediction: &Prediction, p: &[f64]) -> Vec<f64> {
        let trial = &self.trials[record];
        let mut seen = Vec::with_capacity(trial.u.len());
        let mut out = Vec::with_capacity(trial.u.len() * trial.measured.len());
        for m in &trial.measured {
            let (truth, before) = match m.name.as_str() {
                "F_hat" => (&prediction.f_hat, 0.0),
                "F_p" => (&prediction.f_p, 0.0),
                "x" => (&prediction.x, prediction.x.first().copied().unwrap_or(0.0)),
                _ => (&prediction.theta, prediction.theta.first().copied().unwrap_or(0.0)),
            };
            sensed(&m.name, truth, p, self.actuator.sample_time, before, &mut seen);
            out.extend_from_slice(&seen);
        }
        out
    }
}

/// Parameters of the sensor of a column: offset, delay, gain.
pub fn sensor(name: &str) -> Option<[usize; 3]> {
    match name {
        "F_hat" => Some([OFFSET_F_HAT, SENSOR_DELAY_F_HAT, SENSOR_GAIN_F_HAT]),
        "F_p" => Some([OFFSET_F_P, SENSOR_DELAY_F_P, SENSOR_GAIN_F_P]),
        "x" => Some([OFFSET_X, SENSOR_DELAY_X, SENSOR_GAIN_X]),
        "theta" => Some([OFFSET_THETA, SENSOR_DELAY_THETA, SENSOR_GAIN_THETA]),
        "v" => Some([OFFSET_V, SENSOR_DELAY_V, SENSOR_GAIN_V]),
        _ => None,
    }
}

/// Signal of a sensor with its effects (offset, delay, gain); `before` is the true signal before the record begins.
pub fn sensed(name: &str, truth: &[f64], p: &[f64], dt: f64, before: f64, out: &mut Vec<f64>) {
    let Some([offset, delay, gain]) = sensor(name) else { return };
    let (offset, delay, gain) = (p[offset], p[delay] / dt, 1.0 + p[gain]);
    let at = |index: i64| if index < 0 { before } else { truth[index as usize] };
    let (whole, part) = (delay.floor() as i64, delay.fract());
    out.clear();
    if delay == 0.0 {
        out.extend(truth.iter().map(|value| gain * value + offset));
    } else {
        let delayed = |k: i64| (1.0 - part) * at(k - whole) + part * at(k - whole - 1);
        out.extend((0..truth.len() as i64).map(|k| gain * delayed(k) + offset));
    }
}

impl System for Coupled {
    fn records(&self) -> usize {
        self.trials.len()
    }

    fn estimation(&self, record: usize) -> bool {
        self.trials[record].estimation
    }

    fn locals(&self, record: usize) -> Vec<(f64, f64)> {
        let trial = &self.trials[record];
        let first = |name: &str| trial.measured.iter().find(|m| m.name == name).map_or(0.0, |m| m.values[0]);
        if trial.fixed || trial.restart.is_some() {
            Vec::new()
        } else {
            vec![(first("x"), 2e-5), (first("theta"), 1e-4)]
        }
    }

    fn beginning(&self, share: f64) -> Option<Box<dyn System + '_>> {
        let cut = |trial: &Trial| {
            let n = (share * trial.u.len() as f64) as usize;
            let measured = trial.measured.iter().map(|m| m.beginning(n)).collect();
            let (estimation, fixed) = (trial.estimation, trial.fixed);
            Trial { u: trial.u[..n].to_vec(), measured, estimation, fixed, restart: None }
        };
        if self.trials.iter().any(|trial| trial.fixed || trial.restart.is_some()) {
            return None;
        }
        Some(Box::new(Coupled {
            declared: self.declared.clone(),
            actuator: self.actuator.clone(),
            cylinder: self.cylinder,
            exchange: self.exchange,
            trials: self.trials.iter().map(cut).collect(),
            extra: self.extra.clone(),
        }))
    }

    fn signals(&self, record: usize) -> Vec<Span> {
        spans(&self.trials[record].measured)
    }

    fn predict(&self, record: usize, p: &[f64], locals: &[f64]) -> Vec<f64> {
        let job = Job { record, parameters: p.to_vec(), locals: locals.to_vec() };
        self.shown(record, &self.simulate(&[job])[0], p)
    }

    fn side_by_side(&self) -> usize {
        SIDE_BY_SIDE
    }
    fn residuals_of(&self, jobs: &[Job]) -> Vec<Vec<f64>> {
        let one = |(job, prediction): (&Job, &Prediction)| {
            self.whiten(job.record, &self.shown(job.record, prediction, &job.parameters))
        };
        jobs.chunks(SIDE_BY_SIDE)
            .flat_map(|some| some.iter().zip(&self.simulate(some)).map(one).collect::<Vec<_>>())
            .collect()
    }

    fn measured(&self, record: usize) -> Vec<f64> {
        values(&self.trials[record].measured)
    }

    fn whiten(&self, record: usize, predicted: &[f64]) -> Vec<f64> {
        whitened(&self.trials[record].measured, predicted)
    }

    fn redraw(&self, record: usize, predicted: &[f64], noise: &mut Noise) -> Vec<f64> {
        let trial = &self.trials[record];
        let mut out = Vec::with_capacity(predicted.len());
        for (m, own) in trial.measured.iter().zip(predicted.chunks(trial.u.len())) {
            m.redraw(own, noise, &mut out);
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::case::{CartPole, Friction};
    use crate::rig::cylinder::EXCHANGE;
    use crate::rig::parameters::neutral;

    fn rig() -> Coupled {
        let declared = Declared {
            piston_friction: Some(Friction { c1: 1.5, c2: 40.0, c4: 50.0, ..Friction::default() }),
            cart_friction: Some(Friction { c1: 6.0, c2: 60.0, ..Friction::default() }),
            cart_pole: Some(CartPole { m_c: 0.4, m_p: 0.1, l: 0.2, g: 9.81, ..CartPole::default() }),
            ..Declared::default()
        };
        let actuator =
            Actuator { sample_time: 1e-3, A1: [[-0.9, 0.0], [0.0, -0.8]], B0: [0.1, 0.2], B1: [0.0; 2] };
        let trial = |n: usize| {
            let measured = ["F_hat", "F_p", "x", "theta"].map(|name| Measured::new(name, vec![0.0; n], 0.1));
            let u = (0..n).map(|k| 30.0 * (0.02 * k as f64).sin()).collect();
            Trial { u, measured: measured.into(), estimation: true, fixed: false, restart: None }
        };
        let cylinder = Cylinder::default();
        let trials = vec![trial(300), trial(200)];
        Coupled { declared, actuator, cylinder, exchange: EXCHANGE, trials, extra: None }
    }

    #[test]
    fn simulations_side_by_side_are_those_one_by_one_to_the_last_bit() {
        let rig = rig();
        let with = |record, values: &[(usize, f64)]| {
            let mut parameters = neutral();
            values.iter().for_each(|&(index, value)| parameters[index] = value);
            Job { record, parameters, locals: vec![0.01, -0.02] }
        };
        let jobs = [
            with(0, &[]),
            with(1, &[(CF_PRESLIDING, 1e-3), (POLE_COULOMB, 1e-3)]),
            with(0, &[(COG_SIN, 0.5), (TILT, 0.02), (PF_ASYM_COEF, 2.0)]),
            with(0, &[(STOP_POS, 0.005), (STOP_STIFFNESS, 300.0), (PF_STRIBECK, 1.0)]),
            with(1, &[(BACKPRESSURE, 3.0), (DELAY, 1.5e-3)]),
        ];
        let one_by_one: Vec<Vec<f64>> =
            jobs.iter().map(|job| rig.residuals(job.record, &job.parameters, &job.locals)).collect();
        assert!(one_by_one.windows(2).all(|pair| pair[0] != pair[1]));
        assert!(one_by_one.iter().flatten().all(|value| value.is_finite()));
        assert_eq!(rig.residuals_of(&jobs), one_by_one);
    }

    #[test]
    fn the_beginning_of_the_records_shows_what_the_whole_shows_there() {
        let rig = rig();
        let half = rig.beginning(0.5).unwrap();
        for record in 0..2 {
            let n = rig.trials[record].u.len();
            let [whole, cut] = [&rig as &dyn System, half.as_ref()]
                .map(|system| system.residuals(record, &neutral(), &[0.01, -0.02]));
            assert_eq!(cut.len(), 4 * (n / 2));
            for (own, part) in whole.chunks(n).zip(cut.chunks(n / 2)) {
                assert_eq!(&own[..n / 2], part);
            }
        }
    }
}
