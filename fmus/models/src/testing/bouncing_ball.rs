//! A ball that bounces and comes to rest: state events, reinitialized states, early termination.

use fmi_export::{Boolean, Event, Identity, MemoryBlock, Model, Outcome, Real, Scalar, Table, Values};

/// `dh/dt = v`, `dv/dt = -g`; at `h <= 0`: `v+ = -e v-`, at rest once `v+ < v_min`.
pub struct BouncingBall {
    h: Real,
    v: Real,
    der_h: Real,
    der_v: Real,
    at_rest: Boolean,
    g: Real,
    e: Real,
    v_min: Real,
    stop_at_rest: Boolean,
    /// 1 at rest.
    resting: MemoryBlock,
}

impl Model for BouncingBall {
    const IDENTITY: Identity = Identity {
        model_identifier: "test_bouncing_ball",
        model_name: "test-bouncing-ball",
        description: "Test FMU: a ball that bounces and comes to rest",
        version: crate::VERSION,
        author: crate::AUTHOR,
        generation_tool: crate::GENERATION_TOOL,
        stop_time: 3.0,
        step_size: 0.01,
    };

    fn declare(t: &mut Table) -> Self {
        let h = t.state("h").unit("m").about("height").output().reinit().real(1.0);
        let v = t.state("v").unit("m/s").about("velocity").output().reinit().real(0.0);
        t.event_indicators(1);
        Self {
            h,
            v,
            der_h: t.derivative("der(h)", h).unit("m/s").about("rate of h").computed(),
            der_v: t.derivative("der(v)", v).unit("m/s2").about("rate of v").computed(),
            at_rest: t.output("at_rest").about("true once the ball lies").computed_boolean(),
            g: t.parameter("g").unit("m/s2").about("gravity").min(0.0).real(9.81),
            e: t.parameter("e").about("coefficient of restitution").range(0.0, 1.0).real(0.7),
            v_min: t.parameter("v_min").unit("m/s").about("slower bounces end").min(0.0).real(0.1),
            stop_at_rest: t
                .parameter("stop_at_rest")
                .about("end the simulation when the ball comes to rest")
                .boolean(false),
            resting: t.memory(1),
        }
    }

    fn equations<S: Scalar>(&self, q: &mut Values<S>) -> Outcome {
        let resting = q[self.resting.at(0)].value() > 0.0;
        q[self.der_h] = q[self.v];
        q[self.der_v] = if resting { S::zero() } else { -q[self.g] };
        q[self.at_rest] = resting;
        Ok(())
    }

    fn event_indicators(&self, q: &Values<f64>, indicators: &mut [f64]) {
        indicators[0] = if q[self.resting.at(0)] > 0.0 { 1.0 } else { q[self.h] };
    }

    fn event(&self, q: &mut Values<f64>) -> Event {
        if q[self.resting.at(0)] > 0.0 || q[self.h] > 0.0 || q[self.v] >= 0.0 {
            return Event::default();
        }
        // Not 0: the indicator has to be on the upper side again.
        q[self.h] = f64::MIN_POSITIVE;
        q[self.v] *= -q[self.e];
        let comes_to_rest = q[self.v] < q[self.v_min];
        if comes_to_rest {
            q[self.v] = 0.0;
            q[self.resting.at(0)] = 1.0;
        }
        Event { states_changed: true, iterate: false, terminate: comes_to_rest && q[self.stop_at_rest] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmi_export::Interface;

    #[test]
    fn impact_reverses_the_velocity_and_a_slow_one_ends_the_motion() {
        let (m, table) = Table::of::<BouncingBall>();
        let mut q = table.start_values(Interface::ModelExchange);
        (q[m.h], q[m.v], q[m.stop_at_rest]) = (-1e-9, -2.0, true);
        assert!(m.event(&mut q).states_changed);
        assert!((q[m.v] - 1.4).abs() < 1e-15 && q[m.h] > 0.0);
        assert_eq!(m.event(&mut q), Event::default());
        (q[m.h], q[m.v]) = (-1e-9, -0.1);
        let event = m.event(&mut q);
        assert!(event.terminate && q[m.v] == 0.0);
        m.equations(&mut q).expect("the ball has equations everywhere");
        assert!(q[m.at_rest] && q[m.der_v] == 0.0);
    }
}
