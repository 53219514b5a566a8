//! Step and frequency responses of a model, and how uncertain they are.
//!
//! Uncertainty is of first order: a change of the parameters by a hundredth of a standard deviation along every
//! independent direction of their covariance, both ways; the squares of the changes of the response add up.

use nalgebra::{Complex, DMatrix, DVector};
use serde::Serialize;

use crate::model::{Model, StateSpace};
use crate::parameters::Parameters;
use crate::record::Record;

/// Share of a standard deviation by which parameters are changed to find derivatives.
const DIFFERENCE_STEP_PER_DEVIATION: f64 = 0.01;

/// An estimate with its neighbors: parameters with their covariance, and the model for any of them.
#[derive(Clone, Copy)]
pub struct Family<'a> {
    /// Parameters of the estimate.
    pub parameters: &'a Parameters,
    /// The model for parameters of shape \[p\].
    pub at: &'a dyn Fn(&DVector<f64>) -> StateSpace,
}

impl Family<'_> {
    /// Pairs of models a little to either side of the estimate, one pair per independent direction.
    fn neighbors(&self) -> Vec<[StateSpace; 2]> {
        let values = &self.parameters.values;
        let pair = |d: DVector<f64>| {
            [
                (self.at)(&(values + &d * DIFFERENCE_STEP_PER_DEVIATION)),
                (self.at)(&(values - &d * DIFFERENCE_STEP_PER_DEVIATION)),
            ]
        };
        self.parameters.deviations().into_iter().map(pair).collect()
    }

    /// Whether a band is worth its time, with a number of operations for each neighbor.
    fn affordable(&self, operations: f64) -> bool {
        2.0 * self.parameters.values.len() as f64 * operations <= MOST_OPERATIONS
    }

    /// Standard deviations of what `of` computes from a model, shape that of its result.
    fn deviations(&self, of: impl Fn(&StateSpace) -> Vec<f64>) -> Vec<f64> {
        let mut squares: Vec<f64> = Vec::new();
        for [above, below] in self.neighbors() {
            let (above, below) = (of(&above), of(&below));
            squares.resize(above.len(), 0.0);
            for ((square, a), b) in squares.iter_mut().zip(above).zip(below) {
                *square += ((a - b) / (2.0 * DIFFERENCE_STEP_PER_DEVIATION)).powi(2);
            }
        }
        squares.into_iter().map(f64::sqrt).collect()
    }
}

/// Response of one output to a step of one input.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StepResponse {
    /// Name of the input.
    pub input: String,
    /// Name of the output.
    pub output: String,
    /// Times \[s\].
    pub time: Vec<f64>,
    /// Output per unit of the input.
    pub values: Vec<f64>,
    /// Standard deviation of the values; empty if the uncertainty is not known.
    pub standard_deviation: Vec<f64>,
    /// Value after infinite time; `None` for an unstable model.
    pub dc_gain: Option<f64>,
    /// Standard deviation of the gain.
    pub dc_gain_deviation: Option<f64>,
    /// Time after which the response stays within 2 % of its end \[s\], or within 2 % of its largest value if it ends
    /// at almost 0; `None` for an unstable model.
    pub settling_time: Option<f64>,
}

/// Frequency response from one input to one output.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrequencyResponse {
    /// Name of the input.
    pub input: String,
    /// Name of the output.
    pub output: String,
    /// Frequencies \[Hz\].
    pub frequency: Vec<f64>,
    /// Output per unit of the input.
    pub magnitude: Vec<f64>,
    /// Phase \[degrees\], without jumps.
    pub phase: Vec<f64>,
    /// Standard deviation of the natural logarithm of the magnitude, that is, its relative one; empty if not known.
    pub relative_deviation: Vec<f64>,
    /// Standard deviation of the phase \[degrees\]; empty if not known.
    pub phase_deviation: Vec<f64>,
}

/// Most operations for one band; some seconds. Beyond, responses are given without it.
const MOST_OPERATIONS: f64 = 1e10;
/// Most samples of a step response that are computed.
const MAX_STEP_RESPONSE_SAMPLES: usize = 200_000;
/// Points of a response that are kept.
const POINTS: usize = 240;

/// Steady-state gain `C (I - A)^-1 B + D`, shape \[n_y, n_u\]; `None` with a pole at 1.
pub fn dc_gain(model: &StateSpace) -> Option<DMatrix<f64>> {
    let n = model.order();
    let x = (DMatrix::identity(n, n) - &model.a).lu().solve(&model.b)?;
    Some(&model.c * x + &model.d)
}

