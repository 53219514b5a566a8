use super::*;
use crate::model::Arx;
use crate::record::Record;
use crate::score::score;
use crate::source::BLOCK;
use nalgebra::DMatrix;

/// Uniform values between -1 and 1.
fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// Second order, two coefficients on the input from u(k-2) on.
fn truth() -> Arx {
    let matrix = |values: [f64; 4]| DMatrix::from_row_slice(2, 2, &values);
    let gain = |values: [f64; 2]| DMatrix::from_row_slice(2, 1, &values);
    Arx {
        sample_time: 0.01,
        a: vec![matrix([-1.5, 0.02, 0.05, -1.2]), matrix([0.7, 0.0, -0.1, 0.5])],
        b: vec![gain([0.0, 0.0]), gain([0.0, 0.0]), gain([1.0, -0.5]), gain([0.4, 0.8])],
        input_offset: vec![2.0],
        output_offset: vec![10.0, -3.0],
    }
}

fn record(n: usize, noise_size: f64, seed: u64) -> Record {
    let model = truth();
    let mut next = noise(seed);
    let mut level = 0.0;
    let u: Vec<f64> = (0..n)
        .map(|k| {
            if k % 5 == 0 {
                level = next();
            }
            level + 2.0
        })
        .collect();
    let mut y = vec![vec![0.0; n]; 2];
    for k in 3..n {
        for i in 0..2 {
            let past: f64 = (0..2)
                .flat_map(|lag| (0..2).map(move |l| (lag, l)))
                .map(|(lag, l)| -model.a[lag][(i, l)] * y[l][k - 1 - lag])
                .sum();
            let forced: f64 = (2..4).map(|lag| model.b[lag][(i, 0)] * (u[k - lag] - 2.0)).sum();
            y[i][k] = past + forced + noise_size * next();
        }
    }
    y.iter_mut().zip([10.0, -3.0]).for_each(|(y, offset)| y.iter_mut().for_each(|y| *y += offset));
    Record { name: "r".into(), sample_time: 0.01, start: 0.0, inputs: vec![u], outputs: y }
}

fn found(ranges: &Ranges, estimation: &[&dyn Source], judging: &[&dyn Source]) -> Vec<Candidate> {
    let (inputs, outputs) = (["u".to_owned()], ["a".to_owned(), "b".to_owned()]);
    let names = Names { inputs: &inputs, outputs: &outputs };
    search(estimation, judging, ranges, 0.01, (&[2.0], &[10.0, -3.0]), names).unwrap()
}

#[test]
fn the_true_structure_comes_first() {
    let (estimation, judging) = (record(4000, 0.05, 1), record(4000, 0.0, 2));
    let ranges = Ranges { na: 1..=4, nb: 1..=4, nk: 0..=3 };
    let candidates = found(&ranges, &[&estimation], &[&judging]);
    assert_eq!(candidates.len(), 64);
    let best = &candidates[0];
    assert!(best.fit.unwrap() > 98.0, "{best:?}");
    assert_eq!(
        (best.structure.na[0][0], best.structure.nb[0][0], best.structure.nk[0][0]),
        (2, 2, 2),
        "{best:?}"
    );
    // The criteria count parameters and choose the same.
    for criterion in [|c: &Candidate| c.bic, |c: &Candidate| c.mdl] {
        let least = candidates.iter().min_by(|a, b| criterion(a).unwrap().total_cmp(&criterion(b).unwrap()));
        assert_eq!(least.unwrap().structure, best.structure);
    }
}

#[test]
fn chance_in_the_judging_data_buys_no_coefficients() {
    let (estimation, judging) = (record(6000, 0.5, 1), record(700, 0.5, 2));
    let candidates = found(&Ranges { na: 1..=6, nb: 1..=6, nk: 2..=2 }, &[&estimation], &[&judging]);
    let taken = &candidates[recommended(&candidates).unwrap()];
    assert_eq!((taken.structure.na[0][0], taken.structure.nb[0][0]), (2, 2), "{taken:?}");
    assert!(taken.fit.unwrap() > candidates[0].fit.unwrap() - FIT_MARGIN);
    assert_eq!(recommended(&[]), None);
}

