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

#[test]
fn a_system_with_direct_term_comes_back_from_several_records_without_noise() {
    let records = records(&truth(), &[400, 300, 250]);
    for weighting in Weighting::ALL {
        let options = Options { weightings: vec![weighting], ..options(Order::Fixed(4)) };
        let found = estimate(&records, &options).unwrap();
        for (k, (found, expected)) in
            found.model.markov_parameters(30).iter().zip(truth().markov_parameters(30)).enumerate()
        {
            assert!(
                (found - &expected).amax() < 1e-8,
                "{weighting:?}, Markov parameter {k}: {found} {expected}"
            );
        }
        assert!(found.warnings.is_empty(), "{:?}", found.warnings);
    }
}

#[test]
fn the_smallest_order_that_is_enough_is_found() {
    let mut records = records(&truth(), &[1500, 1500]);
    let estimate_it = |records: &[Record]| estimate(records, &options(Order::UpTo(7))).unwrap();
    assert_eq!(estimate_it(&records).model.order(), 4);
    for (index, record) in records.iter_mut().enumerate() {
        for (i, y) in record.outputs.iter_mut().enumerate() {
            let e = noise(1000 + 10 * index as u64 + i as u64, y.len());
            y.iter_mut().zip(e).for_each(|(y, e)| *y += 0.3 * e);
        }
    }
    let found = estimate_it(&records);
    assert_eq!(found.model.order(), 4, "{:?}", found.orders);
    assert!(found.warnings.is_empty(), "{:?}", found.warnings);
}

#[test]
fn the_predictor_of_an_innovations_model_leaves_its_innovations() {
    let mut model = truth();
    model.gain = Some(DMatrix::from_row_slice(4, 2, &[0.3, 0.1, -0.1, 0.2, 0.2, 0.0, 0.0, -0.1]));
    let (n, size) = (3000, 0.3);
    let inputs: Vec<Vec<f64>> = (0..2)
        .map(|j| noise(3 + j, n).iter().map(|u| u + model.input_offset[j as usize]).collect())
        .collect();
    let innovations: Vec<Vec<f64>> =
        (0..2).map(|i| noise(71 + i, n).iter().map(|e| size * e).collect()).collect();
    // The innovations drive the state like inputs.
    let driven = StateSpace {
        b: DMatrix::from_fn(4, 4, |i, j| {
            if j < 2 { model.b[(i, j)] } else { model.gain.as_ref().unwrap()[(i, j - 2)] }
        }),
        d: DMatrix::from_fn(
            2,
            4,
            |i, j| if j < 2 { model.d[(i, j)] } else { f64::from(u8::from(i == j - 2)) },
        ),
        input_offset: [model.input_offset.clone(), vec![0.0; 2]].concat(),
        gain: None,
        ..model.clone()
    };
    let outputs = driven.simulate_from(&DVector::zeros(4), &[inputs.clone(), innovations.clone()].concat());
    let record = Record { name: "r".into(), sample_time: 0.01, start: 0.0, inputs, outputs };
    let found = estimate(std::slice::from_ref(&record), &options(Order::Fixed(4))).unwrap();
    let predicted = found.model.one_step(&record);
    for i in 0..2 {
        let rms =
            |values: &mut dyn Iterator<Item = f64>| (values.map(|v| v * v).sum::<f64>() / n as f64).sqrt();
        let left = rms(&mut record.outputs[i].iter().zip(&predicted[i]).map(|(y, p)| y - p));
        let least = rms(&mut innovations[i].iter().copied());
        assert!(left < 1.02 * least, "output {i}: {left} against {least}");
    }
    // Gain in the basis-free form C A^m K.
    let markov = |model: &StateSpace| &model.c * &model.a * model.gain.as_ref().unwrap();
    assert!((markov(&found.model) - markov(&model)).amax() < 0.1);
}

#[test]
fn an_unstable_model_is_said_to_be_one_and_mirrored_on_demand() {
    let mut unstable = truth();
    unstable.a[(3, 3)] = 1.01;
    let records = records(&unstable, &[250, 200]);
    let found = estimate(&records, &options(Order::Fixed(4))).unwrap();
    assert!(!found.model.is_stable());
    assert!(found.warnings.iter().any(|warning| warning.contains("stable")), "{:?}", found.warnings);
    for (found, expected) in found.model.markov_parameters(10).iter().zip(unstable.markov_parameters(10)) {
        assert!((found - expected).amax() < 1e-5);
    }
    let options = Options { mirror_unstable: true, ..options(Order::Fixed(4)) };
    let mended = estimate(&records, &options).unwrap();
    assert!(mended.model.is_stable() && mended.method.stabilized);
    assert!(mended.warnings.iter().any(|warning| warning.contains("mirrored")), "{:?}", mended.warnings);
}

#[test]
fn without_direct_term_d_is_zero() {
    let options = Options { direct: false, ..options(Order::Fixed(4)) };
    let found = estimate(&records(&truth(), &[500]), &options).unwrap();
    assert_eq!(found.model.d, DMatrix::zeros(2, 2));
}

#[test]
fn records_that_cannot_do_are_refused_with_the_remedy() {
    let message = |records: &[Record], options: &Options| estimate(records, options).unwrap_err().to_string();
    let good = records(&truth(), &[400]);
    let fixed = options(Order::Fixed(4));
    assert!(message(&records(&truth(), &[20]), &fixed).contains("record more"));
    assert!(message(&good, &options(Order::Fixed(0))).contains("at least one state"));
    let short = Options { horizon: Some(2), ..fixed.clone() };
    assert!(message(&good, &short).contains("at most order 2 with 2 outputs"));
    let mut constant = good.clone();
    constant[0].inputs[1].fill(3.0);
    assert!(message(&constant, &fixed).contains("input 2 is constant"));
    let mut broken = good.clone();
    broken[0].outputs[0][17] = f64::NAN;
    assert!(message(&broken, &fixed).contains("output 1 is NaN at sample 17"));
    let mut other = good.clone();
    other[0].outputs.pop();
    assert!(message(&other, &fixed).contains("1 outputs"));
    let high = options(Order::Fixed(9));
    assert!(message(&good, &high).contains("choose order 4"), "{}", message(&good, &high));
}

#[test]
fn a_single_sine_is_not_enough_and_said_so() {
    let mut records = records(&truth(), &[600]);
    for (j, u) in records[0].inputs.iter_mut().enumerate() {
        u.iter_mut().enumerate().for_each(|(k, u)| *u = (0.1 * k as f64 + j as f64).sin());
    }
    records[0].outputs = truth().simulate_from(&DVector::zeros(4), &records[0].inputs);
    for (i, y) in records[0].outputs.iter_mut().enumerate() {
        let e = noise(9 + i as u64, y.len());
        y.iter_mut().zip(e).for_each(|(y, e)| *y += 0.1 * e);
    }
    let found = estimate(&records, &options(Order::Fixed(2))).unwrap();
    assert!(
        found.warnings.iter().any(|warning| warning.contains("more frequencies")),
        "{:?}",
        found.warnings
    );
}
