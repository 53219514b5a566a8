//! A force that repeats along the guide: teeth of a belt, magnets of a linear motor.

use fmi_export::{Real, Scalar, Table, Values};

use super::Motion;

/// `f = amp sin(2 pi x/period + phase)`
pub struct Cogging {
    amp: Real,
    period: Real,
    phase: Real,
}

impl Cogging {
    pub fn declare(t: &mut Table) -> Self {
        Self {
            amp: t.parameter("cogging_amp").unit("N").about("amplitude of the cogging").real(0.0),
            period: t
                .parameter("cogging_period")
                .unit("m")
                .about("period of the cogging")
                .min(1e-6)
                .real(0.03),
            phase: t.parameter("cogging_phase").unit("rad").about("phase of the cogging at x = 0").real(0.0),
        }
    }

    pub fn force<S: Scalar>(&self, q: &Values<S>, motion: &Motion<S>) -> S {
        let angle = motion.x * std::f64::consts::TAU / q[self.period] + q[self.phase];
        q[self.amp] * angle.sin()
    }
}
