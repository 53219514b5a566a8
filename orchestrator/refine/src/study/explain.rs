//! Variables that the residual of a model depends on: a force of free form over one variable, fitted with the model by
//! the linear step.
//!
//! A free form over such a variable takes away much of the residual, whatever the law may be; sensor noise depends on
//! nothing. [`Judge`] also says when a model leaves no more than sensor noise.

use std::collections::BTreeMap;

use super::fits::{Fits, Model};
use super::law::{Law, Variable};
use super::model::{Action, Study};
use super::noise::Noisy;
use super::simulate::View;
use crate::engine::System;
use crate::engine::goodness::{Null, pooled};
use crate::engine::{parallel, stop};
use crate::order::descending;

/// Powers within this factor of those of the noise are noise: its level is estimated.
const MAX_POWER_OVER_NOISE: f64 = 1.3;
/// Share of the residual power that a free form has to take away.
const MIN_SHARE_OF_EXCESS: f64 = 0.2;
/// Share of the noise power that a free form has to take away.
const MIN_SHARE_OF_NOISE: f64 = 0.1;
/// Share of the residual power that one variable has to explain to be enough.
const MIN_SHARE_OF_ONE_VARIABLE: f64 = 0.6;
/// A second variable has to add this share of what the first takes away.
const MIN_SHARE_OF_SECOND_VARIABLE: f64 = 0.3;
/// Draws of the null at most, once the search is asked to end.
const DRAWS_AT_THE_END: usize = 50;

/// Residual of a model.
#[derive(Debug, Clone, PartialEq)]
pub struct Rest {
    /// Channel and variables that it depends on; none: on nothing that is known.
    pub place: Option<(String, Vec<String>)>,
    /// Power that the free form takes away, in whitened units per sample.
    pub gain: f64,
    /// The same by port, for the best free form over one variable there: nothing where noise is left.
    pub ports: Vec<(String, f64)>,
}

impl Rest {
    /// Nothing but noise.
    pub fn nothing() -> Rest {
        Rest { place: None, gain: 0.0, ports: Vec::new() }
    }
}

/// The null of the estimation records.
#[derive(Debug)]
pub struct Judge {
    null: Null,
    /// Powers that smoothed derivatives give, by output.
    bias: Vec<[f64; 3]>,
    /// Mean power of a whitened sample under the null.
    pub power: f64,
    /// The same with what smoothed derivatives give.
    pub tolerated: f64,
}

impl Judge {
    /// Draws the null around a model.
    pub fn new(fits: &Fits, model: &Model, draws: usize, seed: u64) -> Judge {
        let view = in_noise(fits, model);
        let (p, locals) = (&model.fit.parameters, &model.fit.locals);
        let noisy = Noisy::new(&view, p, locals, seed);
        let records: Vec<usize> = (0..fits.pieces.len()).collect();
        let draws = if stop::asked() { draws.min(DRAWS_AT_THE_END) } else { draws };
        let null = Null::simulate(&noisy, &records, p, locals, draws, seed);
        let samples: usize = fits.pieces.iter().map(|piece| piece.range.len()).sum();
        let count = (samples * fits.study.outputs.len()).max(1) as f64;
        let bias: Vec<Vec<f64>> = records.iter().map(|&r| noisy.bias(r)).collect();
        let bias = if bias.iter().any(Vec::is_empty) {
            vec![[0.0; 3]; fits.study.outputs.len()]
        } else {
            pooled(&noisy, &records, &bias).into_iter().map(|(_, powers)| powers).collect()
        };
        let scales = fits.study.outputs.iter().map(|output| output.noise).zip(&fits.scale);
        let factors: Vec<f64> = scales.map(|(noise, scale)| (noise / scale).powi(2) / count).collect();
        let sum = |powers: &[[f64; 3]]| powers.iter().zip(&factors).map(|(own, f)| own[0] * f).sum::<f64>();
        let power = sum(null.means());
        let tolerated = power + sum(&bias);
        Judge { null, bias, power, tolerated }
    }

    /// Error that sensors and smoothed derivatives give, by output, in its unit.
    pub fn floor(&self, fits: &Fits) -> Vec<f64> {
        let samples: usize = fits.pieces.iter().map(|piece| piece.range.len()).sum();
        let powers = self.null.means().iter().zip(&self.bias);
        let power = powers.map(|(mean, bias)| (mean[0] + bias[0]) / samples.max(1) as f64);
        let outputs = fits.study.outputs.iter().zip(power);
        outputs.map(|(output, power)| output.noise * power.sqrt().max(1e-6)).collect()
    }

