//! The trajectory on the samples, and the equilibrium at its end.

use nalgebra::{DMatrix, DVector};

use super::{Error, Sampled};
use crate::transcription::Point;
use airloop_optim::linalg::spectral;
use airloop_series::Interpolation;

/// Rounds of Newton's method for the equilibrium.
const ROUNDS: usize = 30;
/// Most samples: each is a row of gains in memory and in the table.
const MAX_SAMPLES: f64 = 1e6;
/// Rates that count as rest: change over one second relative to the size of the states.
const MAX_RATE_AT_REST: f64 = 1e-6;

/// Knots of a plan.
#[derive(Debug, Clone, Copy)]
pub struct Knots<'a> {
    /// Times \[s\], rising, `[k]`.
    pub time: &'a [f64],
    /// States, `[k, n_x]`.
    pub states: &'a [Vec<f64>],
    /// Inputs, `[k, n_u]`.
    pub inputs: &'a [Vec<f64>],
    /// Inputs between the knots.
    pub interpolation: Interpolation,
}

/// A trajectory at the samples, with what follows its end.
#[derive(Debug, Clone, PartialEq)]
pub struct Nominal {
    /// Time of the first sample \[s\].
    pub start: f64,
    /// Time between the samples \[s\].
    pub sample_time: f64,
    /// States at the samples, `[k + 1, n_x]`; the last ones are held.
    pub states: Vec<Vec<f64>>,
    /// Inputs from each sample to the next, `[k + 1, n_u]`; the last ones are held.
    pub inputs: Vec<Vec<f64>>,
    /// True when the last states are an equilibrium under the last inputs.
    pub rests: bool,
}

impl Nominal {
    /// Puts knots on the samples of `plant`: between two knots the plant is advanced from the first of them, so that a
    /// plan that fits the samples is met exactly. After the last knot the state is held where an equilibrium exists
    /// for some input and some values of the sampled states.
    ///
    /// # Errors
    /// Knots that do not rise or do not span one sample, or functions without a value.
    pub fn new(plant: &mut Sampled<'_>, knots: &Knots<'_>) -> Result<Nominal, Error> {
        let sample_time = plant.sample_time();
        let (Some(&start), Some(&end)) = (knots.time.first(), knots.time.last()) else {
            return Err(Error::Trajectory("it has no knots".into()));
        };
        if let Some(pair) = knots
            .time
            .windows(2)
            .find(|pair| pair[1].partial_cmp(&pair[0]) != Some(std::cmp::Ordering::Greater))
        {
            return Err(Error::Trajectory(format!(
                "times do not rise: {} s is followed by {} s; make each knot later than the one before",
                pair[0], pair[1]
            )));
        }
        let count = ((end - start) / sample_time - 1e-6).ceil();
        if count < 1.0 {
            return Err(Error::Trajectory(format!(
                "it lasts {} s, less than one sample of {sample_time} s; shorten the sample time or plan longer",
                end - start
            )));
        }
        if count > MAX_SAMPLES {
            return Err(Error::Trajectory(format!(
                "{count} samples of {sample_time} s; at most {MAX_SAMPLES} are possible, lengthen the sample time"
            )));
        }
        let (mut states, mut inputs): (Vec<Vec<f64>>, Vec<Vec<f64>>) = (Vec::new(), Vec::new());
        let mut knot = 0;
        for k in 0..count as usize {
            let time = start + k as f64 * sample_time;
            let slack = 1e-6 * sample_time;
            let mut from = None;
            while knot < knots.time.len() && knots.time[knot] <= time + slack {
                from = Some(knot);
                knot += 1;
            }
            let state = match from {
                Some(at) => {
                    let input = knots.input(knots.time[at]);
                    let point = Point { time: knots.time[at], states: &knots.states[at], inputs: &input };
                    let late = time - knots.time[at];
                    if late > slack { plant.advance(point, late)? } else { knots.states[at].clone() }
                }
                None => {
                    let point =
                        Point { time: time - sample_time, states: &states[k - 1], inputs: &inputs[k - 1] };
                    plant.advance(point, sample_time)?
                }
            };
            states.push(state);
            inputs.push(knots.input(time));
        }
        let last = knots.states[knots.time.len() - 1].clone();
        let size = size(&states);
        let (state, input, rests) = rest(plant, end, last, inputs[inputs.len() - 1].clone(), &size)?;
        states.push(state);
        inputs.push(input);
        Ok(Nominal { start, sample_time, states, inputs, rests })
    }

