//! Further forces on a sliding part, as a block in series on the way of its driving force.
//!
//! One module per effect; each holds its parameters and gives its force, which the block takes off the driving force.

mod area;
mod asymmetry;
mod cogging;
mod coulomb;
mod end_stop;
mod presliding;
mod spring;
mod stribeck;
#[cfg(test)]
mod tests;
mod tilt;
mod viscous;

use fmi_export::{Identity, Model, Outcome, Real, Scalar, Table, Values};

use area::Area;
use asymmetry::Asymmetry;
use cogging::Cogging;
use coulomb::Coulomb;
use end_stop::EndStop;
use presliding::Presliding;
use spring::Spring;
use stribeck::Stribeck;
use tilt::Tilt;
use viscous::Viscous;

/// Variables that the forces depend on.
#[derive(Clone, Copy, Debug)]
struct Motion<S> {
    /// Position \[m\] and velocity \[m/s\].
    x: S,
    v: S,
    /// Velocity from that of the sign change \[m/s\]: `v - c3`.
    w: S,
    /// Smooth sign of the velocity: `tanh(c2 (v - c3))`, the factor of the declared Coulomb friction.
    s: S,
    /// Force of the pressure difference \[N\].
    pressure_force: S,
    /// Pressure of a chamber \[Pa\].
    p: S,
}

/// `F_out = F_in - f`, `f` the sum of the effects that are switched on.
///
/// | name | unit | meaning |
/// |---|---|---|
/// | `F_in`, `F_out` | N | force before and after |
/// | `x`, `v` | m, m/s | position and velocity of the sliding part |
/// | `F_hat` | N | force of the pressure difference, for friction that grows with it |
/// | `p` | Pa | pressure of a chamber, for an error of the effective area |
/// | `f` | N | force of the effects |
/// | `c1`, `c2`, `c3` | N, s/m, m/s | declared Coulomb friction: its level, slope and place of the sign change |
#[allow(non_snake_case)]
pub struct ForceEffect {
    F_in: Real,
    x: Real,
    v: Real,
    F_hat: Real,
    p: Real,
    F_out: Real,
    f: Real,
    c: [Real; 3],
    viscous: Viscous,
    coulomb: Coulomb,
    stribeck: Stribeck,
    asymmetry: Asymmetry,
    presliding: Presliding,
    area: Area,
    spring: Spring,
    end_stop: EndStop,
    cogging: Cogging,
    tilt: Tilt,
}

impl Model for ForceEffect {
    const IDENTITY: Identity = Identity {
        model_identifier: "force_effect",
        model_name: "force-effect",
        description: "Forces that a declared model lacks, in series: F_out = F_in - f",
        version: crate::VERSION,
        author: crate::AUTHOR,
        generation_tool: crate::GENERATION_TOOL,
        stop_time: 1.0,
        step_size: 0.001,
    };

    fn declare(t: &mut Table) -> Self {
        Self {
            F_in: t.input("F_in").unit("N").about("driving force").nominal(10.0).real(0.0),
            x: t.input("x").unit("m").about("position of the sliding part").nominal(0.1).real(0.0),
            v: t.input("v").unit("m/s").about("velocity of the sliding part").nominal(0.1).real(0.0),
            F_hat: t
                .input("F_hat")
                .unit("N")
                .about("force of the pressure difference")
                .nominal(10.0)
                .real(0.0),
            p: t.input("p").unit("Pa").about("pressure of a chamber").nominal(1e5).real(0.0),
            F_out: t
                .output("F_out")
                .unit("N")
                .about("driving force less that of the effects")
                .nominal(10.0)
                .computed(),
            f: t.output("f").unit("N").about("force of the effects").nominal(10.0).computed(),
            c: [
                t.parameter("c1").unit("N").about("declared Coulomb friction, for presliding").real(0.0),
                t.parameter("c2").unit("s/m").about("slope of the sign change").nominal(50.0).real(1000.0),
                t.parameter("c3").unit("m/s").about("velocity of the sign change").nominal(0.01).real(0.0),
            ],
            viscous: Viscous::declare(t),
            coulomb: Coulomb::declare(t),
            stribeck: Stribeck::declare(t),
            asymmetry: Asymmetry::declare(t),
            presliding: Presliding::declare(t),
            area: Area::declare(t),
            spring: Spring::declare(t),
            end_stop: EndStop::declare(t),
            cogging: Cogging::declare(t),
            tilt: Tilt::declare(t),
        }
    }

    fn equations<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        let [c1, c2, c3] = self.c.map(|c| q[c]);
        let w = q[self.v] - c3;
        let motion = Motion {
            x: q[self.x],
            v: q[self.v],
            w,
            s: (c2 * w).tanh(),
            pressure_force: q[self.F_hat],
            p: q[self.p],
        };
        self.presliding.rate(q, &motion);
        let f = self.viscous.force(q, &motion)
            + self.coulomb.force(q, &motion)
            + self.stribeck.force(q, &motion)
            + self.asymmetry.force(q, &motion)
            + self.presliding.force(q, &motion, c1)
            + self.area.force(q, &motion)
            + self.spring.force(q, &motion)
            + self.end_stop.force(q, &motion)
            + self.cogging.force(q, &motion)
            + self.tilt.force(q);
        q[self.f] = f;
        q[self.F_out] = q[self.F_in] - f;
        Ok(())
    }

    /// Inside the end stop, so that its dependencies show.
    fn probe(&self, draw: usize, table: &Table, q: &mut Values<f64>) {
        table.spread(draw, q);
        self.end_stop.probe(q);
    }
}
