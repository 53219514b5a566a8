//! Effects missing from a declared model at any port, as a continuous block in series: forces, torques, voltages,
//! flows, commands.
//!
//! No variable has a unit: the block works in those of the port. [`command`] changes the value that passes, [`force`]
//! is taken off it.

mod command;
mod force;
#[cfg(test)]
mod tests;

use fmi_export::{Identity, Model, Outcome, Real, Scalar, Table, Values};

use command::Command;
use force::Force;

/// Signals that the terms depend on.
#[derive(Clone, Copy, Debug)]
struct Point<S> {
    /// Position and velocity, or their like: level and flow, charge and current.
    x: S,
    v: S,
    /// Velocity from that of the sign change, `v - v0`, and its smooth sign `tanh((v - v0)/vt)`.
    w: S,
    s: S,
    /// Load that friction grows with.
    load: S,
    /// Pressure of a chamber.
    p: S,
}

/// `y = command(u) - sign f`
///
/// | name | meaning |
/// |---|---|
/// | `u`, `y` | value before and after |
/// | `x`, `v` | position and velocity along it |
/// | `load` | what friction grows with |
/// | `p` | pressure of a chamber |
/// | `f` | what is taken off |
/// | `vt`, `v0` | velocity over which friction changes its sign, and at which it does |
/// | `sign` | 1, or -1 where a larger value makes the velocity fall |
pub struct PortEffect {
    u: Real,
    x: Real,
    v: Real,
    load: Real,
    p: Real,
    y: Real,
    f: Real,
    vt: Real,
    v0: Real,
    sign: Real,
    command: Command,
    force: Force,
}

impl Model for PortEffect {
    const IDENTITY: Identity = Identity {
        model_identifier: "port_effect",
        model_name: "port-effect",
        description: "What a declared model lacks at a port of any unit, in series: y = command(u) - sign f",
        version: crate::VERSION,
        author: crate::AUTHOR,
        generation_tool: crate::GENERATION_TOOL,
        stop_time: 1.0,
        step_size: 0.001,
    };

    fn declare(t: &mut Table) -> Self {
        Self {
            u: t.input("u").about("value before the effects").real(0.0),
            x: t.input("x").about("position along the port").real(0.0),
            v: t.input("v").about("velocity along the port").real(0.0),
            load: t.input("load").about("what friction grows with").real(0.0),
            p: t.input("p").about("pressure of a chamber").real(0.0),
            y: t.output("y").about("value behind the effects").computed(),
            f: t.output("f").about("what is taken off the value").computed(),
            vt: t
                .parameter("vt")
                .about("velocity over which friction changes its sign")
                .min(1e-12)
                .nominal(0.001)
                .real(0.001),
            v0: t.parameter("v0").about("velocity at which friction changes its sign").real(0.0),
            sign: t
                .parameter("sign")
                .about("-1 where a larger value makes the velocity fall: f is added then")
                .real(1.0),
            command: Command::declare(t),
            force: Force::declare(t),
        }
    }

    fn initialize<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        self.command.settle(q, q[self.u], q[self.x]);
        Ok(())
    }

    fn equations<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        let v = q[self.v];
        let w = v - q[self.v0];
        let s = (w / q[self.vt]).tanh();
        let point = Point { x: q[self.x], v, w, s, load: q[self.load], p: q[self.p] };
        let passed = self.command.passed(q, q[self.u], point.x);
        self.force.rate(q, &point);
        let f = self.force.total(q, &point);
        q[self.f] = f;
        q[self.y] = passed - q[self.sign] * f;
        Ok(())
    }

    /// Inside of the end stop, with lag and mode and without, so that the dependencies show.
    fn probe(&self, draw: usize, table: &Table, q: &mut Values<f64>) {
        table.spread(draw, q);
        self.force.probe(q);
        self.command.probe(q, draw);
    }
}
