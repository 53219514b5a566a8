//! Errors of models on the records of a role, in the units of the outputs, and as force.

use std::collections::BTreeMap;

use super::declaration::Role;
use super::explain::noises;
use super::fits::{Fits, Model, pieces};
use super::force::ForceView;
use super::model::{Study, Target};
use super::noise::{Column, Noisy};
use super::simulate::{Piece, View};
use super::starts::Starts;
use crate::answer::Errors;
use crate::engine::fit::{Free, fit};
use crate::engine::noise::Noise;
use crate::engine::{System, parallel};

/// Draws of sensor noise for the floor of an error.
const DRAWS: usize = 20;

/// Errors of pieces in the units of the outputs; initial states are fitted where the study says so.
pub fn errors(
    fits: &Fits,
    added: &[usize],
    pieces: &[Piece],
    p: &[f64],
    locals: Option<&[Vec<f64>]>,
) -> Errors {
    if pieces.is_empty() {
        return Errors::default();
    }
    let own = locals.map_or_else(|| initial(fits, added, pieces, p), <[_]>::to_vec);
    errors_from(fits, added, (pieces, &vec![0; pieces.len()]), p, &own)
}

/// The same from a sample of each piece on; `locals`: initial states.
pub(super) fn errors_from(
    fits: &Fits,
    added: &[usize],
    (pieces, from): (&[Piece], &[usize]),
    p: &[f64],
    locals: &[Vec<f64>],
) -> Errors {
    let mut found = Errors::default();
    let view = View { corrected: false, ..fits.view(added, pieces) };
    let mut sums: BTreeMap<String, (f64, f64, f64, f64)> = BTreeMap::new();
    for (r, local) in locals.iter().enumerate() {
        let (predicted, measured) = (view.predict(r, p, local), view.measured(r));
        let mut there = vec![1.0; measured.len()];
        view.silence(r, &mut there);
        for span in view.signals(r) {
            let sum = sums.entry(span.signal).or_default();
            let range = span.range.start + from[r]..span.range.end;
            let there = there[range.clone()].iter();
            let pairs = measured[range.clone()].iter().zip(&predicted[range]).zip(there);
            for ((a, b), _) in pairs.filter(|(_, there)| **there != 0.0) {
                *sum = (sum.0 + 1.0, sum.1 + (a - b).powi(2), sum.2 + a, sum.3 + a * a);
            }
        }
    }
    found.white = white(&view, locals, (p, from));
    for (signal, (n, error, sum, square)) in sums {
        let spread = (square / n - (sum / n).powi(2)).max(f64::MIN_POSITIVE);
        found.rms.insert(signal.clone(), (error / n).sqrt());
        found.nrmse.insert(signal, (error / n / spread).sqrt());
    }
    found
}

/// Rms by output, in multiples of its noise, without what noise of the states gives that windows start from; empty
/// where that is not known.
fn white(view: &View, locals: &[Vec<f64>], (p, from): (&[f64], &[usize])) -> BTreeMap<String, f64> {
    let known = |piece: &Piece| view.study.starts.get(piece.record).is_some_and(Starts::is_known);
    if !view.pieces.iter().all(known) {
        return BTreeMap::new();
    }
    let view = View { scale: noises(view.study), white: true, ..view.clone() };
    let mut sums: BTreeMap<String, (f64, f64)> = BTreeMap::new();
    for (r, local) in locals.iter().enumerate() {
        let residuals = view.residuals(r, p, local);
        let mut there = vec![1.0; residuals.len()];
        view.silence(r, &mut there);
        for span in view.signals(r) {
            let sum = sums.entry(span.signal).or_default();
            let range = span.range.start + from[r]..span.range.end;
            let own = residuals[range.clone()].iter().zip(&there[range]).filter(|(_, there)| **there != 0.0);
            *sum = own.fold(*sum, |sum, (value, _)| (sum.0 + 1.0, sum.1 + value * value));
        }
    }
    sums.into_iter().map(|(signal, (n, square))| (signal, (square / n).sqrt())).collect()
}

/// Initial states of pieces, fitted where the study says so.
pub fn initial(fits: &Fits, added: &[usize], pieces: &[Piece], p: &[f64]) -> Vec<Vec<f64>> {
    fits.grow(added, pieces, p, &[], &[0.1, 0.3, 1.0], 12).locals
}

