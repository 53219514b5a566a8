//! Transmission zeros.
//!
//! Zeros are where `[A - z I, B; C, D]` loses rank. With a shift s that is not a zero, `mu = 1/(z - s)` are eigenvalues
//! of an ordinary matrix; zeros at infinity have mu = 0.

use nalgebra::{Complex, DMatrix};

use crate::model::StateSpace;
use airloop_optim::linalg::spectral;

/// A place on the real axis where no zero of a sampled model is expected.
const SHIFT: f64 = -1.618_033_988_7;

/// Transmission zeros of a model: where all outputs together can stay zero though the inputs do not.
///
/// A model with more outputs than inputs, or the other way round, usually has none.
pub fn transmission_zeros(model: &StateSpace) -> Vec<Complex<f64>> {
    let (n_y, n_u) = (model.d.nrows(), model.d.ncols());
    if n_y == n_u {
        return square_zeros(model);
    }
    // Zeros of two unlike square combinations: those that both have belong to the model.
    let weights = |n: usize, m: usize, seed: f64| {
        DMatrix::from_fn(n, m, |i, j| {
            (seed + 1.7 * i as f64 + 2.9 * j as f64).sin() + f64::from(u8::from(i == j))
        })
    };
    let combined = |seed: f64| {
        let mut model = model.clone();
        if n_y > n_u {
            let weights = weights(n_u, n_y, seed);
            (model.c, model.d) = (&weights * &model.c, &weights * &model.d);
        } else {
            let weights = weights(n_u, n_y, seed);
            (model.b, model.d) = (&model.b * &weights, &model.d * &weights);
        }
        square_zeros(&model)
    };
    let (first, second) = (combined(0.3), combined(2.1));
    first.into_iter().filter(|zero| second.iter().any(|other| (zero - other).norm() < 1e-6)).collect()
}

/// Zeros (in the z-plane) of the channel from input `j` to output `i`, both 0-based.
pub fn channel_zeros(model: &StateSpace, i: usize, j: usize) -> Vec<Complex<f64>> {
    square_zeros(&StateSpace {
        b: model.b.columns(j, 1).into_owned(),
        c: model.c.rows(i, 1).into_owned(),
        d: model.d.view((i, j), (1, 1)).into_owned(),
        gain: None,
        ..model.clone()
    })
}

fn square_zeros(model: &StateSpace) -> Vec<Complex<f64>> {
    let (n, m) = (model.a.nrows(), model.d.nrows());
    if n == 0 || m == 0 {
        return Vec::new();
    }
    let mut pencil = DMatrix::zeros(n + m, n + m);
    pencil.view_mut((0, 0), (n, n)).copy_from(&(&model.a - DMatrix::identity(n, n) * SHIFT));
    pencil.view_mut((0, n), (n, m)).copy_from(&model.b);
    pencil.view_mut((n, 0), (m, n)).copy_from(&model.c);
    pencil.view_mut((n, n), (m, m)).copy_from(&model.d);
    let mut weight = DMatrix::zeros(n + m, n + m);
    weight.view_mut((0, 0), (n, n)).fill_with_identity();
    let Some(product) = pencil.lu().solve(&weight) else { return Vec::new() };
    if !product.iter().all(|value| value.is_finite()) {
        return Vec::new();
    }
    let inner = product.view((0, 0), (n, n)).into_owned();
    let mut found: Vec<Complex<f64>> = spectral::eigenvalues(&inner);
    found.sort_by(|a, b| b.norm().total_cmp(&a.norm()).then(b.im.total_cmp(&a.im)));
    found.truncate(finite_zeros(model));
    let size = inner.norm();
    let finite = found.into_iter().filter(|mu| mu.norm() > 1e-9 * size);
    finite.map(|mu| Complex::new(SHIFT, 0.0) + mu.inv()).collect()
}

