//! First-principles pneumatic actuator: a double-acting cylinder whose chambers are fed by one proportional
//! pressure-control valve each, through tubes.
//!
//! [`orifice`] has the flow law, [`valve`] the valve with its controller and port, [`chamber`] the pressure in the
//! cylinder, [`parameters`] the table of parameters. This module ties them together and holds what goes by samples:
//! play, delay line and the seal of a fixed rod.

mod chamber;
mod orifice;
mod parameters;
mod side;
#[cfg(test)]
mod tests;
mod valve;

use chamber::{Chamber, Exponents};
use fmi_export::{Identity, Memory, MemoryBlock, Model, Outcome, Real, Refusal, Scalar, Table, Values};
use orifice::Air;
use parameters::Parameters;
use side::{MAX_DELAY, Side};
use valve::{Flows, Valve};

/// Force command and piston motion to forces and pressures; the equations stand in the README of the FMU.
///
/// | name | unit | meaning |
/// |---|---|---|
/// | `u` | N | force command, sampled every `sample_time` |
/// | `x`, `v` | m, m/s | position of the piston (0: mid-stroke) and speed |
/// | `F_hat` | N | force of the pressures at the valve ports |
/// | `F_act` | N | force on the piston before its friction; with `rod_fixed` that of the load cell |
/// | `p1`, `p2`, `pv1`, `pv2` | Pa | pressures of chambers and valve ports, absolute |
///
/// Continuous states and two clocks: the delay line moves every substep, play and seal every `sample_time`. With the
/// default integrator that is the classical Runge-Kutta method with steps of a substep, as in the rig.
#[allow(non_snake_case)]
pub struct PneumaticCylinder {
    u: Real,
    x: Real,
    v: Real,
    F_hat: Real,
    F_act: Real,
    sides: [Side; 2],
    k: Parameters,
    S1: Real,
    S2: Real,
    F_eq: Real,
    /// Deflection of the seal, and the chamber force at the last sample.
    seal: MemoryBlock,
    /// Substeps since the last sample of the command.
    count: MemoryBlock,
}

impl PneumaticCylinder {
    /// Step of the delay line \[s\].
    fn substep<S: Scalar>(&self, q: &Values<S>) -> f64 {
        q[self.k.sample_time].value() / f64::from(q[self.k.substeps])
    }

    /// Delay of the tubes in substeps.
    fn delay<S: Scalar>(&self, q: &Values<S>) -> usize {
        (q[self.k.tdelay].value() / self.substep(q)).round() as usize
    }

    /// True where a sample of the command falls on the present time.
    fn is_command_sample<S: Scalar>(&self, q: &Values<S>) -> bool {
        q.at_sample && q[self.count.at(0)].value() == 0.0
    }

    /// Pressure command of side `i` \[Pa\] behind the play (paper eq. 3).
    fn command<S: Scalar>(&self, q: &Values<S>, i: usize) -> S {
        let old = q[self.sides[i].play.at(0)];
        if !self.is_command_sample(q) {
            return old;
        }
        let force = q[self.F_eq] + q[self.u] * [0.5, -0.5][i];
        let ambient = q[self.k.patm];
        let commanded =
            (force / q[[self.S1, self.S2][i]] + ambient).clamp_to(ambient, q[self.k.psup] + ambient);
        let half = q[self.k.vhys];
        old.clamp_to(commanded - half, commanded + half)
    }

    /// Flow that leaves the tube of side `i` \[kg/s\] where `entering` enters it.
    fn delayed<S: Scalar>(&self, q: &Values<S>, i: usize, entering: S) -> S {
        let (line, delay) = (self.sides[i].line, self.delay(q));
        match (delay, q.at_sample) {
            (0, _) => entering,
            (_, false) => q[line.at(delay)],
            (_, true) => q[line.at(delay - 1)],
        }
    }

    /// Deflection of the seal on a fixed rod \[m\] for the chamber force `f` \[N\].
    fn seal_deflection<S: Scalar>(&self, q: &Values<S>, f: S) -> S {
        let z = q[self.seal.at(0)];
        if !self.is_command_sample(q) {
            return z;
        }
        let dx = (f - q[self.seal.at(1)]) / q[self.k.klc];
        z + dx - dx.abs() * z / q[self.k.sealx]
    }

    /// Force of the chamber pressures \[N\].
    fn chamber_force<S: Scalar>(&self, q: &Values<S>) -> S {
        let ambient = q[self.k.patm];
        let [p1, p2] = [0, 1].map(|i| q[self.sides[i].p] - ambient);
        q[self.k.eta] * (q[self.S1] * p1 - q[self.S2] * p2)
    }

    fn valve<S: Scalar>(&self, q: &Values<S>, i: usize) -> Valve<S> {
        let h = &self.sides[i].valve;
        Valve { c: q[h.c], q: q[h.q], s: q[h.s], s_rate: q[h.s_rate], pv: q[h.pv] }
    }