    /// Draws made.
    pub fn draws(&self) -> usize {
        self.null.draws
    }

    /// Largest normalized power that noise gives.
    pub fn limit(&self) -> f64 {
        self.null.quantile
    }

    fn powers(fits: &Fits, model: &Model) -> Vec<(String, [f64; 3])> {
        let view = in_noise(fits, model);
        let records: Vec<usize> = (0..fits.pieces.len()).collect();
        let residual = |&r: &usize| view.residuals(r, &model.fit.parameters, &model.fit.locals[r]);
        pooled(&view, &records, &records.iter().map(residual).collect::<Vec<_>>())
    }

    /// The null of the sensors whose noise is known roughly, with what smoothed derivatives give.
    pub fn tolerant(&self) -> Null {
        let powers = self.null.means().iter().zip(&self.bias);
        let most = |(mean, bias): (&[f64; 3], &[f64; 3])| {
            std::array::from_fn(|i| MAX_POWER_OVER_NOISE * (mean[i] + bias[i]))
        };
        self.null.tolerating(powers.map(most).collect())
    }

    /// Normalized powers of what a model leaves, by output.
    pub fn left(&self, fits: &Fits, model: &Model) -> Vec<(String, f64)> {
        self.null.normalized(&Self::powers(fits, model))
    }

    /// Whether what a model leaves is that of the sensors.
    pub fn settled(&self, fits: &Fits, model: &Model) -> bool {
        self.left(fits, model).iter().all(|(_, z)| *z < self.limit())
    }

    /// Whether a model leaves no more than the sensors may give, whose noise is known roughly.
    pub fn explained(&self, fits: &Fits, model: &Model) -> bool {
        self.beyond(fits, model).is_empty()
    }

    /// Outputs of which a model leaves more than their sensors may give, whose noise is known roughly.
    pub fn beyond(&self, fits: &Fits, model: &Model) -> Vec<usize> {
        let powers = Self::powers(fits, model);
        let left = self.null.normalized(&powers);
        let near = powers.iter().zip(self.null.means()).map(|((_, own), mean)| {
            own.iter().zip(mean).all(|(own, mean)| *own < MAX_POWER_OVER_NOISE * mean)
        });
        let within = left.iter().zip(near).map(|((_, z), near)| near || *z < self.limit());
        within.enumerate().filter(|(_, within)| !within).map(|(output, _)| output).collect()
    }

    /// Whether a model leaves no more than sensors and smoothed derivatives may give.
    pub fn tolerable(&self, fits: &Fits, model: &Model) -> bool {
        let powers = Self::powers(fits, model);
        let limits = self.null.means().iter().zip(&self.bias);
        powers.iter().zip(limits).all(|((_, own), (mean, bias))| {
            (0..3).all(|i| own[i] < MAX_POWER_OVER_NOISE * (mean[i] + bias[i]))
        })
    }

    /// Error of some power of a whitened sample, in multiples of that which noise gives.
    pub fn floors(&self, power: f64) -> f64 {
        (power / self.power.max(f64::MIN_POSITIVE)).max(0.0).sqrt()
    }

    /// Power of a model above that of noise and smoothed derivatives.
    pub fn excess(&self, model: &Model) -> f64 {
        (model.error.powi(2) - self.tolerated).max(0.0)
    }

    /// Whether an error takes away half of what another has above noise and smoothed derivatives, and no less than a
    /// hundredth of it.
    pub fn halves(&self, from: f64, to: f64) -> bool {
        let excess = |error: f64| error.powi(2) - self.tolerated;
        excess(from) > 0.0 && excess(to) < 0.5 * excess(from) && to < 0.99 * from
    }

    /// Whether an error has lost a quarter of what it had above noise and smoothed derivatives.
    pub fn falls(&self, from: f64, to: f64) -> bool {
        let excess = |error: f64| error.powi(2) - self.tolerated;
        excess(from) > 0.0 && excess(to) < 0.75 * excess(from)
    }

    /// Whether an error has lost a tenth of what it had above noise and smoothed derivatives.
    pub fn lessens(&self, from: f64, to: f64) -> bool {
        let excess = |error: f64| error.powi(2) - self.tolerated;
        excess(from) > 0.0 && excess(to) < 0.9 * excess(from)
    }

