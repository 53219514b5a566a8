//! Errors of measured derivatives by smoothing, from a model: where motion is sharper than the filter, a filtered
//! derivative is not the state, and a simulation that starts there is wrong whatever the model.
//!
//! The model's derivatives at the measured states and inputs are integrated (sharp as the inputs are, slowly drifting,
//! which a filter lets pass); the filtered motion less the motion is the error.

use super::columns::processed;
use super::declaration::{Initial, InitialWord, Signal};
use super::model::Study;
use super::read::Record;
use super::simulate::View;

/// Errors of the measured states of a record, `[nx][n]`; none for states that are no derivatives.
pub type Errors = Vec<Option<Vec<f64>>>;

/// Errors of all records under the model of a view with the parameters `p`.
pub fn errors(view: &View, p: &[f64]) -> Vec<Errors> {
    let study = view.study;
    study.records.iter().map(|record| of(view, record, p).unwrap_or_default()).collect()
}

/// The signal of a state, if it is a smoothed derivative.
fn derivative(study: &Study, state: usize) -> Option<&Signal> {
    let signal = study.sensors.signals[1].get(state)?.as_ref()?;
    let smooth = signal.low_pass_hz.is_some() || signal.savitzky_golay_points.is_some();
    (signal.derivative_of.is_some() && smooth).then_some(signal)
}

fn of(view: &View, record: &Record, p: &[f64]) -> Option<Errors> {
    let study = view.study;
    let states: Vec<usize> = (0..record.states.len()).filter(|&i| derivative(study, i).is_some()).collect();
    let measured = study.windows.is_some() || record.initial == Initial::Word(InitialWord::Measured);
    // States of sampled components, and those without a column, are not known at every sample.
    if !measured || states.is_empty() || study.sampled || record.states.iter().any(Option::is_none) {
        return None;
    }
    let rates = rates(view, record, &states, p)?;
    let mut found: Errors = vec![None; record.states.len()];
    for (rates, &i) in rates.iter().zip(&states) {
        let signal = derivative(study, i)?;
        found[i] = Some(error(rates, signal, record.step, record.ends));
    }
    Some(found)
}

/// Mean rates of some states over each step, `[states][n - 1]`; none where the system cannot be evaluated.
fn rates(view: &View, record: &Record, states: &[usize], p: &[f64]) -> Option<Vec<Vec<f64>>> {
    let study = view.study;
    let mut plant = study.take().ok()?;
    let (mut x, mut dx) = (vec![0.0; plant.nx], vec![0.0; plant.nx]);
    plant.set_inputs(&record.inputs, 0);
    plant.initialize(&[], &view.parameters(p), 0.0, &mut x, &|_, value, _| value).ok()?;
    let mut blocks = view.blocks(p, false);
    let mut found = vec![Vec::with_capacity(record.n); states.len()];
    for k in 0..record.n - 1 {
        let mut mean = vec![0.0; states.len()];
        for part in [0, 1] {
            for (slot, values) in record.inputs.iter().enumerate() {
                if let Some(values) = values {
                    plant.slots[slot] = values[if study.held[slot] { k } else { k + part }];
                }
            }
            let first = plant.extra_first;
            for (slot, values) in record.extra.iter().enumerate() {
                plant.slots[first + slot] = values[k];
            }
            for (value, measured) in x.iter_mut().zip(record.states.iter().flatten()) {
                *value = measured[k + part];
            }
            let time = (k + part) as f64 * record.step;
            let block = |tap: usize, value: f64, slots: &[f64]| blocks.pass(tap, value, slots);
            plant.evaluate(time, &x, &mut dx, &block).ok()?;
            mean.iter_mut().zip(states).for_each(|(sum, &i)| *sum += 0.5 * dx[i]);
        }
        blocks.advance(record.step);
        found.iter_mut().zip(&mean).for_each(|(own, mean)| own.push(*mean));
    }
    study.give(plant);
    found.iter().flatten().all(|rate| rate.is_finite()).then_some(found)
}

/// Error that the filter of `signal` makes of the motion of these rates, one more value than those; `ends`: whether its
/// file begins and ends there.
fn error(rates: &[f64], signal: &Signal, step: f64, ends: [bool; 2]) -> Vec<f64> {
    let reach = match (signal.low_pass_hz, signal.savitzky_golay_points) {
        (Some(corner), _) => (4.0 / (corner * step)).ceil() as usize,
        (None, Some(points)) => points,
        (None, None) => 2,
    };
    // Where a segment ends inside its file, the filter saw more motion: it goes on as it was.
    let [before, after] = ends.map(|end| if end { 0 } else { reach });
    let (first, last) = (rates.first().copied().unwrap_or(0.0), rates.last().copied().unwrap_or(0.0));
    let more = |rate: f64, count: usize| std::iter::repeat_n(rate, count);
    let all = more(first, before).chain(rates.iter().copied()).chain(more(last, after));
    let mut motion = vec![0.0];
    let mut sum = 0.0;
    motion.extend(all.map(|rate| {
        sum += step * rate;
        sum
    }));
    let mut place = 0.0;
    let mut path = vec![0.0];
    path.extend(motion.windows(2).map(|pair| {
        place += 0.5 * step * (pair[0] + pair[1]);
        place
    }));
    let smooth = processed(path, &Signal { scale: None, ..signal.clone() }, step);
    let found = smooth.iter().zip(&motion).map(|(smooth, sharp)| smooth - sharp);
    found.skip(before).take(rates.len() + 1).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A body that a constant force seizes at 0.5 s: velocity rate `[n - 1]`, velocity and position `[n]` in closed
    /// form.
    fn seized(n: usize, step: f64) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let since = |k: usize| (k as f64 * step - 0.5).max(0.0);
        let rates = (0..n - 1).map(|k| 2.0 * (since(k + 1) - since(k)) / step).collect();
        let velocity = (0..n).map(|k| 2.0 * since(k)).collect();
        let position = (0..n).map(|k| since(k).powi(2)).collect();
        (rates, velocity, position)
    }

    #[test]
    fn the_error_is_what_the_filter_makes_of_the_measured_motion() {
        let (n, step) = (1200, 1e-3);
        let (rates, velocity, position) = seized(n, step);
        let derivative_of = Some("x".to_owned());
        let filters = [(Some(40.0), None), (None, Some(21))];
        for (low_pass_hz, savitzky_golay_points) in filters {
            let signal = Signal {
                low_pass_hz,
                savitzky_golay_points,
                derivative_of: derivative_of.clone(),
                ..Default::default()
            };
            let measured = processed(position.clone(), &signal, step);
            let found = error(&rates, &signal, step, [true, true]);
            let largest = found.iter().fold(0.0f64, |a, b| a.max(b.abs()));
            assert!(largest > 1e-3, "{largest}");
            for (k, own) in found.iter().enumerate() {
                assert!((own - (measured[k] - velocity[k])).abs() < 1e-4 * largest, "{k}: {own}");
            }
            // A segment inside the file has the same errors.
            let inside = error(&rates[400..799], &signal, step, [false, false]);
            for (own, whole) in inside.iter().zip(&found[400..800]) {
                assert!((own - whole).abs() < 1e-3 * largest, "{own} {whole}");
            }
        }
    }
}
