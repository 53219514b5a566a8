//! Coulomb friction that is there only to say over which velocity other friction changes its sign.
//!
//! Where no attachment declares that velocity, friction of other shapes takes it from Coulomb friction that is fitted
//! beside it. If the declared model has all of the level, that friction does nothing: the velocity is the attachment's
//! then.

use super::exact;
use super::explain::Judge;
use super::fits::{Fits, Model};
use super::law::Law;
use super::model::{Action, Study};
use super::search::Selection;

/// Ratio of the error without it to that with it, up to which nothing is lost.
const MAX_ERROR_RATIO: f64 = 1.002;

/// The selection without such friction; as it is where that explains less.
pub fn settle(study: &mut Study, scale: &[f64], judge: &Judge, selection: Selection) -> Selection {
    let Some((c, tap, vt)) = beside(study, &selection.best) else { return selection };
    let before = std::mem::replace(&mut study.taps[tap].vt, vt);
    let fits = Fits::new(study, scale.to_vec());
    let own = &selection.best;
    let added: Vec<usize> = own.added.iter().copied().filter(|&other| other != c).collect();
    let mut p = own.fit.parameters.clone();
    study.candidates[c].entries.clone().for_each(|index| p[index] = 0.0);
    let fitted = fits.fit_from(added, &p, &own.fit.locals);
    let fitted = fitted.map(|model| if selection.exact { exact::refitted(&fits, &model) } else { model });
    let stands = |model: &Model| match selection.exact {
        true => judge.explained(&fits, model),
        false => model.error <= MAX_ERROR_RATIO * own.error,
    };
    match fitted.filter(stands) {
        Some(best) => {
            let best = Model { held_out: own.held_out, parts: own.parts.clone(), ..best };
            Selection { best, ..selection }
        }
        None => {
            study.taps[tap].vt = before;
            selection
        }
    }
}

/// Coulomb friction that is fitted with the velocity of its sign change and that other friction needs: its place, its
/// port, and that velocity.
fn beside(study: &Study, model: &Model) -> Option<(usize, usize, f64)> {
    model.added.iter().find_map(|&c| {
        let own = &study.candidates[c];
        let Action::Block { law: Law::Coulomb, tap } = own.action else { return None };
        let is_needed = model.added.iter().any(|&other| study.candidates[other].needs == Some(c));
        let fitted = own.entries.len() == 2 && is_needed;
        fitted.then(|| (c, tap, model.fit.parameters[own.entries.start + 1]))
    })
}
