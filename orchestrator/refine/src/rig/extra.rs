//! A law that the vocabulary does not have, at a place of the rig: a free form, or a formula.

use std::sync::Arc;

use crate::law::surface::Surface;
use crate::study::law::Point;
use crate::vocabulary::Own;

/// Form of a law; its parameters stand behind those of the rig.
#[derive(Debug, Clone)]
pub enum Form {
    /// Heights of a free form.
    Surface(Surface),
    /// A formula without states.
    Formula(Arc<Own>),
}

/// Where a law takes something off.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// The force command that arrives at the actuator.
    Command,
    /// The force of the actuator, in the pressures and on the piston.
    Force,
    /// The force between piston and load cell.
    Piston,
    /// The force on the cart, behind the load cell.
    Cart,
    /// The torque on the pole.
    Pole,
}

impl Place {
    /// All of them, in the order of the way of the force.
    pub const ALL: [Place; 5] = [Place::Command, Place::Force, Place::Piston, Place::Cart, Place::Pole];

    /// Input of the system where the block of the law stands.
    pub fn port(self) -> &'static str {
        match self {
            Place::Command => "actuator.u",
            Place::Force => "piston_friction.F_in",
            Place::Piston => "piston_friction.F_out",
            Place::Cart => "cart_pole.F",
            Place::Pole => "cart_pole.tau_ext",
        }
    }

    /// The place of an input.
    pub fn at(port: &str) -> Option<Place> {
        Place::ALL.into_iter().find(|place| place.port() == port)
    }
}

/// A law and where it acts.
#[derive(Debug, Clone)]
pub struct Extra {
    /// Place.
    pub place: Place,
    /// Law.
    pub form: Form,
}

impl Extra {
    /// Force \[N\] or torque \[N m\] that is taken off at a point; `p`: parameters of the law.
    pub fn value(&self, p: &[f64], point: &Point) -> f64 {
        match &self.form {
            Form::Surface(surface) => surface.value(p, point),
            Form::Formula(own) => own.value(point.variables(), &[], p),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::case::Actuator;
    use crate::engine::System;
    use crate::rig::coupled::Coupled;
    use crate::rig::parameters::{PF_OFFSET, neutral};
    use crate::rig::testing::rig;
    use crate::study::law::Variable;

    const N: usize = 600;

    /// Predictions of a rig with a force of 0.5 N from 0.3 s on that is taken off at a place.
    fn with_step(place: Option<Place>, p: &[f64]) -> Vec<Vec<f64>> {
        let actuator =
            Actuator { sample_time: 1e-3, A1: [[-0.9, 0.0], [0.0, -0.95]], B0: [0.1, 0.05], B1: [0.0; 2] };
        let noises = [("F_hat", 0.3), ("F_p", 0.3), ("x", 1e-4), ("theta", 5e-4)];
        let own = rig(actuator, N, &noises, &[]);
        // Knots close together on both sides, as slopes of the curve reach over one knot.
        let knots = vec![vec![0.0, 0.297, 0.298, 0.299, 0.3, 0.301, 0.302, 0.6]];
        let surface = Surface::new(vec![Variable::Time], knots);
        let extra = place.map(|place| Arc::new(Extra { place, form: Form::Surface(surface) }));
        let heights = if extra.is_some() { vec![0.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.5, 0.5] } else { Vec::new() };
        let own = Coupled { extra, ..own };
        let found = own.predict(0, &[p, &heights].concat(), &[0.0, 0.0]);
        found.chunks(N).map(<[f64]>::to_vec).collect()
    }

    #[test]
    fn a_law_in_time_is_taken_off_where_it_acts() {
        let without = with_step(None, &neutral());
        // Signals in front of the place do not feel it before the motion does.
        for (place, first) in [(Place::Force, 0), (Place::Piston, 1), (Place::Cart, 2), (Place::Pole, 2)] {
            let with = with_step(Some(place), &neutral());
            for signal in 0..4 {
                let change = |k: usize| with[signal][k] - without[signal][k];
                assert!((0..290).all(|k| change(k).abs() < 1e-9), "{place:?} {signal}");
                let at_once = (change(301) + 0.5).abs() < 0.06;
                assert_eq!(at_once, signal < 2 && signal >= first, "{place:?} {signal} {}", change(301));
            }
        }
        let command = with_step(Some(Place::Command), &neutral());
        // The steady gain of the pressure force is 0.1 / (1 - 0.9).
        assert!((command[0][N - 1] - without[0][N - 1] + 0.5).abs() < 1e-3);
    }

    #[test]
    fn a_constant_force_at_the_piston_is_its_offset() {
        let mut offset = neutral();
        offset[PF_OFFSET] = 0.5;
        let [with, without] = [with_step(Some(Place::Piston), &neutral()), with_step(None, &offset)];
        let base = with_step(None, &neutral());
        let shift = |own: &[Vec<f64>], k: usize| own[1][k] - base[1][k];
        assert!((shift(&with, 301) - shift(&without, 0)).abs() < 0.06);
    }

    #[test]
    fn every_place_has_its_own_port() {
        assert!(Place::ALL.iter().all(|place| Place::at(place.port()) == Some(*place)));
        assert_eq!(Place::at("actuator.F"), None);
    }
}
