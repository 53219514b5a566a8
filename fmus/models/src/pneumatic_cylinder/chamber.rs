//! One chamber of the cylinder: pressure from mass flow, leak and motion.

use super::orifice::Air;
use fmi_export::Scalar;

/// Heat-transfer exponents (Richer and Hurmuzlu): inflow, outflow, volume work.
#[derive(Clone, Copy)]
pub struct Exponents<S> {
    /// Of inflow.
    pub inflow: S,
    /// Of outflow, and of the leak.
    pub outflow: S,
    /// Of the work of the volume.
    pub work: S,
}

/// A chamber at one moment.
#[derive(Clone, Copy)]
pub struct Chamber<S> {
    /// Pressure \[Pa\].
    pub p: S,
    /// Volume \[m³\].
    pub volume: S,
    /// Rate of the volume \[m³/s\].
    pub volume_rate: S,
    /// Mass flow that arrives through the tube \[kg/s\].
    pub inflow: S,
    /// Mass flow that leaves through the piston's seal \[kg/s\].
    pub leak: S,
}

impl<S: Scalar> Chamber<S> {
    /// `p' = (R T (a md - kout leak) - kv p V') / V`, `a = kin` for inflow, else `kout` \[Pa/s\].
    pub fn pressure_rate(self, air: Air<S>, k: Exponents<S>) -> S {
        let a = if self.inflow.value() > 0.0 { k.inflow } else { k.outflow };
        let filling = air.rt * (a * self.inflow - k.outflow * self.leak);
        (filling - k.work * self.p * self.volume_rate) / self.volume
    }
}