    /// Number of samples before the hold.
    pub fn samples(&self) -> usize {
        self.states.len() - 1
    }

    /// Time of sample `k` \[s\].
    pub fn time(&self, k: usize) -> f64 {
        self.start + k as f64 * self.sample_time
    }

    /// Span of every state (`[n_x]`) and every input (`[n_u]`) along the trajectory; where one does not move its
    /// magnitude, and 1 where that is zero.
    pub fn spans(&self) -> (Vec<f64>, Vec<f64>) {
        (size(&self.states), size(&self.inputs))
    }
}

impl Knots<'_> {
    /// Inputs at a time \[s\].
    pub(super) fn input(&self, time: f64) -> Vec<f64> {
        let slack = 1e-9 * (1.0 + time.abs());
        let after = self.time.partition_point(|&knot| knot <= time + slack);
        let before = after.saturating_sub(1);
        if after == self.time.len() || self.interpolation == Interpolation::Hold {
            return self.inputs[before].clone();
        }
        let part = ((time - self.time[before]) / (self.time[after] - self.time[before])).clamp(0.0, 1.0);
        self.inputs[before].iter().zip(&self.inputs[after]).map(|(a, b)| a + part * (b - a)).collect()
    }
}

pub(super) fn size(rows: &[Vec<f64>]) -> Vec<f64> {
    let width = rows.first().map_or(0, Vec::len);
    (0..width)
        .map(|i| {
            let values = || rows.iter().map(|row| row[i]);
            let (low, high) = (values().fold(f64::MAX, f64::min), values().fold(f64::MIN, f64::max));
            let magnitude = low.abs().max(high.abs());
            let spans = high - low > 1e-9 * magnitude;
            if spans {
                high - low
            } else if magnitude > 0.0 {
                magnitude
            } else {
                1.0
            }
        })
        .collect()
}

/// The state with inputs and sampled states such that every rate is zero, by Newton's method in the least-squares
/// sense; as it was given where there are none.
pub(super) fn rest(
    plant: &mut Sampled<'_>,
    time: f64,
    state: Vec<f64>,
    input: Vec<f64>,
    size: &[f64],
) -> Result<(Vec<f64>, Vec<f64>, bool), Error> {
    let held = plant.held().to_vec();
    let dimensions = plant.dynamics().size();
    let (n, arguments) = (dimensions.states, dimensions.arguments());
    let unknown: Vec<usize> = held.into_iter().chain(n..arguments).collect();
    let (mut x, mut u) = (state.clone(), input.clone());
    let mut values = vec![0.0; dimensions.values()];
    let mut jacobian = vec![0.0; dimensions.values() * arguments];
    for _ in 0..ROUNDS {
        let at = Point { time, states: &x, inputs: &u };
        plant.dynamics().jacobian(at, &mut values, &mut jacobian).map_err(Error::at(time))?;
        if (0..n).all(|i| values[i].abs() <= MAX_RATE_AT_REST * size[i]) {
            return Ok((x, u, true));
        }
        let rates = DVector::from_fn(n, |i, _| values[i] / size[i]);
        let slopes =
            DMatrix::from_fn(n, unknown.len(), |i, j| jacobian[i * arguments + unknown[j]] / size[i]);
        let Ok(step) = spectral::svd(slopes, true, true).solve(&rates, 1e-12) else { break };
        for (&argument, step) in unknown.iter().zip(&step) {
            if argument < n { x[argument] -= step } else { u[argument - n] -= step }
        }
        if !step.iter().all(|step| step.is_finite()) {
            break;
        }
    }
    Ok((state, input, false))
}
