use super::*;
use airloop_ident::diagnostics::residuals::Autocorrelation;
use airloop_ident::diagnostics::response::{FrequencyResponse, StepResponse};
use airloop_ident::diagnostics::{ChannelZeros, Root};
use nalgebra::Complex;

fn count(svg: &str, what: &str) -> usize {
    svg.matches(what).count()
}

#[test]
fn stems_outside_the_band_stand_out() {
    let found = [Autocorrelation {
        output: "F <hat>".into(),
        values: vec![1.0, 0.01, -0.3, 0.02],
        band_99: 0.05,
        ljung_box: 9.0,
        degrees_of_freedom: 3,
        p_value: 0.029,
        explained_by_past: 0.09,
    }];
    let svg = autocorrelations(&found);
    assert_eq!(count(&svg, "class=\"dot-beyond\""), 1);
    assert_eq!(count(&svg, "class=\"dot\""), 2);
    assert!(svg.contains("F &lt;hat&gt;: Ljung-Box p = 0.029"), "names are text");
}

#[test]
fn an_unstable_order_has_a_mark_and_no_point() {
    let fits = [(1, Some(80.0), true), (2, None, false), (3, Some(90.0), true)]
        .map(|(order, fit, stable)| OrderFit { order, fit, stable });
    let svg = fit_against_order("Fit", "", &[Family { name: "ARX", fits: &fits }]);
    // One circle in the legend, two for the fits; around the cross of the unstable one a larger one.
    assert_eq!(count(&svg, "r=\"4.00\""), 3);
    assert_eq!(count(&svg, "r=\"8.00\""), 1);
    assert!(svg.contains("unstable, no fit"));
    // The line is broken there.
    assert_eq!(count(&svg, "<polyline class=\"s0 d0\""), 2);
}

#[test]
fn responses_have_a_band_only_if_their_uncertainty_is_known() {
    let mut step = StepResponse {
        input: "u".into(),
        output: "y".into(),
        time: vec![0.0, 1.0, 2.0],
        values: vec![0.0, 0.8, 1.0],
        standard_deviation: vec![0.0, 0.1, 0.1],
        dc_gain: Some(1.0),
        dc_gain_deviation: Some(0.1),
        settling_time: Some(2.0),
    };
    assert!(step_responses(std::slice::from_ref(&step)).contains("95 % band"));
    step.standard_deviation.clear();
    let svg = step_responses(&[step]);
    assert!(!svg.contains("95 % band") && !svg.contains("<polygon"));
    let bode = FrequencyResponse {
        input: "u".into(),
        output: "y".into(),
        frequency: vec![0.1, 1.0, 10.0],
        magnitude: vec![1.0, 0.5, 0.0],
        phase: vec![0.0, -45.0, -90.0],
        relative_deviation: Vec::new(),
        phase_deviation: Vec::new(),
    };
    let svg = frequency_responses(&[bode]);
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "a zero magnitude is drawn on the edge");
}

#[test]
fn the_pole_zero_map_has_a_cross_for_every_pole_in_both_views() {
    let root = |re: f64, im: f64| Root::new(Complex::new(re, im), 0.001);
    let poles = [root(0.984, 0.015), root(0.984, -0.015), root(-0.3, 0.0)];
    let zeros = [ChannelZeros { input: "u".into(), output: "y".into(), zeros: vec![root(40.0, 0.0)] }];
    let svg = pole_zero_map(&poles, &zeros);
    // Three in the whole, two in the close-up; the one of the legend has another class.
    assert_eq!(count(&svg, "<path class=\"beyond\""), 5);
    assert!(!svg.contains("NaN"));
}

#[test]
fn points_that_fall_together_are_drawn_once() {
    let x: Vec<f64> = (0..100_000).map(|k| f64::from(k % 100) * 0.01).collect();
    let svg = scatter(&Scatter {
        title: "Friction",
        note: "",
        x_label: "velocity [m/s]",
        y_label: "force [N]",
        points: (&x, &x),
        curve: (&[0.0, 1.0], &[0.0, 1.0]),
        band: &[0.1, 0.1],
    });
    assert_eq!(count(&svg, "class=\"faint\""), 100); // the one of the legend has a second class
}
