//! Steps of a search whose models were held out: what each effect takes away beyond the model before it.

use super::model::Study;
use super::search::Selection;
use crate::answer::{Step, Tried};
use crate::order::descending;

/// The steps of a selection, its single candidates beside the first; a model that was not held out is none.
pub fn held_out(study: &Study, selection: &Selection) -> Vec<Step> {
    let whole = selection.declared.held_out;
    if !(whole > 0.0 && whole.is_finite()) {
        return Vec::new();
    }
    let tried = |c: usize, gain: f64, rejected: Option<String>| {
        let own = &study.candidates[c];
        Tried { id: own.name(), port: Some(own.port.clone()), held_out_gain: gain, rejected }
    };
    let mut found = Vec::new();
    for (k, (added, error)) in selection.path.iter().enumerate() {
        let mut candidates: Vec<Tried> = Vec::new();
        if let Some((next, after)) = selection.path.get(k + 1) {
            let joined: Vec<usize> = next.iter().copied().filter(|c| !added.contains(c)).collect();
            let kept = |c: usize| selection.best.added.contains(&c);
            let gone = "other effects took its place".to_owned();
            candidates.extend(
                joined
                    .into_iter()
                    .map(|c| tried(c, (error - after) / whole, (!kept(c)).then(|| gone.clone()))),
            );
        }
        let others = selection.singles.iter().filter(|model| k == 0 && model.held_out.is_finite());
        for model in others {
            let c = model.added[0];
            if candidates.iter().any(|own| own.id == study.candidates[c].name()) {
                continue;
            }
            let equal = selection.equals.iter().any(|(_, own)| own.added.contains(&c));
            let why = if equal {
                "these records cannot tell it from the selected effect"
            } else if selection.exact {
                "it leaves more than noise"
            } else {
                "it takes less away than others"
            };
            candidates.push(tried(c, (whole - model.held_out) / whole, Some(why.into())));
        }
        descending(&mut candidates, |own| own.held_out_gain);
        if !candidates.is_empty() {
            let model = added.iter().map(|&c| study.candidates[c].name()).collect();
            found.push(Step { model, candidates });
        }
    }
    found
}