/// Step responses of all channels, ordered by input, then output.
pub fn step_responses(
    model: &StateSpace,
    family: Option<Family>,
    inputs: &[String],
    outputs: &[String],
) -> Vec<StepResponse> {
    let stable = model.is_stable();
    let gain = stable.then(|| dc_gain(model)).flatten();
    let gain_operations = (model.order() as f64).powi(3);
    let affordable = |family: &Family| gain.is_some() && family.affordable(gain_operations);
    let gain_deviation = family.filter(affordable).map(|family| {
        family.deviations(|model| {
            dc_gain(model).map_or(vec![f64::NAN; model.d.len()], |g| g.as_slice().to_vec())
        })
    });
    let length = horizon(model);
    let mut found = Vec::new();
    for (j, input) in inputs.iter().enumerate() {
        let full = step(model, j, length);
        let settled: Vec<Option<usize>> =
            (0..outputs.len()).map(|i| gain.as_ref().map(|gain| settling(&full[i], gain[(i, j)]))).collect();
        let slowest = settled.iter().flatten().max().copied().unwrap_or(length);
        let shown = (slowest + slowest / 3 + 10).min(length);
        let stride = shown.div_ceil(POINTS).max(1);
        let thin = |y: &[Vec<f64>]| -> Vec<f64> {
            y.iter().flat_map(|y| y[..shown].iter().step_by(stride).copied()).collect()
        };
        let operations = 2.0 * shown as f64 * (model.order() as f64 + 1.0).powi(2) * inputs.len() as f64;
        let bands = family.filter(|family| family.affordable(operations));
        let deviation = bands.map(|family| family.deviations(|model| thin(&step(model, j, shown))));
        let values = thin(&full);
        let points = values.len() / outputs.len().max(1);
        for (i, output) in outputs.iter().enumerate() {
            let part = i * points..(i + 1) * points;
            let of_gain = |gains: &[f64]| gains.get(j * outputs.len() + i).copied();
            found.push(StepResponse {
                input: input.clone(),
                output: output.clone(),
                time: (0..points).map(|k| (k * stride) as f64 * model.sample_time).collect(),
                values: values[part.clone()].to_vec(),
                standard_deviation: deviation
                    .as_ref()
                    .and_then(|deviation| deviation.get(part))
                    .map_or(Vec::new(), <[f64]>::to_vec),
                dc_gain: gain.as_ref().map(|gain| gain[(i, j)]),
                dc_gain_deviation: gain_deviation.as_deref().and_then(of_gain),
                settling_time: settled[i].map(|k| k as f64 * model.sample_time),
            });
        }
    }
    found
}

/// Samples until the slowest mode has decayed to a thousandth.
fn horizon(model: &StateSpace) -> usize {
    let radius = model.poles().iter().fold(0.0, |radius, pole| f64::max(radius, pole.norm()));
    if radius >= 1.0 {
        return 200;
    }
    let samples = 7.0 / -f64::max(radius, 0.01).ln();
    (samples.ceil() as usize + model.order() + 10).min(MAX_STEP_RESPONSE_SAMPLES)
}

/// Outputs after a unit step of input `j` from rest, offsets left out, shape \[n_y\]\[n\].
fn step(model: &StateSpace, j: usize, n: usize) -> Vec<Vec<f64>> {
    let at_rest = StateSpace {
        input_offset: vec![0.0; model.d.ncols()],
        output_offset: vec![0.0; model.d.nrows()],
        ..model.clone()
    };
    let inputs: Vec<Vec<f64>> =
        (0..model.d.ncols()).map(|input| vec![f64::from(u8::from(input == j)); n]).collect();
    at_rest.simulate_from(&DVector::zeros(model.order()), &inputs)
}

fn settling(y: &[f64], end: f64) -> usize {
    let peak = y.iter().fold(0.0f64, |peak, y| peak.max(y.abs()));
    let size = if end.abs() > 0.05 * peak { end.abs() } else { peak };
    y.iter().rposition(|y| (y - end).abs() > 0.02 * size).map_or(0, |last| last + 1)
}

