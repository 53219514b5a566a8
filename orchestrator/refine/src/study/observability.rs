//! States that no measured output shows: no initial value can be fitted to them.

use super::fits::Fits;
use super::model::Study;
use super::simulate::Piece;
use crate::engine::System;

/// Samples of each record that are simulated.
const SAMPLES: usize = 2000;
/// Changes of an initial state, relative to it or to 1.
const CHANGES: [f64; 2] = [1e-3, -1e-3];

/// Whether each state, `[nx]`, is unobservable: the outputs of the declared model are the same to the last bit in every
/// record, wherever it begins. Empty where no initial states are fitted.
pub fn unobservable(study: &Study) -> Vec<bool> {
    let fits = Fits::new(study, vec![1.0; study.outputs.len()]);
    let short = |piece: &Piece| {
        let end = piece.range.end.min(piece.range.start + SAMPLES);
        Piece { record: piece.record, range: piece.range.start..end }
    };
    let pieces: Vec<Piece> = fits.pieces.iter().map(short).collect();
    let view = fits.view(&[], &pieces);
    let (p, all) = (study.start(), Fits::locals(&view));
    let mut found = vec![true; all.iter().map(Vec::len).max().unwrap_or(0)];
    for (r, locals) in all.iter().enumerate().filter(|(_, locals)| !locals.is_empty()) {
        let bits = |locals: &[f64]| -> Vec<u64> {
            view.predict(r, &p, locals).into_iter().map(f64::to_bits).collect()
        };
        let base = bits(locals);
        for (state, unobservable) in found.iter_mut().enumerate() {
            let same = |change: &f64| {
                let mut moved = locals.clone();
                moved[state] += change * moved[state].abs().max(1.0);
                bits(&moved) == base
            };
            *unobservable = *unobservable && CHANGES.iter().all(same);
        }
    }
    found
}
