//! Dynamics with the structure of others and arbitrary numbers, from which the pattern of a program is read: what is
//! zero for these numbers is zero for all.

use super::dynamics::{Dynamics, Entry, Point, Size, Structure};
use airloop_optim::EvaluationError;

pub(super) struct Probe {
    structure: Structure,
    size: Size,
    state: u64,
}

impl Probe {
    pub fn new(dynamics: &dyn Dynamics) -> Probe {
        Probe { structure: dynamics.structure().clone(), size: dynamics.size(), state: 0x9E37_79B9_7F4A_7C15 }
    }

    /// A number between 0.5 and 1.5.
    pub fn number(&mut self) -> f64 {
        self.state ^= self.state << 13;
        self.state ^= self.state >> 7;
        self.state ^= self.state << 17;
        0.5 + (self.state >> 11) as f64 / (1u64 << 53) as f64
    }
}

impl Dynamics for Probe {
    fn size(&self) -> Size {
        self.size
    }

    fn structure(&self) -> &Structure {
        &self.structure
    }

    fn names(&self) -> Vec<String> {
        vec![String::new(); self.size.arguments() + self.size.outputs]
    }

    fn evaluate(&mut self, _: Point<'_>, values: &mut [f64]) -> Result<(), EvaluationError> {
        values.iter_mut().for_each(|value| *value = self.number());
        Ok(())
    }

    fn jacobian(
        &mut self,
        at: Point<'_>,
        values: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError> {
        self.evaluate(at, values)?;
        let na = self.size.arguments();
        for (i, entry) in jacobian.iter_mut().enumerate() {
            let there = self.structure.entry(i / na, i % na) != Entry::Zero;
            *entry = if there { self.number() } else { 0.0 };
        }
        Ok(())
    }

    fn hessian(&mut self, _: Point<'_>, weights: &[f64], hessian: &mut [f64]) -> Result<(), EvaluationError> {
        let na = self.size.arguments();
        hessian.fill(0.0);
        for value in (0..self.size.values()).filter(|&value| weights[value] != 0.0) {
            let varies = |a: usize| self.structure.entry(value, a) == Entry::Varying;
            let varying: Vec<usize> = (0..na).filter(|&a| varies(a)).collect();
            for &a in &varying {
                for &b in varying.iter().filter(|&&b| b <= a) {
                    let number = self.number();
                    hessian[a * na + b] += number;
                    hessian[b * na + a] += if a == b { 0.0 } else { number };
                }
            }
        }
        Ok(())
    }

    fn duplicate(&self) -> Result<Box<dyn Dynamics>, EvaluationError> {
        Ok(Box::new(Probe { structure: self.structure.clone(), size: self.size, state: self.state }))
    }
}
