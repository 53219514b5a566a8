//! Samples of outputs that stand apart from their neighbors in what the declared model leaves: where the motion is fast
//! they do not show in the records themselves.

use super::declaration::Role;
use super::errors::initial;
use super::fits::{Fits, pieces};
use super::model::Study;
use crate::engine::System;
use crate::engine::fit::Fit;
use crate::spikes;

/// Lets such samples count for no error; sentences on them go to the notes of the study.
pub fn silence(study: &mut Study, declared: &Fit) {
    let states: Vec<usize> =
        (0..study.outputs.len()).filter(|&o| spikes::is_state(&study.outputs[o].unit)).collect();
    // Record, output, samples.
    let mut found: Vec<(usize, usize, Vec<usize>)> = Vec::new();
    let fits = Fits::new(study, vec![1.0; study.outputs.len()]);
    for role in [Role::Estimation, Role::Validation] {
        let (pieces, locals) = if role == Role::Estimation {
            (fits.pieces.clone(), declared.locals.clone())
        } else {
            let pieces = pieces(study, role);
            let locals = initial(&fits, &[], &pieces, &declared.parameters);
            (pieces, locals)
        };
        let view = fits.view(&[], &pieces);
        for (r, piece) in pieces.iter().enumerate() {
            let left = view.residuals(r, &declared.parameters, &locals[r]);
            let (n, record) = (piece.range.len(), &study.records[piece.record]);
            let mut behind = vec![false; n];
            for command in
                record.inputs.iter().zip(&study.held).filter(|own| *own.1).filter_map(|own| own.0.as_ref())
            {
                let jumps = spikes::behind_jumps(&command[piece.range.clone()]);
                behind.iter_mut().zip(jumps).for_each(|(all, own)| *all |= own);
            }
            for &o in &states {
                let measured = &record.outputs[o][piece.range.clone()];
                let own = spikes::find(&left[o * n..(o + 1) * n], measured, &behind);
                let counts = |k: &usize| record.measured[o].as_ref().is_none_or(|counts| counts[*k]);
                let places: Vec<usize> =
                    own.iter().map(|spike| piece.range.start + spike.first).filter(counts).collect();
                if !places.is_empty() {
                    found.push((piece.record, o, places));
                }
            }
        }
    }
    for (record, o, places) in found {
        let (name, own) = (&study.outputs[o].name, &mut study.records[record]);
        let first = format!("{:.6} s behind its begin", own.step * places[0] as f64);
        study.notes.push(spikes::note(&own.name, name, places.len(), &first));
        let measured = own.measured[o].get_or_insert_with(|| vec![true; own.n]);
        places.into_iter().for_each(|k| measured[k] = false);
    }
}