    /// Volumes \[m³\] and their rates \[m³/s\].
    fn volumes<S: Scalar>(&self, q: &Values<S>) -> Result<[(S, S); 2], Refusal> {
        let half = q[self.k.stroke] * 0.5;
        let mut volumes = [(S::zero(), S::zero()); 2];
        for (i, (area, sign)) in [(self.S1, 1.0), (self.S2, -1.0)].into_iter().enumerate() {
            let volume = q[self.k.dead] + q[area] * (half + q[self.x] * sign);
            if volume.value() <= 0.0 {
                return Err(Refusal::Discard(format!(
                    "x = {} m leaves chamber {} no volume; the piston moves within {} m to both sides",
                    q[self.x].value(),
                    i + 1,
                    half.value()
                )));
            }
            volumes[i] = (volume, q[area] * q[self.v] * sign);
        }
        Ok(volumes)
    }

    fn check_pressures<S: Scalar>(&self, q: &Values<S>) -> Outcome {
        for (i, side) in self.sides.iter().enumerate() {
            for (name, p) in [("p", q[side.p]), ("pv", q[side.valve.pv])] {
                if p.value().is_nan() || p.value() <= 0.0 {
                    return Err(Refusal::Discard(format!(
                        "{name}{} = {} Pa is not an absolute pressure; try a smaller step",
                        i + 1,
                        p.value()
                    )));
                }
            }
        }
        Ok(())
    }

    /// Moves a line by one place.
    fn shift(q: &mut Values<f64>, line: MemoryBlock, places: usize, youngest: f64) {
        for k in (1..=places).rev() {
            q[line.at(k)] = q[line.at(k - 1)];
        }
        q[line.at(0)] = youngest;
    }
}

impl Model for PneumaticCylinder {
    const IDENTITY: Identity = Identity {
        model_identifier: "pneumatic_cylinder",
        model_name: "pneumatic-cylinder",
        description: "Pneumatic cylinder with two pressure-control valves, from force command and motion to force",
        version: crate::VERSION,
        author: crate::AUTHOR,
        generation_tool: crate::GENERATION_TOOL,
        stop_time: 1.0,
        step_size: 0.001,
    };

    #[allow(non_snake_case)]
    fn declare(t: &mut Table) -> Self {
        for (name, exponents) in side::UNITS {
            t.unit(name, exponents);
        }
        let u = t.input("u").unit("N").about("force command").nominal(50.0).real(0.0);
        let x =
            t.input("x").unit("m").about("position of the piston, 0 at mid-stroke").nominal(0.05).real(0.0);
        let v = t.input("v").unit("m/s").about("speed of the piston").nominal(0.5).real(0.0);
        let mut force = |name: &'static str, about: &'static str| {
            t.output(name).unit("N").about(about).nominal(50.0).computed()
        };
        let F_hat = force("F_hat", "force of the pressures at the valve ports");
        let F_act =
            force("F_act", "force on the piston before its friction; with rod_fixed on the load cell");
        let sides = [1, 2].map(|i| Side::declare(t, i));
        let k = Parameters::declare(t);
        let mut area = |name: &'static str, about: &'static str| {
            t.calculated(name).unit("m2").about(about).nominal(3e-4).computed()
        };
        let S1 = area("S1", "sectional area of chamber 1");
        let S2 = area("S2", "sectional area of chamber 2");
        let F_eq = t.calculated("F_eq").unit("N").about("bias force").nominal(50.0).computed();
        Self { u, x, v, F_hat, F_act, sides, k, S1, S2, F_eq, seal: t.memory(2), count: t.memory(1) }
    }

