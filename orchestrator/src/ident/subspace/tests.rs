//! Answers from known systems.

use nalgebra::{DMatrix, DVector};

use super::*;

/// Deterministic white-like values in -1..1.
fn noise(seed: u64, n: usize) -> Vec<f64> {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    (0..n)
        .map(|_| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        })
        .collect()
}

/// Two inputs, two outputs, four states: an oscillator and two lags, with direct term.
fn truth() -> StateSpace {
    StateSpace {
        sample_time: 0.01,
        a: DMatrix::from_row_slice(
            4,
            4,
            &[0.8, 0.4, 0.0, 0.1, -0.4, 0.8, 0.0, 0.0, 0.1, 0.0, 0.6, 0.2, 0.0, 0.0, 0.0, -0.3],
        ),
        b: DMatrix::from_row_slice(4, 2, &[1.0, 0.2, 0.3, -0.5, 0.0, 1.0, 0.7, 0.4]),
        c: DMatrix::from_row_slice(2, 4, &[1.0, 0.0, 0.5, 0.2, 0.0, 3.0, -1.0, 1.0]),
        d: DMatrix::from_row_slice(2, 2, &[0.5, 0.0, -0.2, 0.1]),
        gain: None,
        input_offset: vec![1.0, -2.0],
        output_offset: vec![0.5, 10.0],
    }
}

fn records(model: &StateSpace, lengths: &[usize]) -> Vec<Record> {
    let record = |(index, &n): (usize, &usize)| {
        let seed = 100 * index as u64 + 7;
        let inputs: Vec<Vec<f64>> = (0..model.n_u())
            .map(|j| noise(seed + j as u64, n).iter().map(|u| u + model.input_offset[j]).collect())
            .collect();
        let x0 = DVector::from_vec(noise(seed + 50, model.order()));
        let outputs = model.simulate_from(&x0, &inputs);
        Record { name: format!("r{index}"), sample_time: 0.01, start: 0.0, inputs, outputs }
    };
    lengths.iter().enumerate().map(record).collect()
}

fn options(order: Order) -> Options {
    Options::new(order, &truth().input_offset, &truth().output_offset)
}

/// D, CB, CAB, ..
fn markov(model: &StateSpace, n: usize) -> Vec<DMatrix<f64>> {
    let mut found = vec![model.d.clone()];
    let mut power = model.b.clone();
    for _ in 1..n {
        found.push(&model.c * &power);
        power = &model.a * power;
    }
    found
}

#[test]
fn a_system_with_direct_term_comes_back_from_several_records_without_noise() {
    let records = records(&truth(), &[400, 300, 250]);
    for weighting in Weighting::ALL {
        let options = Options { weightings: vec![weighting], ..options(Order::Fixed(4)) };
        let found = estimate(&records, &options).unwrap();
        for (k, (found, expected)) in markov(&found.model, 30).iter().zip(markov(&truth(), 30)).enumerate() {
            assert!(
                (found - &expected).amax() < 1e-8,
                "{weighting:?}, Markov parameter {k}: {found} {expected}"
            );
        }
        assert!(found.warnings.is_empty(), "{:?}", found.warnings);
    }
}
