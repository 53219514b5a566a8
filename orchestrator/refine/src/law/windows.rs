//! Records cut into short windows whose first states are fitted along: a law that makes the motion over a whole record
//! diverge is still nearly linear in a window.

use crate::study::declaration::{Initial, InitialWord};
use crate::study::fits::{Fits, Model};
use crate::study::model::Study;
use crate::study::simulate::{Piece, View};

/// Windows of the longest record.
pub const WINDOWS: usize = 20;
/// Parts that a window of the study is cut into, as far as they hold enough samples.
const PARTS_OF_WINDOW: usize = 3;
/// Fewest samples of a window.
const MIN_SAMPLES: usize = 40;
/// Samples on either side over which a velocity is taken from measured positions.
pub const VELOCITY_SAMPLES: usize = 8;

/// Windows of the estimation records.
#[derive(Debug, Clone)]
pub struct Windows {
    /// Spans.
    pub pieces: Vec<Piece>,
    /// States at their beginnings, `[pieces][nx]`.
    pub begins: Vec<Vec<f64>>,
    /// By state, whether it is known at all beginnings from a measured output that is its derivative.
    pub integrated: Vec<bool>,
}

/// Derivative of measured positions at sample `k`.
pub fn velocity(positions: &[f64], k: usize, step: f64) -> f64 {
    let (before, behind) =
        (k.saturating_sub(VELOCITY_SAMPLES), (k + VELOCITY_SAMPLES).min(positions.len() - 1));
    (positions[behind] - positions[before]) / ((behind - before).max(1) as f64 * step)
}

/// Positions over time from their first value and measured velocities, by the trapezoidal rule; `step` \[s\].
pub fn positions(first: f64, velocities: &[f64], step: f64) -> Vec<f64> {
    let mut x = first;
    let rest = velocities.windows(2).map(|pair| {
        x += 0.5 * step * (pair[0] + pair[1]);
        x
    });
    std::iter::once(first).chain(rest).collect()
}

/// Where a state is seen: the output that is the state, the output whose derivative it is, or the output that is its
/// derivative.
#[derive(Clone, Copy)]
enum Seen {
    Output(usize),
    Rate(usize),
    Integral(usize),
}

/// By state, where measured outputs show it.
fn seen(study: &Study) -> Option<Vec<Option<Seen>>> {
    let plant = study.take().ok()?;
    let mut found = vec![None; plant.nx];
    for (o, output) in study.outputs.iter().enumerate() {
        if let Some(state) = plant.state(&output.port) {
            found[state] = Some(Seen::Output(o));
        }
    }
    for tap in &study.taps {
        let [velocity, position] = [&tap.attachment.velocity, &tap.attachment.position]
            .map(|name| name.as_ref().and_then(|name| plant.state(name)));
        if let (Some(velocity), Some(position)) = (velocity, position)
            && let (None, Some(Seen::Output(o))) = (found[velocity], found[position])
        {
            found[velocity] = Some(Seen::Rate(o));
        } else if let (Some(velocity), Some(position)) = (velocity, position)
            && let (Some(Seen::Output(o)), None) = (found[velocity], found[position])
        {
            found[position] = Some(Seen::Integral(o));
        }
    }
    study.give(plant);
    Some(found)
}

impl Windows {
    /// So many windows of the longest record with states as measured, and of a model where they are not; none where a
    /// simulation cannot start anywhere, or restarts at least as often in windows of the study.
    pub fn new(fits: &Fits, base: &Model, windows: usize) -> Option<Windows> {
        let study = fits.study;
        if study.sampled {
            return None;
        }
        let seen = seen(study).filter(|own| !own.is_empty())?;
        let longest = fits.pieces.iter().map(|piece| piece.range.len()).max()?;
        let restarts = |piece: &Piece| study.window(study.records[piece.record].step);
        let restarted = fits.pieces.iter().filter_map(restarts).min().unwrap_or(usize::MAX);
        let length = (longest / windows).min(restarted / PARTS_OF_WINDOW).max(MIN_SAMPLES);
        if restarted <= length {
            return None;
        }
        let view = fits.view(&base.added, &fits.pieces);
        let (mut pieces, mut begins) = (Vec::new(), Vec::new());
        for (r, piece) in fits.pieces.iter().enumerate() {
            let record = &study.records[piece.record];
            let (_, states) = view.traced(r, &base.fit.parameters, &base.fit.locals[r]);
            // A model that lacks a law makes positions drift away that measured velocities keep.
            let places: Vec<Vec<f64>> = seen
                .iter()
                .enumerate()
                .map(|(i, own)| match (own, states.first()) {
                    (Some(Seen::Integral(o)), Some(first)) => {
                        positions(first[i], &record.outputs[*o][piece.range.clone()], record.step)
                    }
                    _ => Vec::new(),
                })
                .collect();
            let known = record.initial == Initial::Word(InitialWord::Measured);
            let count = (piece.range.len() / length).max(1);
            for w in 0..count {
                let edge = |w: usize| piece.range.start + piece.range.len() * w / count;
                let k = edge(w);
                let simulated = states.get(k - piece.range.start)?;
                let own = simulated.iter().enumerate().map(|(i, simulated)| {
                    let measured = record.states.get(i).and_then(Option::as_ref).map(|values| values[k]);
                    // The first window starts where the record does.
                    match (measured, seen[i]) {
                        _ if w == 0 && !known => *simulated,
                        (Some(value), _) => value,
                        (None, Some(Seen::Output(o))) => record.outputs[o][k],
                        (None, Some(Seen::Rate(o))) => velocity(&record.outputs[o], k, record.step),
                        (None, Some(Seen::Integral(_))) => places[i][k - piece.range.start],
                        (None, None) => *simulated,
                    }
                });
                begins.push(own.collect());
                pieces.push(Piece { record: piece.record, range: k..edge(w + 1) });
            }
        }
        let finite = begins.iter().flatten().all(|x: &f64| x.is_finite());
        let integrated = seen.iter().map(|own| matches!(own, Some(Seen::Integral(_)))).collect();
        finite.then_some(Windows { pieces, begins, integrated })
    }

    /// The engine's view of the windows with some candidates beside the declared model.
    pub fn view<'a>(&self, fits: &Fits<'a>, added: &[usize]) -> View<'a> {
        View { begins: self.begins.clone(), ..fits.view(added, &self.pieces) }
    }

    /// The same with positions held that follow from measured velocities: a form over them would move each window by
    /// itself to where it fits best.
    pub fn view_along<'a>(&self, fits: &Fits<'a>, added: &[usize]) -> View<'a> {
        View { held: self.integrated.clone(), ..self.view(fits, added) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_follow_from_measured_velocities() {
        let step = 1e-3;
        let velocities: Vec<f64> = (0..2000).map(|k| (3.0 * k as f64 * step).cos()).collect();
        let found = positions(0.5, &velocities, step);
        assert_eq!((found.len(), found[0]), (velocities.len(), 0.5));
        // The trapezoidal rule is off by step^2/12 times the change of the slope, at most 6.
        let worst = found.iter().enumerate().map(|(k, x)| x - 0.5 - (3.0 * k as f64 * step).sin() / 3.0);
        assert!(worst.fold(0.0, |a: f64, b| a.max(b.abs())) < step * step);
    }
}