/// `G(e^(i w T)) = C (z I - A)^-1 B + D` at frequencies \[Hz\], shape \[frequencies\], each \[n_y, n_u\].
pub fn frequency_response(model: &StateSpace, frequency: &[f64]) -> Vec<DMatrix<Complex<f64>>> {
    let complex = |m: &DMatrix<f64>| m.map(|value| Complex::new(value, 0.0));
    let (a, b, c, d) = (complex(&model.a), complex(&model.b), complex(&model.c), complex(&model.d));
    let n = model.order();
    let at = |f: &f64| {
        let z = Complex::from_polar(1.0, std::f64::consts::TAU * f * model.sample_time);
        let shifted = DMatrix::from_diagonal_element(n, n, z) - &a;
        let x = shifted.lu().solve(&b).unwrap_or_else(|| DMatrix::zeros(n, b.ncols()));
        &c * x + &d
    };
    frequency.iter().map(at).collect()
}

/// Frequency responses of all channels, ordered by input, then output, from `lowest` \[Hz\] to the Nyquist frequency.
pub fn frequency_responses(
    model: &StateSpace,
    family: Option<Family>,
    inputs: &[String],
    outputs: &[String],
    lowest: f64,
) -> Vec<FrequencyResponse> {
    let nyquist = 0.5 / model.sample_time;
    let lowest = lowest.clamp(1e-6 * nyquist, 0.5 * nyquist);
    let ratio = (0.999 * nyquist / lowest).ln();
    let frequency: Vec<f64> =
        (0..POINTS).map(|k| lowest * (ratio * k as f64 / (POINTS - 1) as f64).exp()).collect();
    let response = frequency_response(model, &frequency);
    // A complex elimination for each frequency.
    let operations = POINTS as f64 * 8.0 / 3.0 * (model.order() as f64).powi(3);
    let family = family.filter(|family| family.affordable(operations));
    // Relative changes of the complex response: real part in magnitude, imaginary part in phase.
    let changes: Option<Vec<f64>> = family.map(|family| {
        family.deviations(|near| {
            let near = frequency_response(near, &frequency);
            let pairs = near.iter().zip(&response).flat_map(|(near, g)| near.iter().zip(g.iter()));
            pairs.map(|(near, g)| near / g).flat_map(|ratio| [ratio.norm().ln(), ratio.arg()]).collect()
        })
    });
    let channels = inputs.len() * outputs.len();
    let mut found = Vec::new();
    for (j, input) in inputs.iter().enumerate() {
        for (i, output) in outputs.iter().enumerate() {
            let channel = j * outputs.len() + i;
            let take = |part: usize| -> Vec<f64> {
                let Some(changes) = changes.as_ref().filter(|changes| !changes.is_empty()) else {
                    return Vec::new();
                };
                (0..POINTS).map(|k| changes[2 * (k * channels + channel) + part]).collect()
            };
            found.push(FrequencyResponse {
                input: input.clone(),
                output: output.clone(),
                frequency: frequency.clone(),
                magnitude: response.iter().map(|g| g[(i, j)].norm()).collect(),
                phase: unwrapped(response.iter().map(|g| g[(i, j)].arg())),
                relative_deviation: take(0),
                phase_deviation: take(1).into_iter().map(f64::to_degrees).collect(),
            });
        }
    }
    found
}

/// Angles \[rad\] as degrees without jumps.
fn unwrapped(angles: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut turns = 0.0;
    let mut before: Option<f64> = None;
    angles
        .map(|angle| {
            if let Some(before) = before {
                turns -= ((angle - before) / std::f64::consts::TAU).round();
            }
            before = Some(angle);
            (angle + turns * std::f64::consts::TAU).to_degrees()
        })
        .collect()
}