/// Error by signal that a true model shows on the records of a role: noise and rounding of the sensors, and what
/// smoothing takes from measured derivatives, carried to the outputs and to the force residual.
pub fn floor(fits: &Fits, model: &Model, role: Role, seed: u64) -> BTreeMap<String, f64> {
    let (study, pieces) = (fits.study, pieces(fits.study, role));
    let (p, added) = (&model.fit.parameters, &model.added);
    let locals = match role {
        Role::Estimation => model.fit.locals.clone(),
        _ => initial(fits, added, &pieces, p),
    };
    let scale = vec![1.0; study.outputs.len()];
    let view = View { corrected: false, white: false, scale, ..fits.view(added, &pieces) };
    let noisy = Noisy::new(&view, p, &locals, seed);
    let found = parallel::map(pieces.len(), |r| {
        let (predicted, bias) = (view.predict(r, p, &locals[r]), noisy.bias(r));
        let mut powers = vec![0.0; study.outputs.len()];
        let n = pieces[r].range.len();
        for draw in 0..DRAWS {
            let mut noise = Noise::new(seed, (draw * pieces.len() + r) as u64);
            let own = noisy.redraw(r, &predicted, &mut noise);
            let one = |o: usize| own[o * n..(o + 1) * n].iter().map(|e| e * e).sum::<f64>() / DRAWS as f64;
            powers.iter_mut().enumerate().for_each(|(o, power)| *power += one(o));
        }
        let own = |o: usize| bias.iter().skip(o * n).take(n).map(|e| e * e).sum::<f64>();
        powers.iter_mut().enumerate().for_each(|(o, power)| *power += own(o));
        powers
    });
    let count = |o: usize| {
        let own = |piece: &Piece| match &study.records[piece.record].measured[o] {
            Some(measured) => measured[piece.range.clone()].iter().filter(|there| **there).count(),
            None => piece.range.len(),
        };
        pieces.iter().map(own).sum::<usize>().max(1) as f64
    };
    let power = |o: usize| found.iter().map(|own| own[o]).sum::<f64>() / count(o);
    let outputs = study.outputs.iter().enumerate();
    let mut floor: BTreeMap<String, f64> =
        outputs.map(|(o, output)| (output.name.clone(), power(o).sqrt())).collect();
    if let Some((.., name)) = &study.force {
        let view = ForceView { view: fits.view(added, &pieces), scale: 1.0 };
        floor.insert(name.clone(), view.noise(p, seed).hypot(inside(study)));
    }
    floor
}

/// Force residual before and after on the records of a role, refitted on the force; empty without a rule.
pub fn force(fits: &Fits, added: &[usize], p: &[f64], roles: [Role; 2]) -> [Errors; 2] {
    let study = fits.study;
    if study.force.is_none() {
        return [Errors::default(), Errors::default()];
    }
    let of = |pieces: Vec<Piece>| ForceView { view: fits.view(added, &pieces), scale: 1.0 };
    let estimation = of(pieces(study, Role::Estimation));
    let free: Vec<Free> = fits
        .free(added)
        .into_iter()
        .filter(|free| !matches!(study.entries[free.index].target, Target::Offset))
        .collect();
    let records: Vec<usize> = (0..estimation.records()).collect();
    let none = vec![Vec::new(); records.len()];
    let found = fit(&estimation, &records, p, &free, &none, 25);
    roles.map(|role| {
        let view = of(pieces(study, role));
        let residuals: Vec<f64> =
            (0..view.records()).flat_map(|r| view.predict(r, &found.parameters, &[])).collect();
        let rms = (residuals.iter().map(|r| r * r).sum::<f64>() / residuals.len().max(1) as f64).sqrt();
        let mut errors = Errors::default();
        if let Some((.., name)) = &study.force {
            errors.rms.insert(name.clone(), rms);
            let spread = view.spread();
            errors.nrmse.insert(name.clone(), if spread > 0.0 { rms / spread } else { 0.0 });
        }
        errors
    })
}

/// Column of the driving force and what its sensor shows, with the corner of the low-pass \[Hz\] and the step \[s\].
fn driving(study: &Study) -> Option<(Column, f64, f64)> {
    let (rule, ..) = study.force.as_ref()?;
    let record = study.records.first()?;
    let list = study.sensors.signals[0].iter().zip(&record.factors[0]);
    let (signal, factor) = list.filter_map(|(signal, factor)| Some((signal.as_ref()?, factor))).next()?;
    let own = study.sensors.of(signal.source()?);
    let scaled = Column { white: own.white * factor.abs(), quantum: own.quantum * factor.abs() };
    Some((scaled, rule.low_pass_hz, record.step))
}

/// Noise of the driving force: what the low-pass of the force residual takes away.
pub fn force_noise(study: &Study) -> f64 {
    driving(study).map_or(1.0, |(column, ..)| column.rms().max(1e-12))
}

/// The share of it that is as fast as what the low-pass lets through, if it is white.
fn inside(study: &Study) -> f64 {
    let share = |(column, corner, step): (Column, f64, f64)| {
        let part = (2.0 * corner * step).min(0.5);
        column.rms() * (part / (1.0 - part)).sqrt()
    };
    driving(study).map_or(0.0, share)
}
