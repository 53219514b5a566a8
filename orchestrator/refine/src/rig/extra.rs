//! A law at the cart or at the pole that the vocabulary does not have: a free form, or a formula.

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

/// A law and where it acts.
#[derive(Debug, Clone)]
pub struct Extra {
    /// A torque on the pole; else a force on the cart.
    pub pole: bool,
    /// Law.
    pub form: Form,
}

impl Extra {
    /// Force \[N\] or torque \[N m\] that is taken off, at a position and velocity.
    pub fn value(&self, p: &[f64], position: f64, velocity: f64) -> f64 {
        match &self.form {
            Form::Surface(surface) => surface.value(p, &Point { position, velocity, ..Point::default() }),
            Form::Formula(own) => own.value([position, velocity, 0.0, 0.0], &[], p),
        }
    }
}
