//! States whose initial values no output shows: nothing can be fitted to them.

use super::fits::Fits;
use super::model::Study;
use super::simulate::{Piece, View};
use crate::engine::System;

/// Samples of a record that are simulated.
const SAMPLES: usize = 2000;

/// For every state, whether the outputs of the declared model are the same to the last bit wherever it begins.
pub fn unseen(study: &Study) -> Vec<bool> {
    let fits = Fits::new(study, vec![1.0; study.outputs.len()]);
    let fitted = |piece: &&Piece| {
        let view = fits.view(&[], std::slice::from_ref(piece));
        !view.locals(0).is_empty()
    };
    let Some(piece) = fits.pieces.iter().find(fitted) else { return Vec::new() };
    let end = piece.range.end.min(piece.range.start + SAMPLES);
    let piece = Piece { record: piece.record, range: piece.range.start..end };
    let view: View = fits.view(&[], &[piece]);
    let (p, locals) = (study.start(), Fits::locals(&view).remove(0));
    let bits =
        |locals: &[f64]| -> Vec<u64> { view.predict(0, &p, locals).into_iter().map(f64::to_bits).collect() };
    let base = bits(&locals);
    let same = |state: usize| {
        let moved = |by: f64| {
            let mut moved = locals.clone();
            moved[state] += by * moved[state].abs().max(1.0);
            bits(&moved) == base
        };
        moved(1e-3) && moved(-1e-3)
    };
    (0..locals.len()).map(same).collect()
}
