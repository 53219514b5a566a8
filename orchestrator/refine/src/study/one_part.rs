//! Candidates that fit the estimation records well and that one part of these alone bears out: what is held out refuses
//! them, as no other part shows them, and nobody learns that a second record of that kind would tell.

use super::model::Study;
use super::simulate::Piece;
use crate::engine::normal::residuals;
use crate::engine::question::{Found, Question};

/// Share of the power that corrections leave which a candidate has to take away, and the share of that in one part.
const MIN_SHARE: f64 = 0.5;
const MIN_SHARE_OF_PART: f64 = 0.8;

/// A sentence on candidates of the first step that were refused and do most of what they do in one part of the
/// estimation records, if there are some.
pub fn told(study: &Study, question: &Question, pieces: &[Piece], found: &Found) -> Option<String> {
    let step = found.steps.first().filter(|_| pieces.len() > 1)?;
    let records: Vec<usize> = (0..pieces.len()).collect();
    let powers = |p: &[f64], locals: &[Vec<f64>]| -> Vec<f64> {
        let own = residuals(question.system, &records, p, locals);
        own.iter().map(|own| own.iter().map(|r| r * r).sum()).collect()
    };
    let base = powers(&found.base.fit.parameters, &found.base.fit.locals);
    let whole_power: f64 = base.iter().sum();
    let mut part: Option<usize> = None;
    let mut names = Vec::new();
    let mut most = 0.0f64;
    let refused =
        step.tried.iter().filter(|own| own.held_out < 0.0 && !found.best.added.contains(&own.candidate));
    for own in refused {
        let Some(candidate) = study.candidates.get(own.candidate) else { continue };
        let fit = &own.model.fit;
        let left = powers(&fit.parameters, &fit.locals);
        // Where it acts: what its own model leaves without it.
        let mut p = fit.parameters.clone();
        candidate.entries.clone().for_each(|index| p[index] = 0.0);
        let idle = powers(&p, &fit.locals);
        let Some(best) = acting_in(whole_power, &idle, &left) else { continue };
        if part.is_none_or(|own| own == best) {
            part = Some(best);
            names.push(format!("`{}`", candidate.name()));
            most = most.max(1.0 - left.iter().sum::<f64>() / whole_power);
        }
    }
    let piece = &pieces[part?];
    let record = &study.records[piece.record];
    let at = |k: usize| k as f64 * record.step;
    Some(format!(
        "Only one part of the estimation records bears out {}: {:.1} to {:.1} s after the begin of {}, where up to {:.0} % of the squared error of all goes. Held out, it cannot be foretold, and no other part shows it: give a second estimation record of that kind.",
        names.join(", "),
        at(piece.range.start),
        at(piece.range.end),
        record.name,
        100.0 * most
    ))
}

/// The one part in which a candidate acts that takes much of a power away: `idle` and `left` are the powers of its
/// model without and with it, by part.
fn acting_in(power: f64, idle: &[f64], left: &[f64]) -> Option<usize> {
    let gains: Vec<f64> = idle.iter().zip(left).map(|(before, after)| (before - after).max(0.0)).collect();
    let best = (0..gains.len()).max_by(|&a, &b| gains[a].total_cmp(&gains[b]))?;
    let much = left.iter().sum::<f64>() <= (1.0 - MIN_SHARE) * power;
    (much && gains[best] >= MIN_SHARE_OF_PART * gains.iter().sum::<f64>()).then_some(best)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_acts_in_the_part_that_reaches_it() {
        assert_eq!(acting_in(100.0, &[2.0, 90.0, 3.0], &[2.0, 10.0, 3.0]), Some(1));
        // Everywhere, and too little.
        assert_eq!(acting_in(100.0, &[50.0, 60.0, 40.0], &[2.0, 3.0, 1.0]), None);
        assert_eq!(acting_in(100.0, &[2.0, 90.0, 3.0], &[2.0, 70.0, 3.0]), None);
    }
}