    /// On what depends what a model leaves.
    pub fn rest(&self, fits: &Fits, model: &Model) -> Rest {
        let study = fits.study;
        let probes: Vec<usize> =
            (0..study.candidates.len()).filter(|&c| study.candidates[c].is_shape()).collect();
        let power = model.error.powi(2);
        let enough = (MIN_SHARE_OF_EXCESS * self.excess(model)).max(MIN_SHARE_OF_NOISE * self.tolerated);
        let around = fits.around_all(model);
        // One variable that tells most of it needs no second.
        let tells_most = |gain: f64| gain >= MIN_SHARE_OF_ONE_VARIABLE * self.excess(model);
        // The linear step predicts too much where forces change the motion that they depend on: those above the limit
        // are fitted.
        let promised = |own: &[usize]| {
            if stop::asked() {
                return 0.0;
            }
            fits.promised(model, &around, own).map_or(0.0, |error| power - error.powi(2))
        };
        let gain = |own: &[usize], promised: f64| {
            if promised < enough || stop::asked() {
                return promised;
            }
            promised.min(fits.fitted(model, own).map_or(0.0, |error| power - error.powi(2)))
        };
        let promises = parallel::map(probes.len(), |i| promised(&[probes[i]]));
        let mut open: Vec<(usize, f64)> = probes.into_iter().zip(promises).collect();
        descending(&mut open, |own| own.1);
        let mut singles: Vec<(usize, f64)> = Vec::new();
        for &(probe, promised) in &open {
            // No fit gains more than predicted, so the places that count may be known before all are fitted.
            let counting = singles.first().map_or(1, |&(_, most)| if tells_most(most) { 1 } else { 3 });
            let known = singles.get(counting - 1).is_some_and(|&(_, least)| promised <= least);
            if known {
                break;
            }
            singles.push((probe, gain(&[probe], promised)));
            descending(&mut singles, |own| own.1);
        }
        let fitted = |probe: usize| singles.iter().find(|own| own.0 == probe).map(|own| own.1);
        let mut ports: BTreeMap<&str, f64> = BTreeMap::new();
        for &(probe, promised) in &open {
            let most = ports.entry(&study.candidates[probe].port).or_default();
            *most = most.max(fitted(probe).unwrap_or(promised));
        }
        let ports = ports.into_iter().map(|(port, gain)| (port.to_owned(), gain)).collect();
        let Some(&(first, alone)) = singles.first() else { return Rest::nothing() };
        if alone < enough {
            return Rest { place: None, gain: alone.max(0.0), ports };
        }
        let mut best = (vec![first], alone);
        let few = if tells_most(alone) { 0 } else { 2 };
        for &(second, _) in singles.iter().skip(1).take(few) {
            let both = [first, second];
            let both = gain(&both, promised(&both));
            if both > (1.0 + MIN_SHARE_OF_SECOND_VARIABLE) * best.1.max(alone) {
                best = (vec![first, second], both);
            }
        }
        let channel = study.candidates[first].place();
        let variables = best.0.iter().map(|&c| name(study, c).to_owned()).collect();
        Rest { place: Some((channel, variables)), gain: best.1, ports }
    }
}

/// Noise of the sensors by output, in its unit.
pub(crate) fn noises(study: &Study) -> Vec<f64> {
    study.outputs.iter().map(|output| output.noise).collect()
}

/// The estimation records with residuals in units of the sensor noise.
pub(super) fn in_noise<'a>(fits: &Fits<'a>, model: &Model) -> View<'a> {
    View { scale: noises(fits.study), ..fits.view(&model.added, &fits.pieces) }
}

/// Name of a variable at an attachment in the vocabulary.
pub(crate) fn word(study: &Study, tap: usize, variable: Variable) -> &str {
    let own = &study.taps[tap];
    match variable {
        Variable::Velocity => &own.words[0],
        Variable::Position => &own.words[1],
        Variable::PressureForce => "F",
        Variable::Value if own.stated => "u",
        Variable::Value => &own.name,
        Variable::Time => "time",
    }
}

/// Name of the variable of a probe.
pub fn name(study: &Study, c: usize) -> &str {
    match study.candidates[c].action {
        Action::Block { law: Law::Shape(variable), tap } => word(study, tap, variable),
        _ => "time",
    }
}

/// Variables that a candidate depends on; commands and sensors count as depending on all that moves.
pub fn depends(study: &Study, c: usize) -> Vec<&str> {
    let all = [Variable::Velocity, Variable::Position, Variable::PressureForce, Variable::Value];
    let Action::Block { law, tap } = study.candidates[c].action else {
        return all.iter().map(|&own| word(study, 0, own)).collect();
    };
    law.variables().iter().map(|&own| word(study, tap, own)).collect()
}
