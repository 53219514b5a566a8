//! Questions with known answers.

use super::*;
use crate::engine::candidate::{Candidate, Start};
use crate::engine::held_out::HeldOut;
use crate::engine::noise::Noise;
use crate::engine::settings::ForwardSelection as Settings;
use crate::engine::{Span, System};

/// `y = p0 t + p1 t^2 + p2 t` and something that no parameter can do, plus unit noise, t in [0, 1).
struct Wavy(Vec<Vec<f64>>);

impl Wavy {
    fn new(slope: f64, square: f64, wave: f64) -> Wavy {
        let record = |r: u64| {
            let mut noise = Noise::new(7, r);
            let t = (0..1024).map(|k| f64::from(k) / 1024.0);
            t.map(|t| slope * t + square * t * t + wave * (25.0 * t + r as f64).sin() + noise.normal())
                .collect()
        };
        Wavy((0..4).map(record).collect())
    }
}

impl System for Wavy {
    fn records(&self) -> usize {
        4
    }
    fn estimation(&self, _: usize) -> bool {
        true
    }
    fn locals(&self, _: usize) -> Vec<(f64, f64)> {
        Vec::new()
    }
    fn signals(&self, _: usize) -> Vec<Span> {
        vec![Span { signal: "y".into(), range: 0..1024, noise: 1.0 }]
    }
    fn predict(&self, _: usize, p: &[f64], _: &[f64]) -> Vec<f64> {
        let t = (0..1024).map(|k| f64::from(k) / 1024.0);
        t.map(|t| (p[0] + p[2]) * t + p[1] * t * t).collect()
    }
    fn measured(&self, record: usize) -> Vec<f64> {
        self.0[record].clone()
    }
    fn whiten(&self, record: usize, predicted: &[f64]) -> Vec<f64> {
        self.0[record].iter().zip(predicted).map(|(y, p)| y - p).collect()
    }
    fn redraw(&self, _: usize, predicted: &[f64], noise: &mut Noise) -> Vec<f64> {
        predicted.iter().map(|_| noise.normal()).collect()
    }
}

/// The answer of `ask` on a system whose slope is known to `tolerance`; `twin`: whether an effect does the same as
/// another slope.
fn asked_about(
    system: &Wavy,
    tolerance: f64,
    twin: bool,
    last: &[usize],
    ask: impl FnOnce(&Question) -> Found,
) -> Found {
    asked_beside(system, tolerance, twin, (last, &[]), ask)
}

/// Effects and parameters to start from.
type Proposed = (Vec<usize>, Vec<f64>);

/// The same with sets of effects that were `proposed`.
fn asked_beside(
    system: &Wavy,
    tolerance: f64,
    twin: bool,
    (last, proposed): (&[usize], &[Proposed]),
    ask: impl FnOnce(&Question) -> Found,
) -> Found {
    asked_with(system, tolerance, twin, (last, proposed, &[]), ask)
}

/// The same with parameters that are always free.
fn asked_with<T>(
    system: &Wavy,
    tolerance: f64,
    twin: bool,
    (last, proposed, always): (&[usize], &[Proposed], &[Free]),
    ask: impl FnOnce(&Question) -> T,
) -> T {
    let free = |index: usize| Free { index, bounds: (-1e3, 1e3), step: 1e-3, prior: None };
    let candidate = |id: &'static str, index: usize| Candidate {
        id,
        channel: "c",
        signal: None,
        free: vec![free(index)],
        starts: vec![Start { values: Vec::new(), open: vec![0], idle: true }],
        place: 0,
        contains: None,
    };
    let slope = if twin { candidate("slope", 0) } else { candidate("", 2) };
    let candidates = [candidate("square", 1), slope];
    let bounds = (-3.0 * tolerance, 3.0 * tolerance);
    let known = Free { prior: Some(tolerance), bounds, ..free(2) };
    let corrections = [Correction { free: known, effect: Some(1), declared: 1.0 }];
    let units = BTreeMap::from([("y".to_owned(), 1.0)]);
    let question = Question {
        system,
        held_out: &HeldOut::new(system, &units),
        candidates: &candidates,
        corrections: &corrections,
        declared: &[0.0; 3],
        always,
        locals: vec![Vec::new(); 4],
        may_join: &|c, _| !last.contains(&c),
        last,
        proposals: proposed,
        pairs: true,
        free_forms: &[],
        changes: if twin { 2..2 } else { 1..2 },
        records: (0..4).collect(),
        screened: (0..4).collect(),
        folds: vec![vec![0, 1], vec![2, 3]],
        sense: &|_, _| None,
        settings: Settings::default(),
        most: 2,
    };
    ask(&question)
}

