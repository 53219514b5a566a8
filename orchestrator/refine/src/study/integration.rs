//! Step of the integration of a study: as small as the noise of its sensors can show.

use super::fits::{Fits, Model};
use super::model::Study;
use super::simulate::{Piece, View};
use super::tolerance;
use crate::engine::fit::Free;
use crate::engine::normal::{columns, dot};
use crate::engine::{System, stop};

/// Steps per sample that are tried.
const SUBSTEPS: [usize; 3] = [1, 2, 4];
/// Steps per sample at most.
const MAX_SUBSTEPS: usize = 2 * SUBSTEPS[SUBSTEPS.len() - 1];
/// The same where fewer are unstable.
pub const MAX_STABLE_SUBSTEPS: usize = 2 * MAX_SUBSTEPS;
/// Error of the integration over the noise of a sensor, rms, up to which it does not show: in sums over 64 samples it
/// gives less than a twentieth of the power of the noise.
const MAX_ERROR_OVER_NOISE: f64 = 0.03;
/// Share of what a model leaves, rms, from which on its integration is to blame.
const MIN_SHARE_OF_LEFT: f64 = 0.3;
/// Records, and samples of each, on which steps are compared.
const COMPARED: (usize, usize) = (3, 4000);

/// Runge-Kutta steps per sample after which half of them change the outputs of the declared model by next to nothing of
/// the noise of their sensors; twice the most that is tried where none does.
pub fn substeps(study: &Study) -> usize {
    let fits = Fits::new(study, vec![1.0; study.outputs.len()]);
    let short = |piece: &Piece| {
        let end = piece.range.end.min(piece.range.start + COMPARED.1);
        Piece { record: piece.record, range: piece.range.start..end }
    };
    let pieces: Vec<Piece> = fits.pieces.iter().take(COMPARED.0).map(short).collect();
    let view = fits.view(&[], &pieces);
    let locals = Fits::locals(&view);
    let outputs = |substeps: usize| -> Vec<Vec<f64>> {
        let view = View { substeps, ..view.clone() };
        (0..pieces.len()).map(|r| view.predict(r, &study.start(), &locals[r])).collect()
    };
    let mut coarse = outputs(SUBSTEPS[0]);
    for count in SUBSTEPS {
        let fine = outputs(2 * count);
        if apart(study, &coarse, &fine) <= MAX_ERROR_OVER_NOISE {
            return count;
        }
        coarse = fine;
    }
    MAX_SUBSTEPS
}

/// Runge-Kutta steps per sample that a model needs, if what it leaves is the error of its integration: friction that it
/// adds changes its sign faster than anything in the declared model.
pub fn finer(fits: &Fits, model: &Model) -> Option<usize> {
    let study = fits.study;
    let most = MAX_SUBSTEPS;
    if study.substeps >= most {
        return None;
    }
    let pieces: Vec<Piece> = fits.pieces.iter().take(COMPARED.0).cloned().collect();
    let view = fits.view(&model.added, &pieces);
    let outputs = |substeps: usize| -> Vec<Vec<f64>> {
        let view = View { substeps, quick: false, ..view.clone() };
        let one = |r: usize| view.predict(r, &model.fit.parameters, &model.fit.locals[r]);
        (0..pieces.len()).map(one).collect()
    };
    let (coarse, finest) = (outputs(study.substeps), outputs(most));
    let measured: Vec<Vec<f64>> = (0..pieces.len()).map(|r| view.measured(r)).collect();
    if apart(study, &coarse, &finest) < MIN_SHARE_OF_LEFT * apart(study, &coarse, &measured) {
        return None;
    }
    let steps = SUBSTEPS.into_iter().filter(|&count| count > study.substeps);
    let enough = |&count: &usize| apart(study, &outputs(count), &finest) <= MAX_ERROR_OVER_NOISE;
    Some(steps.into_iter().find(enough).unwrap_or(most))
}

/// Size of a derivative on one record, over that on another, from which on it is compared with that of finer steps, and
/// the ratio of the two from which on the integration is unstable.
const MAX_RATIO_OF_RECORDS: f64 = 50.0;
const MAX_RATIO_OF_FINER: f64 = 2.0;

/// Whether the derivatives by parameters and initial states around a model are those of the system, and none of an
/// integration at the edge of its stability, where the smallest change of a stiff system throws it off its way.
///
/// A search that is asked to end does not look.
pub fn is_stable(fits: &Fits, model: &Model) -> bool {
    if stop::asked() {
        return true;
    }
    let (study, own) = (fits.study, &model.fit);
    let mut free: Vec<Free> = own.free.clone();
    let corrections = tolerance::corrections(study, 1.0).into_iter().map(|own| own.0);
    free.extend(corrections.filter(|more| own.free.iter().all(|known| known.index != more.index)));
    let view = fits.view(&model.added, &fits.pieces);
    let records: Vec<usize> = (0..fits.pieces.len()).collect();
    let locals: Vec<&[f64]> = own.locals.iter().map(Vec::as_slice).collect();
    // Sizes of the derivatives, `[records][free + locals]`.
    let sizes = |view: &View| -> Vec<Vec<f64>> {
        let found = columns(view, &records, &own.parameters, &free, &locals, true, None);
        let root = |column: &Vec<f64>| dot(column, column).sqrt();
        found.iter().map(|own| own.columns.iter().map(root).collect()).collect()
    };
    let found = sizes(&view);
    let differ = |k: usize| {
        let own = || found.iter().filter_map(|sizes| sizes.get(k));
        let least = own().filter(|size| **size > 0.0).fold(f64::INFINITY, |a, b| a.min(*b));
        own().any(|size| !size.is_finite() || *size > MAX_RATIO_OF_RECORDS * least)
    };
    let count = found.iter().map(Vec::len).max().unwrap_or(0);
    if !(0..count).any(differ) || stop::asked() {
        return true;
    }
    let finer = sizes(&View { quick: false, substeps: 2 * view.substeps, ..view });
    let alike = |(own, finer): (&f64, &f64)| own.is_finite() && *own <= MAX_RATIO_OF_FINER * finer;
    found.iter().flatten().zip(finer.iter().flatten()).all(alike)
}

/// Largest rms difference of two simulations over the noise of an output; infinite where one of them diverges.
fn apart(study: &Study, a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    let outputs = study.outputs.iter().enumerate().filter(|(_, output)| output.noise > 0.0);
    let one = |(o, output): (usize, &super::model::Output)| {
        let (mut sum, mut count) = (0.0, 0);
        for (a, b) in a.iter().zip(b) {
            let n = a.len() / study.outputs.len();
            let own = a[o * n..(o + 1) * n].iter().zip(&b[o * n..(o + 1) * n]);
            sum += own.map(|(a, b)| (a - b).powi(2)).sum::<f64>();
            count += n;
        }
        (sum / count.max(1) as f64).sqrt() / output.noise
    };
    outputs.map(one).fold(0.0, |most, own| if own.is_finite() { own.max(most) } else { f64::INFINITY })
}
