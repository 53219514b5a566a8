use super::*;
use crate::model::{Arx, Model};
use crate::synthetic::{Noise, measure};
use airloop_optim::linalg::StreamedQr;

/// `0.8 / (1 - 0.7 q)` after three samples, and a second input that arrives at once.
fn delayed() -> Arx {
    let one = |first: f64, second: f64| DMatrix::from_row_slice(1, 2, &[first, second]);
    Arx {
        sample_time: 0.01,
        a: vec![DMatrix::from_element(1, 1, -0.7)],
        b: vec![one(0.0, 0.5), one(0.0, 0.0), one(0.0, 0.0), one(0.8, 0.0)],
        input_offset: vec![0.0; 2],
        output_offset: vec![0.0],
    }
}

fn white(n: usize, noise: &mut Noise) -> Vec<f64> {
    (0..n).map(|_| noise.normal()).collect()
}

fn truth(l: i32) -> [f64; 2] {
    [if l < 3 { 0.0 } else { 0.8 * 0.7f64.powi(l - 3) }, 0.5 * 0.7f64.powi(l)]
}

#[test]
fn delay_and_response_are_found_and_the_band_holds_the_truth() {
    for kernel in [Kernel::Tc, Kernel::Dc] {
        let mut noise = Noise::new(1);
        let inputs = vec![white(700, &mut noise), white(700, &mut noise)];
        let records = [measure(&delayed(), inputs, 0.3, &mut noise)];
        let found = estimate(&records, &Options { kernel, length: 25 }).unwrap();
        let [first, second] = &found[0].channels[..] else { panic!() };
        assert_eq!((first.first_significant, second.first_significant), (Some(3), Some(0)), "{kernel:?}");
        assert!((found[0].noise_deviation - 0.3).abs() < 0.03);
        let mut outside = 0;
        for (l, lag) in (0..25).enumerate() {
            for (channel, truth) in [first, second].into_iter().zip(truth(lag)) {
                outside += usize::from((channel.values[l] - truth).abs() > channel.band_99[l]);
            }
        }
        assert!(outside <= 2, "{outside}");
        let said = evidence(&found, &["u1".into(), "u2".into()], &["y".into()]);
        assert_eq!(said.delay, [[Some(3), Some(0)]]);
        assert!(said.sentences[0].contains("delay of 3 samples likely: the FIR of u1 to y"), "{said:?}");
    }
}

#[test]
fn regularization_is_closer_to_the_truth_than_least_squares() {
    let mut noise = Noise::new(2);
    let inputs = vec![white(150, &mut noise), white(150, &mut noise)];
    let records = [measure(&delayed(), inputs, 0.5, &mut noise)];
    let found = estimate(&records, &Options { kernel: Kernel::Tc, length: 40 }).unwrap();
    // Least squares on the same rows, by the pseudo-inverse.
    let (u, y) = (&records[0].inputs, &records[0].outputs[0]);
    let phi = DMatrix::from_fn(111, 80, |row, column| u[column / 40][row + 39 - column % 40]);
    let target = DVector::from_fn(111, |row, _| y[row + 39]);
    let plain = phi.svd(true, true).solve(&target, 1e-12).unwrap();
    let error = |g: &dyn Fn(usize, usize) -> f64| -> f64 {
        (0..40)
            .flat_map(|l| (0..2).map(move |j| (l, j)))
            .map(|(l, j)| (g(j, l) - truth(l as i32)[j]).powi(2))
            .sum()
    };
    let regularized = error(&|j, l| found[0].channels[j].values[l]);
    assert!(regularized < 0.3 * error(&|j, l| plain[j * 40 + l]), "{regularized}");
}

#[test]
fn the_marginal_likelihood_is_that_of_the_normal_distribution() {
    // -2 ln p(y) = ln det(Phi P Phi^T + I s^2) + y^T (..)^-1 y, directly, with the noise variance at its optimum.
    let mut noise = Noise::new(3);
    let phi = DMatrix::from_fn(30, 4, |_, _| noise.normal());
    let y = DVector::from_fn(30, |_, _| noise.normal());
    let mut fold = StreamedQr::new(5);
    fold.push(&DMatrix::from_fn(30, 5, |i, j| if j < 4 { phi[(i, j)] } else { y[i] }));
    let r = fold.finish().into_r();
    let regressors = r.view((0, 0), (4, 4)).into_owned();
    let marginal = Marginal {
        regressors: &regressors,
        explained: r.view((0, 4), (4, 1)).column(0).into_owned(),
        rest: r[(4, 4)].powi(2),
        rows: 30,
        length: 4,
        kernel: Kernel::Dc,
    };
    let variables = [0.7, 1.1, 0.4];
    let Prior { size, decay, correlation } = Prior::new(&variables, Kernel::Dc);
    let kernel = DMatrix::from_fn(4, 4, |k, l| {
        size * decay.powf(0.5 * (k + l) as f64) * correlation.powi(k.abs_diff(l) as i32)
    });
    let covariance = &phi * kernel * phi.transpose() + DMatrix::identity(30, 30);
    let squares = (y.transpose() * covariance.clone().try_inverse().unwrap() * &y)[(0, 0)];
    let expected = 30.0 * (squares / 30.0).ln() + covariance.determinant().ln();
    assert!((marginal.evaluate(&variables).criterion - expected).abs() < 1e-9);
}

#[test]
fn the_order_is_the_number_of_singular_values_above_the_noise() {
    let scalar = |value: f64| DMatrix::from_element(1, 1, value);
    let second = Arx {
        a: vec![scalar(-1.2), scalar(0.72)],
        b: vec![scalar(0.0), scalar(1.0)],
        input_offset: vec![0.0],
        ..delayed()
    };
    let mut noise = Noise::new(4);
    let u = white(1500, &mut noise);
    let records = [measure(&second, vec![u], 0.2, &mut noise)];
    let found = estimate(&records, &Options { kernel: Kernel::Dc, length: 40 }).unwrap();
    let said = evidence(&found, &["u".into()], &["y".into()]);
    assert_eq!((said.order, second.poles().len()), (2, 2), "{:?}", &said.hankel_singular_values[..5]);
}

#[test]
fn too_short_records_are_refused() {
    let mut noise = Noise::new(5);
    let inputs = vec![white(60, &mut noise), white(60, &mut noise)];
    let records = [measure(&delayed(), inputs, 0.1, &mut noise)];
    let error = estimate(&records, &Options::default()).unwrap_err();
    assert!(matches!(error, Error::TooShort { samples: 60, .. }));
}
