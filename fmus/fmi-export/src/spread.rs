//! Points in general position over the ranges of the variables, at which dependencies are looked for.

use crate::table::{Causality, Kind, Table};
use crate::values::Values;

impl Table {
    /// Spreads every settable number over its range, differently for each draw; the same for equal draws.
    ///
    /// Used to find dependencies, so the points must be in general position, not random.
    pub fn spread(&self, draw: usize, v: &mut Values<f64>) {
        let mut sequence = Sequence::new(draw);
        for variable in self.variables().iter().filter(|v| !v.is_computed() || v.is_state) {
            let r = sequence.next();
            match variable.kind {
                Kind::Real { handle, start, min, max, nominal, .. } => {
                    let scale = nominal.unwrap_or(1.0).abs();
                    let start = start.unwrap_or(0.0);
                    let free = if variable.causality == Causality::Parameter {
                        start * (1.0 + 0.4 * r) + if start == 0.0 { 0.3 * scale * r } else { 0.0 }
                    } else {
                        start + scale * r * [1.0, 0.1, 10.0][draw % 3]
                    };
                    let (low, high) = (min.unwrap_or(f64::MIN), max.unwrap_or(f64::MAX));
                    v[handle] = if free < low || free > high {
                        // Inside the range, never on its border.
                        match (min, max) {
                            (Some(a), Some(b)) => a + (b - a) * (0.5 + 0.45 * r),
                            (Some(a), None) => a + scale * (1.1 + r),
                            _ => high - scale * (1.1 + r),
                        }
                    } else {
                        free
                    };
                }
                Kind::Integer { handle, min: Some(a), max: Some(b), .. } => {
                    let span = f64::from(b) - f64::from(a) + 1.0;
                    v[handle] = (f64::from(a) + (span * (r + 1.0) / 2.0).floor()).min(f64::from(b)) as i32;
                }
                Kind::Integer { handle, .. } => v[handle] = (r * 10.0) as i32,
                Kind::Enumeration { handle, enumeration, .. } => {
                    let n = self.enumerations()[enumeration].items.len();
                    v[handle] = 1 + ((draw + handle.0 as usize) % n) as i32;
                }
                Kind::Boolean { handle, .. } => v[handle] = r > 0.0,
                Kind::Text { .. } => {}
            }
        }
    }
}

/// A deterministic sequence in (-1, 1) in general position (additive recurrence of the golden ratio).
struct Sequence(f64);

impl Sequence {
    fn new(draw: usize) -> Self {
        Self(0.5 + draw as f64 * std::f64::consts::SQRT_2)
    }

    fn next(&mut self) -> f64 {
        self.0 += 0.618_033_988_749_894_9;
        2.0 * self.0.fract() - 1.0
    }
}
