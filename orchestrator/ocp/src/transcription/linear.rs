//! The states that are advanced exactly: which they are, and their flow under held inputs.

use nalgebra::DMatrix;

use super::dynamics::Point;
use super::error::Error;
use super::mesh::Mesh;
use super::problem::{Duration, Phase, Shooting};
use super::scheme::Sample;

/// States of the sampled block where one is declared, else the largest set of states that form a linear system.
///
/// # Errors
/// [`Error::NotLinear`] names a declared state that does not fit.
pub(super) fn sampled_states(phase: &Phase) -> Result<Vec<usize>, Error> {
    let dynamics = &phase.dynamics[0];
    let structure = dynamics.structure();
    match &phase.shooting {
        Shooting::Steps(_) => {
            let all: Vec<usize> = (0..dynamics.size().states).collect();
            Ok(structure.linear_states(&all))
        }
        Shooting::Sampled { states, .. } => {
            let linear = structure.linear_states(states);
            match states.iter().find(|state| !linear.contains(state)) {
                None => Ok(linear),
                Some(&state) => Err(Error::NotLinear {
                    phase: phase.name.clone(),
                    state: dynamics.names().get(state).cloned().unwrap_or_default(),
                }),
            }
        }
    }
}

/// Length of interval `k`, s, of a phase whose duration is fixed.
fn seconds(duration: f64, mesh: &Mesh, k: usize) -> f64 {
    duration * (mesh.fractions()[k + 1] - mesh.fractions()[k])
}

fn fixed(phase: &Phase, transcription: &'static str, reason: &'static str) -> Result<f64, Error> {
    match phase.duration {
        Duration::Fixed(duration) => Ok(duration),
        Duration::Free { .. } => {
            Err(Error::FreeDuration { phase: phase.name.clone(), transcription, reason })
        }
    }
}

/// Samples in every interval, `[N]`.
pub(super) fn samples(phase: &Phase, mesh: &Mesh, sample_time: f64) -> Result<Vec<usize>, Error> {
    let duration = fixed(phase, "multiple shooting", "an interval is a whole number of samples")?;
    (0..mesh.intervals())
        .map(|interval| {
            let length = seconds(duration, mesh, interval);
            let count = (length / sample_time).round();
            if count >= 1.0 && (count * sample_time - length).abs() <= 1e-9 * duration {
                Ok(count as usize)
            } else {
                Err(Error::Samples { phase: phase.name.clone(), interval, length, sample_time })
            }
        })
        .collect()
}

/// The block after `time` seconds under held inputs: the first rows of `expm([[A, B], [0, 0]] time)`.
pub(super) fn flow(phase: &mut Phase, states: &[usize], time: f64) -> Result<Sample, Error> {
    let matrix = generator(phase, states)?;
    Ok(Sample { states: states.to_vec(), flow: rows(&(matrix * time).exp(), states.len()) })
}

/// The flow over half and the whole of every interval.
pub(super) fn flows(phase: &mut Phase, states: &[usize], mesh: &Mesh) -> Result<Vec<[Sample; 2]>, Error> {
    let duration = match phase.duration {
        Duration::Free { .. } if states.is_empty() => 1.0,
        _ => fixed(phase, "shooting and collocation", "linear states are advanced by matrices of constants")?,
    };
    let matrix = generator(phase, states)?;
    let mut found: Vec<[Sample; 2]> = Vec::with_capacity(mesh.intervals());
    let mut before = f64::NAN;
    for k in 0..mesh.intervals() {
        let length = seconds(duration, mesh, k);
        let same = (length - before).abs() <= 1e-13 * duration;
        let flows = match found.last() {
            Some(last) if same => last.clone(),
            _ => [0.5, 1.0].map(|part| Sample {
                states: states.to_vec(),
                flow: rows(&(&matrix * (part * length)).exp(), states.len()),
            }),
        };
        before = if same { before } else { length };
        found.push(flows);
    }
    Ok(found)
}

fn rows(matrix: &DMatrix<f64>, count: usize) -> Vec<Vec<f64>> {
    (0..count).map(|i| matrix.row(i).iter().copied().collect()).collect()
}

/// `[[A, B], [0, 0]]` of `dz/dt = A z + B u`, from the Jacobian, whose entries there are constant.
fn generator(phase: &mut Phase, states: &[usize]) -> Result<DMatrix<f64>, Error> {
    let dynamics = phase.dynamics[0].as_mut();
    let size = dynamics.size();
    let (count, na) = (states.len(), size.arguments());
    let mut matrix = DMatrix::zeros(count + size.inputs, count + size.inputs);
    if count == 0 {
        return Ok(matrix);
    }
    let (mut values, mut jacobian) = (vec![0.0; size.values()], vec![0.0; size.values() * na]);
    let nominals = dynamics.nominals();
    let zeros = vec![0.0; na];
    let mut at = |q: &[f64]| {
        let (states, inputs) = q.split_at(size.states);
        dynamics.jacobian(Point { time: 0.0, states, inputs }, &mut values, &mut jacobian)
    };
    at(&zeros).or_else(|_| at(&nominals[..na]))?;
    for (i, &state) in states.iter().enumerate() {
        let row = &jacobian[state * na..(state + 1) * na];
        states.iter().enumerate().for_each(|(j, &other)| matrix[(i, j)] = row[other]);
        (0..size.inputs).for_each(|j| matrix[(i, count + j)] = row[size.states + j]);
    }
    Ok(matrix)
}
