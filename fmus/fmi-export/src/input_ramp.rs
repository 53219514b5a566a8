//! Inputs between communication points: polynomials from the derivatives that the master gave.

use crate::instance::MAX_INPUT_ORDER;
use crate::values::{Real, Values};

/// Value of the input polynomial after `elapsed` s.
fn value_at(base: f64, rates: &[f64], n: usize, i: usize, elapsed: f64) -> f64 {
    let mut value = base;
    let mut power = 1.0;
    for order in 0..MAX_INPUT_ORDER {
        power *= elapsed / (order + 1) as f64;
        value += rates[order * n + i] * power;
    }
    value
}

/// Slope of the input polynomial after `elapsed` s.
pub(crate) fn slope_at(rates: &[f64], n: usize, i: usize, elapsed: f64) -> f64 {
    let mut power = 1.0;
    let mut slope = 0.0;
    for order in 0..MAX_INPUT_ORDER {
        slope += rates[order * n + i] * power;
        power *= elapsed / (order + 1) as f64;
    }
    slope
}

/// Puts every input where its polynomial is after `elapsed` s.
pub(crate) fn set_inputs(
    values: &mut Values<f64>,
    inputs: &[Real],
    base: &[f64],
    rates: &[f64],
    n: usize,
    elapsed: f64,
) {
    for (i, input) in inputs.iter().enumerate() {
        values[*input] = value_at(base[i], rates, n, i, elapsed);
    }
}
