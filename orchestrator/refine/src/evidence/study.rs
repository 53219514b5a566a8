//! The material of the figures of a study.

use super::{
    Evidence, MAX_RECORDS_OVER_TIME, Port, Record, Residual, Signal, Variable, block, correlation, dependence,
};
use crate::answer::Answer;
use crate::engine::{System, parallel};
use crate::study::declaration::Role;
use crate::study::fits::{Fits, Model, pieces};
use crate::study::law::Point;
use crate::study::model::Study;
use crate::study::simulate::View;

/// Gathers the material for the report of an answer; `models`: the declared and the corrected one.
pub fn gather(fits: &Fits, models: [&Model; 2], answer: &Answer) -> Evidence {
    let study = fits.study;
    let signals: Vec<Signal> = study
        .outputs
        .iter()
        .map(|output| Signal { name: output.name.clone(), unit: output.unit.clone(), noise: output.noise })
        .collect();
    let chosen = pieces(study, Role::Validation);
    let views = models.map(|model| View { corrected: false, ..fits.view(&model.added, &chosen) });
    let locals = models.map(|model| {
        let p = &model.fit.parameters;
        fits.grow(&model.added, &chosen, p, &[], &[0.1, 0.3, 1.0], 12).locals
    });
    let (records, traces): (Vec<Record>, Vec<Vec<Vec<Point>>>) = parallel::map(chosen.len(), |i| {
        let record = &study.records[chosen[i].record];
        let measured = views[0].measured(i);
        let predicted = [0, 1].map(|m| views[m].predict(i, &models[m].fit.parameters, &locals[m][i]));
        let residuals = views[0].signals(i).into_iter().enumerate().map(|(signal, span)| {
            let own = |m: usize| {
                let pairs = measured[span.range.clone()].iter().zip(&predicted[m][span.range.clone()]);
                pairs.map(|(y, p)| y - p).collect::<Vec<f64>>()
            };
            Residual { signal, measured: measured[span.range.clone()].to_vec(), values: [own(0), own(1)] }
        });
        let traces = views[1].trace(i, &models[1].fit.parameters, &locals[1][i]);
        let variables = variables(study, record.n, &traces, &record.inputs);
        let own = Record {
            name: record.name.clone(),
            group: String::new(),
            sample_time: record.step,
            residuals: residuals.collect(),
            variables,
        };
        (own, traces)
    })
    .into_iter()
    .unzip();
    Evidence {
        dependence: dependence::of(&signals, &records),
        correlation: correlation::of(&signals, &records),
        curves: block::of(study, answer, &traces),
        ports: ports(study, answer),
        left_at: answer.left_at.clone(),
        records: records.into_iter().take(MAX_RECORDS_OVER_TIME).collect(),
        signals: all_signals(study, answer, signals),
    }
}

/// Outputs, and the force residual where there is one.
fn all_signals(study: &Study, answer: &Answer, mut signals: Vec<Signal>) -> Vec<Signal> {
    if let Some((.., name)) = &study.force {
        let noise = answer.noise.get(name).copied().unwrap_or(0.0);
        signals.push(Signal { name: name.clone(), unit: "N".into(), noise });
    }
    signals
}

/// The outputs, each driven by the inputs of the system.
fn ports(study: &Study, answer: &Answer) -> Vec<Port> {
    let driven = study.records.iter().any(|record| record.inputs.iter().any(Option::is_some));
    let from = if driven { "inputs" } else { "initial state" };
    let one = |(before, after): (&(String, f64), &(String, f64))| Port {
        from,
        to: before.0.clone(),
        left: [before.1, after.1],
    };
    answer.left[0].iter().zip(&answer.left[1]).map(one).collect()
}

/// Variables to show residuals against: commands, and the signals at the attachments under the corrected model.
fn variables(study: &Study, n: usize, traces: &[Vec<Point>], inputs: &[Option<Vec<f64>>]) -> Vec<Variable> {
    let mut found: Vec<Variable> = Vec::new();
    let mut add = |name: &str, unit: &str, values: Vec<f64>| {
        let (low, high) =
            values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &v| (a.min(v), b.max(v)));
        if values.len() == n && low < high && !found.iter().any(|known| known.name == name) {
            found.push(Variable { name: name.into(), unit: unit.into(), values });
        }
    };
    for (tap, trace) in study.taps.iter().zip(traces) {
        let of = |pick: fn(&Point) -> f64| trace.iter().map(pick).collect::<Vec<f64>>();
        let [velocity, position, pressure_force, _] = tap.signals;
        if velocity.is_some() {
            add(&tap.words[0], &tap.units[1], of(|p| p.velocity));
        }
        if position.is_some() {
            add(&tap.words[1], &tap.units[2], of(|p| p.position));
        }
        if pressure_force.is_some() {
            add("F", "N", of(|p| p.pressure_force));
        }
    }
    for (input, values) in study.graph.inputs.iter().zip(inputs) {
        let Some(values) = values else { continue };
        let stated = study.taps.iter().any(|tap| tap.stated);
        let name = if stated { "u" } else { input.name.as_str() };
        add(name, input.unit.as_deref().unwrap_or_default(), values.clone());
    }
    found
}