#[test]
fn every_candidate_has_the_fit_of_the_model_estimated_and_simulated_alone() {
    let estimation = [record(BLOCK + 700, 0.3, 3), record(900, 0.3, 4)];
    let judging = [record(2 * BLOCK + 5, 0.3, 5), record(300, 0.3, 6)];
    let ranges = Ranges { na: 0..=3, nb: 0..=3, nk: 0..=2 };
    let sources: Vec<&dyn Source> = estimation.iter().map(|r| r as &dyn Source).collect();
    let judges: Vec<&dyn Source> = judging.iter().map(|r| r as &dyn Source).collect();
    let largest = ranges.largest((1, 2));
    let names = ["a".to_owned(), "b".to_owned()];
    for candidate in found(&ranges, &sources, &judges) {
        // Estimated by a decomposition of its own, of the rows that all share.
        let offsets: (&[f64], &[f64]) = (&[2.0], &[10.0, -3.0]);
        let late: Vec<Record> = estimation
            .iter()
            .map(|record| {
                let cut = largest.lags() - candidate.structure.lags();
                let columns = |columns: &[Vec<f64>]| columns.iter().map(|c| c[cut..].to_vec()).collect();
                Record {
                    inputs: columns(&record.inputs),
                    outputs: columns(&record.outputs),
                    ..record.clone()
                }
            })
            .collect();
        let late: Vec<&dyn Source> = late.iter().map(|r| r as &dyn Source).collect();
        let names_of = Names { inputs: &["u".to_owned()], outputs: &names };
        let alone = arx::estimate(&late, &candidate.structure, 0.01, offsets, names_of).unwrap();
        // Simulated one by one, from the sample at which all begin.
        let cut = largest.lags() - alone.model.lags();
        let late: Vec<Record> = judging
            .iter()
            .map(|record| {
                let columns = |columns: &[Vec<f64>]| columns.iter().map(|c| c[cut..].to_vec()).collect();
                Record {
                    inputs: columns(&record.inputs),
                    outputs: columns(&record.outputs),
                    ..record.clone()
                }
            })
            .collect();
        let expected = score(&alone.model, &late, &names).mean_fit_simulated;
        match (candidate.fit, expected) {
            (Some(found), Some(expected)) => {
                assert!((found - expected).abs() < 1e-6, "{}: {found} {expected}", candidate.structure);
            }
            (found, expected) => assert_eq!(found, expected, "{}", candidate.structure),
        }
    }
}

#[test]
fn without_judges_the_last_third_of_every_record_judges() {
    let whole = record(3000, 0.05, 7);
    let split = estimation_share(3000);
    assert_eq!(split, 2000);
    let first = Part { source: &whole, from: 0, to: split };
    let last = Part { source: &whole, from: split, to: 3000 };
    let ranges = Ranges { na: 1..=3, nb: 1..=3, nk: 0..=3 };
    let expected = found(&ranges, &[&first], &[&last]);
    assert_eq!((expected[0].structure.na[0][0], expected[0].structure.nk[0][0]), (2, 2), "{:?}", expected[0]);
    let (inputs, outputs) = (["u".to_owned()], ["a".to_owned(), "b".to_owned()]);
    let names = Names { inputs: &inputs, outputs: &outputs };
    let offsets: (&[f64], &[f64]) = (&[2.0], &[10.0, -3.0]);
    assert_eq!(search_or_split(&[&whole], &[], &ranges, 0.01, offsets, names).unwrap(), expected);
}

#[test]
fn structures_that_cannot_be_told_apart_are_kept_with_their_reason() {
    let (estimation, judging) = (record(2000, 0.0, 1), record(2000, 0.0, 2));
    let candidates = found(&Ranges { na: 1..=3, nb: 1..=3, nk: 1..=2 }, &[&estimation], &[&judging]);
    let best = &candidates[0];
    assert!(best.fit.unwrap() > 100.0 - 1e-6 && best.structure.na[0][0] == 2, "{best:?}");
    let last = candidates.last().unwrap();
    assert!(
        last.stable.is_none() && last.problem.as_ref().unwrap().contains("linear combination"),
        "{last:?}"
    );
}

#[test]
fn without_a_stable_structure_none_has_a_fit_and_none_is_recommended() {
    // y(k) = 1.02 y(k-1) + 0.1 u(k-1): its only pole is outside the unit circle.
    let mut next = noise(9);
    let u: Vec<f64> = (0..200).map(|_| next()).collect();
    let mut y = vec![0.0; 200];
    for k in 1..200 {
        y[k] = 1.02 * y[k - 1] + 0.1 * u[k - 1] + 1e-3 * next();
    }
    let record = Record { sample_time: 0.01, inputs: vec![u], outputs: vec![y], ..Record::default() };
    let (inputs, outputs) = (["u".to_owned()], ["y".to_owned()]);
    let names = Names { inputs: &inputs, outputs: &outputs };
    let ranges = Ranges { na: 1..=1, nb: 1..=1, nk: 1..=1 };
    let found = search(&[&record], &[&record], &ranges, 0.01, (&[0.0], &[0.0]), names).unwrap();
    assert_eq!((found.len(), found[0].stable, found[0].fit), (1, Some(false), None));
    assert_eq!(recommended(&found), None);
}