/// Number of zeros that are not at infinity if the first Markov parameter that is not zero has full rank, as it has in
/// every single channel: `n_x - m d`, d its index.
fn finite_zeros(model: &StateSpace) -> usize {
    let (n, m) = (model.a.nrows(), model.d.nrows());
    let size = model.d.norm() + model.b.norm() * model.c.norm();
    let mut markov = model.d.clone();
    let mut reached = model.b.clone();
    for index in 0..=n {
        if markov.norm() > 1e-12 * size {
            let regular = spectral::singular_values(markov.clone()).min() > 1e-9 * markov.norm();
            return if regular { n.saturating_sub(m * index) } else { n };
        }
        markov = &model.c * &reached;
        reached = &model.a * reached;
    }
    0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Arx, Model};

    fn single(a: &[f64], b: &[f64]) -> StateSpace {
        let scalar = |value: &f64| DMatrix::from_element(1, 1, *value);
        Arx {
            sample_time: 1.0,
            a: a.iter().map(scalar).collect(),
            b: b.iter().map(scalar).collect(),
            input_offset: vec![0.0],
            output_offset: vec![0.0],
        }
        .to_state_space()
    }

    #[test]
    fn zeros_of_a_channel_are_the_roots_of_its_numerator() {
        // z^2 (z^2 - 1.1 z + 0.3) / (..): 0.5, 0.6, and two at 0 for the two samples that a exceeds b by nothing.
        let zeros = channel_zeros(&single(&[-0.9, 0.2], &[2.0, -2.2, 0.6]), 0, 0);
        let mut real: Vec<f64> = zeros.iter().map(|zero| zero.re).collect();
        real.sort_by(f64::total_cmp);
        assert_eq!(real.len(), 2);
        assert!((real[0] - 0.5).abs() < 1e-9 && (real[1] - 0.6).abs() < 1e-9, "{real:?}");
    }

    #[test]
    fn a_delay_leaves_no_large_spurious_zeros() {
        let zeros = channel_zeros(&single(&[-0.9], &[0.0, 0.0, 0.0, 0.0, 1.0, -0.7]), 0, 0);
        assert_eq!(zeros.len(), 1, "{zeros:?}");
        assert!((zeros[0].re - 0.7).abs() < 1e-8);
    }

    #[test]
    fn transmission_zeros_of_several_channels() {
        // diag((z - 0.5)/(z - 0.9), (z - 0.2)/(z - 0.3)) mixed by a regular matrix: zeros 0.5 and 0.2.
        let mix = DMatrix::from_row_slice(2, 2, &[1.0, 0.4, -0.3, 1.0]);
        let model = StateSpace {
            sample_time: 1.0,
            a: DMatrix::from_row_slice(2, 2, &[0.9, 0.0, 0.0, 0.3]),
            b: DMatrix::from_row_slice(2, 2, &[0.4, 0.0, 0.0, 0.1]),
            c: mix.clone(),
            d: mix,
            gain: None,
            input_offset: vec![0.0; 2],
            output_offset: vec![0.0; 2],
        };
        let mut zeros: Vec<f64> = transmission_zeros(&model).iter().map(|zero| zero.re).collect();
        zeros.sort_by(f64::total_cmp);
        assert!((zeros[0] - 0.2).abs() < 1e-9 && (zeros[1] - 0.5).abs() < 1e-9, "{zeros:?}");
        // One input alone reaches both outputs: no common zero.
        let tall = StateSpace {
            b: model.b.columns(0, 1).into_owned(),
            d: model.d.columns(0, 1).into_owned(),
            input_offset: vec![0.0],
            ..model
        };
        let zeros: Vec<f64> = transmission_zeros(&tall).iter().map(|zero| zero.re).collect();
        // The mode at 0.3 is not reached, which the pencil sees as a zero; 0.5 is common to both outputs.
        assert!(zeros.iter().any(|zero| (zero - 0.5).abs() < 1e-6), "{zeros:?}");
    }
}