    fn prepare<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        use std::f64::consts::FRAC_PI_4;
        let (bore, rod) = (q[self.k.bore], q[self.k.rod]);
        q[self.S1] = bore.squared() * FRAC_PI_4;
        q[self.S2] = q[self.S1] - rod.squared() * FRAC_PI_4;
        q[self.F_eq] = q[self.k.psup] * 0.5 * (q[self.S1] + q[self.S2]) * 0.5;
        let refused = |text: String| Err(Refusal::Error(text));
        if rod.value() >= bore.value() {
            return refused(format!(
                "rod = {} m must be thinner than bore = {} m",
                rod.value(),
                bore.value()
            ));
        }
        if self.delay(q) > MAX_DELAY {
            return refused(format!(
                "tdelay = {} s is more than {MAX_DELAY} substeps of {} s; take fewer substeps per sample",
                q[self.k.tdelay].value(),
                self.substep(q)
            ));
        }
        Ok(())
    }

    /// At rest at the bias pressures: ports, chambers, commands and play at `F_eq / S + patm`, all else 0.
    fn initialize<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        for (side, area) in self.sides.iter().zip([self.S1, self.S2]) {
            let bias = q[self.F_eq] / q[area] + q[self.k.patm];
            for state in [side.valve.c, side.valve.pv, side.p] {
                q[state] = bias;
            }
            for state in [side.valve.q, side.valve.s, side.valve.s_rate] {
                q[state] = S::zero();
            }
            q[side.play.at(0)] = bias;
        }
        Ok(())
    }

    fn equations<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        self.check_pressures(q)?;
        let volumes = self.volumes(q)?;
        let air = Air::new(q[self.k.R], q[self.k.T]);
        let exponents = Exponents { inflow: q[self.k.kin], outflow: q[self.k.kout], work: q[self.k.kv] };
        let leak = q[self.k.leak] * air.flow(q[self.sides[0].p], q[self.sides[1].p]);
        for (i, side) in self.sides.iter().enumerate() {
            let (valve, p) = (self.valve(q, i), q[side.p]);
            let flows = valve.flows(air, &self.k, q, p);
            let rates = valve.rates(air, &self.k, q, self.command(q, i), flows);
            let (volume, volume_rate) = volumes[i];
            let inflow = self.delayed(q, i, flows.tube);
            let leak = if i == 0 { leak } else { -leak };
            let chamber = Chamber { p, volume, volume_rate, inflow, leak };
            q[side.der_p] = chamber.pressure_rate(air, exponents);
            let der = &side.der_valve;
            for (handle, rate) in [der.c, der.q, der.s, der.s_rate, der.pv].into_iter().zip([
                rates.c,
                rates.q,
                rates.s,
                rates.s_rate,
                rates.pv,
            ]) {
                q[handle] = rate;
            }
            let Flows { valve: m_valve, tube: m_tube } = flows;
            (q[side.m_valve], q[side.m_tube]) = (m_valve, m_tube);
        }
        let ambient = q[self.k.patm];
        let [pv1, pv2] = [0, 1].map(|i| q[self.sides[i].valve.pv] - ambient);
        q[self.F_hat] = q[self.S1] * pv1 - q[self.S2] * pv2; // eq. 5
        let f = self.chamber_force(q);
        q[self.F_act] = if q[self.k.rod_fixed] {
            f - q[self.k.seal] * self.seal_deflection(q, f) / q[self.k.sealx]
        } else {
            f
        };
        Ok(())
    }

    fn sample_period(&self, q: &Values<f64>) -> Option<f64> {
        Some(self.substep(q))
    }

    fn sample(&self, q: &mut Values<f64>) {
        let f = self.chamber_force(q);
        let z = self.seal_deflection(q, f);
        let commands = [0, 1].map(|i| self.command(q, i));
        if self.is_command_sample(q) {
            (q[self.seal.at(0)], q[self.seal.at(1)]) = (z, f);
        }
        let delay = self.delay(q);
        for (side, command) in self.sides.iter().zip(commands) {
            q[side.play.at(0)] = command;
            let entering = q[side.m_tube];
            Self::shift(q, side.line, delay, entering);
        }
        let count: Memory = self.count.at(0);
        q[count] = if q[count] + 1.0 < f64::from(q[self.k.substeps]) { q[count] + 1.0 } else { 0.0 };
    }

    /// Draws with the spools on both sides and closed, all three ranges of the flow law, and both kinds of rod.
    fn probe(&self, draw: usize, table: &Table, q: &mut Values<f64>) {
        table.spread(draw, q);
        // Areas and bias force of this draw; a draw that is refused is passed over by the search.
        let _ = self.prepare(q);
        q[self.k.rod_fixed] = draw.is_multiple_of(2);
        (q[self.k.sample_time], q[self.k.substeps]) = (1e-3, 10);
        q[self.k.tdelay] = if draw == 0 { 0.0 } else { 0.003 };
        q[self.x] *= [0.3, 1.0, 0.1, 0.5][draw % 4];
        let spool = [[0.3, -0.2], [-0.4, 0.25], [0.011, 0.5], [0.15, -0.012]][draw % 4];
        let part = [[0.45, 0.63], [0.6, 0.48], [0.3, 0.9], [0.75, 0.55]][draw % 4];
        let across = [[0.9, 1.05], [1.001, 0.8], [1.9, 0.9985], [0.6, 1.2]][draw % 4];
        let supply = q[self.k.psup] + q[self.k.patm];
        for (i, side) in self.sides.iter().enumerate() {
            let wave = 0.05 * ((draw * 2 + i) as f64).sin();
            q[side.valve.pv] = supply * part[i];
            q[side.p] = q[side.valve.pv] * across[i];
            q[side.valve.c] = q[side.valve.pv] * (1.0 + 0.1 * wave);
            // One draw beyond the bound of the integrator.
            q[side.valve.q] = if draw == 1 { 0.35 } else { wave };
            (q[side.valve.s], q[side.valve.s_rate]) = (spool[i], 30.0 * wave);
            q[side.play.at(0)] = q[self.F_eq] / q[[self.S1, self.S2][i]] + q[self.k.patm];
        }
    }
}
