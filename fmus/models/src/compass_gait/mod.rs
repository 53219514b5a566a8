//! Planar walker with two telescopic legs and a bisecting trunk (paper sections III.C and IV.C, eq. 1, 3).
//!
//! [`body`] has the rigid-body terms, [`contact`] motion and impact with feet on the ground, [`events`] when the mode
//! changes, [`variables`] the table. This module ties them together.

mod body;
mod contact;
mod events;
mod feet;
mod ldl;
#[cfg(test)]
mod tests;
mod variables;

use contact::Mechanics;
use fmi_export::{Event, Identity, Model, Outcome, Scalar, Table, Values};
use variables::Variables;

/// Compass gait on flat ground with point feet: hip torque and toe forces to motion, contact forces and impacts; the
/// equations stand in the README of the FMU.
///
/// | name | unit | meaning |
/// |---|---|---|
/// | `tau`, `F1`, `F2` | N m, N | hip torque, toe forces that extend the legs |
/// | `x`, `y`, `th1`, `th2`, `l1`, `l2` | m, rad | hip, leg angles, leg lengths; rates and accelerations follow |
/// | `foot1.ft`, `foot1.fn` ... | N | force of the ground |
/// | `mode` | | feet on the ground |
/// | `after.vx` ... | m/s, rad/s | velocities after the impact that `impact_map` asks for |
pub struct CompassGait {
    k: Variables,
}

impl Model for CompassGait {
    const IDENTITY: Identity = Identity {
        model_identifier: "compass_gait",
        model_name: "compass-gait",
        description: "Compass gait: planar walker with telescopic legs, contacts and impacts",
        version: crate::VERSION,
        author: crate::AUTHOR,
        generation_tool: crate::GENERATION_TOOL,
        stop_time: 1.0,
        step_size: 0.001,
    };

    fn declare(t: &mut Table) -> Self {
        Self { k: Variables::declare(t) }
    }

    /// The mode at the start follows from heights and velocities of the feet.
    fn initialize<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        events::initialize(&self.k, q)
    }

    fn equations<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        let k = &self.k;
        let (pose, down) = (k.pose(q), k.feet_down(q));
        let mechanics = Mechanics::new(k.body(q), pose)?;
        let (accelerations, forces) = mechanics.motion(k.inputs.map(|h| q[h]), down)?;
        let (after, impulses) = mechanics.impact(k.mapped_feet(q))?;
        for i in 0..6 {
            (q[k.der_q[i]], q[k.der_v[i]], q[k.after[i]]) = (pose.v[i], accelerations[i], after[i]);
        }
        for (i, foot) in k.feet.iter().enumerate() {
            let (position, velocity) = (pose.foot(i), pose.foot_rate(i, &pose.v));
            let (driven, drift) = (pose.foot_rate(i, &accelerations), pose.foot_drift(i));
            for row in 0..2 {
                q[foot.position[row]] = position[row];
                q[foot.velocity[row]] = velocity[row];
                q[foot.acceleration[row]] = driven[row] + drift[row];
                q[foot.force[row]] = forces[i][row];
                q[foot.impulse[row]] = impulses[i][row];
                q[foot.last_impulse[row]] = q[k.memory.impulses.at(2 * i + row)];
            }
            q[foot.slides] = q[k.memory.slides.at(i)].value() > 0.0;
        }
        q[k.mode] = down.number() + 1;
        q[k.fallen] = q[k.memory.fallen.at(0)].value() > 0.0;
        q[k.energy] = mechanics.energy;
        q[k.last_impact_time] = q[k.memory.impacts.at(0)];
        q[k.impacts] = q[k.memory.impacts.at(1)].value() as i32;
        Ok(())
    }

    fn event_indicators(&self, q: &Values<f64>, indicators: &mut [f64]) {
        events::indicators(&self.k, q, indicators);
    }

    fn event(&self, q: &mut Values<f64>) -> Event {
        events::handle(&self.k, q)
    }

    fn explain_event(&self, q: &Values<f64>) -> Option<String> {
        events::explain(&self.k, q)
    }

    /// The first event looks at the start: a foot may come down at once, or be pulled up. So does one where an input
    /// jumped.
    fn next_event_time(&self, q: &Values<f64>) -> Option<f64> {
        events::pending(&self.k, q).then_some(q.time)
    }

    /// Draws in all modes, one of them with events and foot 1 at rest on the ground.
    fn probe(&self, draw: usize, table: &Table, q: &mut Values<f64>) {
        table.spread(draw, q);
        let k = &self.k;
        // Legs of some 1 m in general position, both feet above the ground.
        for i in 0..6 {
            let wave = (1.0 + 2.3 * i as f64 + 1.7 * draw as f64).sin();
            q[k.q[i]] = [0.3, 1.6, 0.1, -0.2, 1.0, 0.95][i] + 0.1 * wave;
            q[k.v[i]] = 0.5 * (1.3 * wave).cos() * [1.0, -1.0][(i + draw) % 2];
        }
        q[k.contact_mode] = [5, 2, 1, 4][draw % 4];
        q[k.impact_map] = [1, 4, 2, 3][draw % 4];
        if draw % 4 == 2 {
            let pose = k.pose(q);
            let [_, height] = pose.foot(0);
            let [vx, vy] = pose.foot_rate(0, &pose.v);
            q[k.q[1]] -= height;
            q[k.q[3]] = 1.2;
            q[k.v[0]] -= vx;
            q[k.v[1]] -= vy;
        }
    }
}