fn asked(system: &Wavy, tolerance: f64, ask: impl FnOnce(&Question) -> Found) -> Found {
    asked_about(system, tolerance, true, &[], ask)
}

/// Effects found in a system whose slope is known to `tolerance`, by candidate, and the correction of the slope.
fn found(system: &Wavy, tolerance: f64) -> (Vec<usize>, f64) {
    let result = asked(system, tolerance, search);
    (result.best.added.clone(), result.best.fit.parameters[2])
}

#[test]
fn a_set_that_is_fitted_again_has_the_parameters_of_the_search_that_found_it() {
    let system = Wavy::new(0.5, 40.0, 6.0);
    let [first, again] = [
        asked(&system, 1.0, search),
        asked(&system, 1.0, |question| refit(question, &[0], &[0.0, 30.0, 0.0])),
    ];
    assert_eq!((&first.best.added, &again.best.added), (&vec![0], &vec![0]));
    let distance = |index: usize| (first.best.fit.parameters[index] - again.best.fit.parameters[index]).abs();
    let deviation = again.best.fit.covariance[(0, 0)].sqrt();
    assert!(distance(1) < 0.1 * deviation, "{} {deviation}", distance(1));
    assert!(again.base.added.is_empty() && again.base.fit.chi2 > again.best.fit.chi2);
}

#[test]
fn free_parameters_follow_corrections_that_are_taken_back() {
    // The free slope and the corrected one do the same; with another value of it in its place nothing goes back.
    let system = Wavy::new(40.0, 0.0, 0.0);
    let always = [Free { index: 0, bounds: (-1e3, 1e3), step: 1e-3, prior: None }];
    for (added, expected) in [(vec![], [40.0, 0.0]), (vec![1], [37.0, 3.0])] {
        let (p, _) = asked_with(&system, 1.0, false, (&[], &[], &always), |question| {
            let run = Run::new(question);
            let weights = run.weights(question.declared, &question.locals);
            let model = run.fit(&weights, &added, &[37.0, 0.0, 3.0], &question.locals, 0);
            run.uncorrected(&weights, &model)
        });
        for (found, expected) in [p[0], p[2]].into_iter().zip(expected) {
            assert!((found - expected).abs() < 0.3, "{p:?} {added:?}");
        }
    }
}

#[test]
fn an_effect_that_leaves_several_times_the_noise_is_found_for_its_share() {
    let (added, _) = found(&Wavy::new(0.0, 40.0, 6.0), 1.0);
    assert_eq!(added, [0]);
}

#[test]
fn a_small_effect_joins_a_large_one_where_it_takes_nearly_all_that_is_left() {
    // Without the square the slope leaves 4.5 of 520; a wave that no effect describes leaves 42 more.
    for (wave, expected) in [(0.0, vec![0, 1]), (60.0, vec![1])] {
        let (mut added, _) = found(&Wavy::new(900.0, 40.0, wave), 1e-3);
        added.sort_unstable();
        assert_eq!(added, expected, "{wave}");
    }
}

