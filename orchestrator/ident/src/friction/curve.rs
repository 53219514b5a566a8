//! The friction curve over velocity, with its 95 % band.

use super::fit::Fit;
use super::law::{Parameters, SIZE};

/// A point of the curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Velocity \[m/s\].
    pub velocity: f64,
    /// Friction force \[N\] at position and pressure 0.
    pub force: f64,
    /// Half the width of the 95 % band \[N\] that the uncertainty of the parameters leaves; 0 if it is not known.
    pub half_width: f64,
}

/// Points between two velocities \[m/s\], dense about the sign change.
pub fn points(fit: &Fit, from: f64, to: f64, count: usize) -> Vec<Point> {
    let c3 = fit.parameters[super::law::C3];
    let reach = (to - c3).abs().max((from - c3).abs());
    let last = count.max(3) - 1;
    let velocities = (0..=last).map(|k| {
        let share = 2.0 * k as f64 / last as f64 - 1.0;
        c3 + reach * share * share * share
    });
    velocities.filter(|v| (from..=to).contains(v)).map(|v| point(fit, v)).collect()
}

fn point(fit: &Fit, velocity: f64) -> Point {
    let at = |c: &Parameters| fit.law.force(c, velocity, 0.0, 0.0);
    let c = &fit.parameters;
    let mut half_width = 0.0;
    if let Some(covariance) = &fit.covariance {
        // Linear propagation with central differences of one hundredth of a standard deviation.
        let slopes: [f64; SIZE] = std::array::from_fn(|j| {
            let step = 0.01 * covariance[(j, j)].sqrt();
            if step == 0.0 {
                return 0.0;
            }
            let moved = |by: f64| {
                let mut moved = *c;
                moved[j] += by;
                at(&moved)
            };
            (moved(step) - moved(-step)) / (2.0 * step)
        });
        let mut variance = 0.0;
        for i in 0..SIZE {
            for j in 0..SIZE {
                variance += slopes[i] * covariance[(i, j)] * slopes[j];
            }
        }
        half_width = 1.96 * variance.max(0.0).sqrt();
    }
    Point { velocity, force: at(c), half_width }
}