/// Simulated outputs of a record and their standard deviation from that of the parameters, shape \[n_y\]\[n\] each.
pub fn simulated_band(family: Family, record: &Record) -> [Vec<Vec<f64>>; 2] {
    let simulate = |model: &StateSpace| model.simulate(record);
    let values = simulate(&(family.at)(&family.parameters.values));
    let n = record.len().max(1);
    let deviation = family.deviations(|model| simulate(model).concat());
    let deviation = if deviation.is_empty() { vec![0.0; n * values.len()] } else { deviation };
    [values, deviation.chunks(n).map(<[f64]>::to_vec).collect()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Model;
    use crate::synthetic::eq8;

    fn first_order(pole: f64, gain: f64) -> StateSpace {
        let one = |value: f64| DMatrix::from_element(1, 1, value);
        StateSpace {
            sample_time: 0.01,
            a: one(pole),
            b: one(1.0),
            c: one(gain * (1.0 - pole)),
            d: one(0.0),
            gain: None,
            input_offset: vec![3.0],
            output_offset: vec![7.0],
        }
    }

    fn channel() -> ([String; 1], [String; 1]) {
        (["u".into()], ["y".into()])
    }

    #[test]
    fn gain_and_settling_time_of_a_first_order_lag_are_those_of_its_formula() {
        let (u, y) = channel();
        let response = &step_responses(&first_order(0.9, 2.5), None, &u, &y)[0];
        assert!((response.dc_gain.unwrap() - 2.5).abs() < 1e-12);
        // 0.9^k < 0.02: k > ln 0.02 / ln 0.9 = 37.13
        assert!((response.settling_time.unwrap() - 0.38).abs() < 1e-12, "{:?}", response.settling_time);
        assert!((response.values[5] - 2.5 * (1.0 - 0.9f64.powi(5))).abs() < 1e-12);
        assert!(response.standard_deviation.is_empty());
    }

    #[test]
    fn the_band_follows_from_the_derivative_of_the_gain() {
        let (u, y) = channel();
        let parameters = Parameters {
            names: vec!["gain".into()],
            values: DVector::from_element(1, 2.5),
            covariance: Some(DMatrix::from_element(1, 1, 0.04)),
        };
        let family = Family { parameters: &parameters, at: &|p| first_order(0.9, p[0]) };
        let response = &step_responses(&first_order(0.9, 2.5), Some(family), &u, &y)[0];
        assert!((response.dc_gain_deviation.unwrap() - 0.2).abs() < 1e-9);
        for (value, deviation) in response.values.iter().zip(&response.standard_deviation) {
            assert!((deviation - value * 0.2 / 2.5).abs() < 1e-9);
        }
        let bode = &frequency_responses(&first_order(0.9, 2.5), Some(family), &u, &y, 0.1)[0];
        for (relative, phase) in bode.relative_deviation.iter().zip(&bode.phase_deviation) {
            assert!((relative - 0.08).abs() < 1e-5 && *phase < 1e-6);
        }
        let record = Record {
            sample_time: 0.01,
            inputs: vec![vec![4.0; 30]],
            outputs: vec![vec![7.0; 30]],
            ..Record::default()
        };
        let [values, deviation] = simulated_band(family, &record);
        assert_eq!((values[0].len(), deviation[0].len()), (30, 30));
    }

    #[test]
    fn a_band_that_would_take_minutes_is_left_out_and_the_response_stays() {
        let n = 60;
        let large = StateSpace {
            a: DMatrix::identity(n, n) * 0.5,
            b: DMatrix::from_element(n, 1, 1.0),
            c: DMatrix::from_element(1, n, 1.0 / n as f64),
            ..first_order(0.5, 1.0)
        };
        let parameters = Parameters {
            names: vec!["p".into(); 120],
            values: DVector::zeros(120),
            covariance: Some(DMatrix::identity(120, 120)),
        };
        let family = Family { parameters: &parameters, at: &|_| first_order(0.5, 1.0) };
        let (u, y) = channel();
        let bode = &frequency_responses(&large, Some(family), &u, &y, 0.1)[0];
        assert!(bode.relative_deviation.is_empty() && bode.phase_deviation.is_empty());
        // n poles at 0.5 side by side: 1 / (z - 0.5).
        let z = Complex::from_polar(1.0, std::f64::consts::TAU * bode.frequency[0] * 0.01);
        assert!((bode.magnitude[0] - (z - 0.5).inv().norm()).abs() < 1e-9);
    }

    #[test]
    fn the_frequency_response_of_eq_8_is_that_of_scipy() {
        // scipy.signal.dlti(..).freqresp, tests/reference/identification_diagnostics.py
        let g = frequency_response(&eq8().to_state_space(), &[1.0, 30.0]);
        for (found, expected) in [(g[0][(0, 0)], EQ8[0]), (g[0][(1, 0)], EQ8[1]), (g[1][(0, 0)], EQ8[2])] {
            assert!((found - Complex::new(expected.0, expected.1)).norm() < 1e-10, "{found}");
        }
    }

    const EQ8: [(f64, f64); 3] = [
        (1.0336943389571853, 0.03255288337752336),
        (0.985975547948133, -0.08641820697057842),
        (0.6631970154161386, -0.07564590836207184),
    ];
}