#[test]
fn a_parameter_within_its_tolerance_is_corrected_and_one_beyond_it_is_an_effect() {
    let (added, slope) = found(&Wavy::new(1.5, 0.0, 6.0), 1.0);
    assert!(added.is_empty() && (0.1..3.0).contains(&slope), "{added:?} {slope}");
    assert_eq!(found(&Wavy::new(40.0, 0.0, 6.0), 1.0).0, [1]);
}

#[test]
fn another_value_of_a_parameter_is_an_effect_where_a_correction_would_go_beyond_its_bound() {
    for (slope, expected) in [(40.0, vec![1]), (1.5, vec![])] {
        let result = asked_about(&Wavy::new(slope, 0.0, 6.0), 1.0, false, &[], search);
        assert_eq!(result.best.added, expected, "{slope}");
        // It is held back by no tolerance.
        let change = result.best.fit.parameters[2];
        assert!((change - slope).abs() < 1.0, "{change}");
    }
    // An effect of the list that does it comes first.
    assert_eq!(asked_about(&Wavy::new(0.0, 40.0, 6.0), 1.0, false, &[], search).best.added, [0]);
}

#[test]
fn two_effects_that_show_only_together_are_found() {
    // Each alone fits next to nothing of t - 1.25 t^2.
    let (mut added, _) = found(&Wavy::new(40.0, -50.0, 2.0), 1e-3);
    added.sort_unstable();
    assert_eq!(added, [0, 1]);
}

#[test]
fn a_fold_near_the_fit_to_all_has_the_error_of_a_fit_without_it() {
    asked_about(&Wavy::new(3.0, 40.0, 6.0), 1.0, true, &[], |question| {
        let run = Run::new(question);
        let weights = run.weights(question.declared, &question.locals);
        let model = run.fit(&weights, &[0], question.declared, &question.locals, ROUNDS);
        let around = run.around(&weights, &model);
        for fold in &question.folds {
            let near = run.near_error(&weights, &model, &around, fold).unwrap();
            let afresh = run.error_afresh(&weights, &model, fold);
            // Beyond the error there of the fit to all, which has seen it.
            let p = &model.fit.parameters;
            let seen = question.held_out.error_from(p, fold, &question.locals);
            assert!(afresh > seen, "{afresh} {seen}");
            assert!((near - afresh).abs() < 0.05 * (afresh - seen), "{near} {afresh} {seen}");
        }
        search(question)
    });
}

#[test]
fn a_proposed_effect_that_lives_on_a_bent_correction_is_none() {
    // With a slope within its tolerance the square makes 60 (t - t^2); alone it makes the error larger.
    let system = Wavy::new(60.0, -60.0, 2.0);
    let ask = |tolerance: f64, ask: fn(&Question) -> Found| {
        let proposed = [(vec![0], vec![0.0, -60.0, 60.0])];
        asked_beside(&system, tolerance, false, (&[], &proposed), ask)
    };
    let fitted = ask(40.0, |question| refit(question, &[0], &[0.0, -60.0, 60.0]));
    assert!(fitted.best.fit.chi2 < 0.2 * fitted.base.fit.chi2);
    assert!(ask(40.0, search).best.added.is_empty());
}

#[test]
fn a_candidate_of_the_last_resort_joins_where_no_other_does() {
    let found = |slope: f64, last: &[usize]| {
        let system = Wavy::new(slope, 40.0, 0.0);
        let mut added = asked_about(&system, 1e-3, true, last, search).best.added;
        added.sort_unstable();
        added
    };
    assert_eq!(found(0.0, &[0, 1]), [0]);
    // Beside the slope the square takes nearly all that is left.
    assert_eq!(found(900.0, &[]), [0, 1]);
    assert_eq!(found(900.0, &[0]), [1]);
}

#[test]
fn what_no_candidate_can_do_is_left() {
    assert!(found(&Wavy::new(0.0, 0.0, 20.0), 1.0).0.is_empty());
}
