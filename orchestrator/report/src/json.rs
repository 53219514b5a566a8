//! `report.json`.

use std::collections::BTreeMap;

use serde::Serialize;

use super::{Report, names, next};
use airloop_refine::answer::{self, Answer, Errors, Verdict};
use airloop_refine::rig::port;

/// Version of the layout of `report.json`.
pub const SCHEMA_VERSION: u32 = 2;

#[derive(Serialize)]
struct Document<'a> {
    schema_version: u32,
    airloop_version: &'static str,
    case: &'a str,
    settings: Settings,
    verdict: &'static str,
    complete: bool,
    partial: bool,
    share: Option<f64>,
    effects: Vec<Effect<'a>>,
    unexplained: Option<Unexplained<'a>>,
    law: Option<Law<'a>>,
    residual: Residual<'a>,
    noise_floor: &'a BTreeMap<String, f64>,
    error_floor: Floor<'a>,
    score_kind: &'static str,
    corrections: Vec<Correction<'a>>,
    remaining: Remaining<'a>,
    steps: Vec<Step<'a>>,
    not_testable: BTreeMap<&'a str, &'a str>,
    localization: Vec<Localized<'a>>,
    measure_next: Vec<String>,
    amended_system: Option<String>,
    notes: &'a [String],
}

#[derive(Serialize)]
struct Settings {
    seed: u64,
    draws: usize,
    max_effects: usize,
    table: Vec<Row>,
    study: &'static str,
}

#[derive(Serialize)]
struct Row {
    name: &'static str,
    value: f64,
    default: f64,
    range: [f64; 2],
    meaning: &'static str,
}

/// The numbers that decided the answer.
fn table(settings: &answer::Settings) -> Vec<Row> {
    let row = |own: airloop_refine::engine::settings::Row| {
        let (name, value, default, meaning) = (own.name, own.value, own.default, own.meaning);
        Row { name, value, default, range: [own.range.0, own.range.1], meaning }
    };
    settings.forward_selection.table().into_iter().map(row).collect()
}

#[derive(Serialize)]
struct Floor<'a> {
    estimation: &'a BTreeMap<String, f64>,
    validation: &'a BTreeMap<String, f64>,
}

#[derive(Serialize)]
struct Localized<'a> {
    driven_by: &'a str,
    compared_with: &'a str,
    left_before: Option<f64>,
    left_after: Option<f64>,
    limit: f64,
}

#[derive(Serialize)]
struct Effect<'a> {
    id: &'a str,
    channel: Option<&'a str>,
    signal: Option<&'a str>,
    kind: &'a str,
    port: Option<&'a str>,
    share: Option<f64>,
    selected: bool,
    group: Option<usize>,
    score: f64,
    margin: f64,
    params: BTreeMap<&'a str, Parameter<'a>>,
    stability: Option<Stability<'a>>,
    reason: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    formula: Option<&'a str>,
}

#[derive(Serialize)]
struct Stability<'a> {
    parts: usize,
    better: usize,
    ranges: BTreeMap<&'a str, [f64; 2]>,
}

#[derive(Serialize)]
struct Parameter<'a> {
    value: f64,
    unit: &'a str,
    ci95: [f64; 2],
}

#[derive(Serialize)]
struct Unexplained<'a> {
    channel: Option<&'a str>,
    port: Option<&'a str>,
    variables: &'a [String],
    share_of_free_form: Option<f64>,
}

#[derive(Serialize)]
struct Law<'a> {
    port: &'a str,
    channel: Option<&'a str>,
    variables: &'a [String],
    formula: Option<&'a str>,
    params: BTreeMap<&'a str, Parameter<'a>>,
    curve: Option<Vec<CurvePoint>>,
    share: f64,
    share_of_free_form: f64,
    rivals: Vec<Rival<'a>>,
    covered: BTreeMap<&'a str, Range<'a>>,
    dissipation: Option<f64>,
}

#[derive(Serialize)]
struct CurvePoint {
    at: f64,
    value: f64,
    half_width: Option<f64>,
}

#[derive(Serialize)]
struct Rival<'a> {
    formula: &'a str,
    share_of_free_form: f64,
}

#[derive(Serialize)]
struct Range<'a> {
    from: f64,
    to: f64,
    unit: &'a str,
}

/// The law of an answer.
fn law(own: &airloop_refine::law::found::Law) -> Law<'_> {
    let formula = own.effect.own.as_ref().map(|own| own.formula.as_str());
    let finite = |value: f64| value.is_finite().then_some(value);
    let points = own.curve.iter().map(|[at, value, half]| CurvePoint {
        at: *at,
        value: *value,
        half_width: finite(*half),
    });
    Law {
        port: &own.port,
        channel: stated(&own.channel),
        variables: &own.variables,
        formula: formula.filter(|_| own.named),
        params: parameters(&own.effect.parameters),
        curve: (!own.curve.is_empty()).then(|| points.collect()),
        share: own.share,
        share_of_free_form: own.of_free_form,
        rivals: own
            .rivals
            .iter()
            .map(|(formula, share)| Rival { formula, share_of_free_form: *share })
            .collect(),
        covered: own
            .covered
            .iter()
            .map(|(name, from, to, unit)| (name.as_str(), Range { from: *from, to: *to, unit }))
            .collect(),
        dissipation: own.dissipation,
    }
}

#[derive(Serialize)]
struct Remaining<'a> {
    signals: BTreeMap<&'a str, Left>,
    ports: BTreeMap<&'a str, Port>,
}

#[derive(Serialize)]
struct Left {
    rms: f64,
    floors: Option<f64>,
    ratio: Option<f64>,
}

#[derive(Serialize)]
struct Port {
    floors: f64,
}

#[derive(Serialize)]
struct Step<'a> {
    model: &'a [String],
    candidates: Vec<Tried<'a>>,
}

#[derive(Serialize)]
struct Tried<'a> {
    id: &'a str,
    port: Option<&'a str>,
    held_out_gain: f64,
    rejected: Option<&'a str>,
}

#[derive(Serialize)]
struct Residual<'a> {
    estimation: Set<'a>,
    validation: Set<'a>,
}

#[derive(Serialize)]
struct Set<'a> {
    rms_before: &'a BTreeMap<String, f64>,
    rms_after: &'a BTreeMap<String, f64>,
    nrmse_before: &'a BTreeMap<String, f64>,
    nrmse_after: &'a BTreeMap<String, f64>,
}

#[derive(Serialize)]
struct Correction<'a> {
    id: Option<&'a str>,
    component: &'a str,
    parameter: &'a str,
    declared: f64,
    value: f64,
    ci95: [f64; 2],
    tolerance: f64,
    params: BTreeMap<&'a str, Parameter<'a>>,
}

fn parameters(own: &[answer::Parameter]) -> BTreeMap<&str, Parameter<'_>> {
    let one = |p: &'_ answer::Parameter| [p.interval.0, p.interval.1];
    own.iter().map(|p| (p.name.as_str(), Parameter { value: p.value, unit: &p.unit, ci95: one(p) })).collect()
}

/// Signals on validation records, and ports, where something is left.
fn remaining<'a>(report: &Report<'a>) -> Remaining<'a> {
    let answer = report.answer;
    let left = |(signal, rms): (&'a String, &f64)| {
        let before = answer.before[1].rms.get(signal).filter(|before| **before > 0.0);
        let floors = answer.times_floor(&answer.after[1], signal);
        (signal.as_str(), Left { rms: *rms, floors, ratio: before.map(|before| rms / before) })
    };
    let port = |(port, floors): &'a (String, f64)| (port.as_str(), Port { floors: *floors });
    Remaining {
        signals: answer.after[1].rms.iter().map(left).collect(),
        ports: report.evidence.left_at.iter().map(port).collect(),
    }
}

/// A channel, if one is declared.
fn stated(channel: &str) -> Option<&str> {
    (!channel.is_empty()).then_some(channel)
}

fn set<'a>(before: &'a Errors, after: &'a Errors) -> Set<'a> {
    Set {
        rms_before: &before.rms,
        rms_after: &after.rms,
        nrmse_before: &before.nrmse,
        nrmse_after: &after.nrmse,
    }
}

/// Errors given by noise alone; where it is not carried to the outputs, the noise.
fn floor(answer: &Answer, set: usize) -> &BTreeMap<String, f64> {
    if answer.floor[set].is_empty() { &answer.noise } else { &answer.floor[set] }
}

/// Names of the parameters of an effect.
fn parameter_names(effect: &answer::Effect) -> impl Iterator<Item = &str> {
    effect.parameters.iter().map(|p| p.name.as_str())
}

/// The word of a verdict.
pub fn word(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Effect => "effect",
        Verdict::Nothing => "none",
        Verdict::Unexplained => "unexplained",
        Verdict::Law => "law",
    }
}

/// The report as JSON text.
pub fn text(report: &Report) -> String {
    let answer = report.answer;
    let best = answer.effects.iter().map(|effect| effect.score).fold(f64::MIN, f64::max);
    let effects = answer.effects.iter().map(|e| Effect {
        id: &e.id,
        channel: stated(&e.channel),
        signal: e.signal.as_deref(),
        kind: e.kind(),
        port: e.port.as_deref().or_else(|| port::of_channel(&e.channel)),
        share: e.share,
        selected: e.selected,
        group: e.group,
        score: e.score,
        margin: best - e.score,
        params: parameters(&e.parameters),
        stability: e.stability.as_ref().map(|own| Stability {
            parts: own.parts,
            better: own.better,
            ranges: parameter_names(e).zip(own.ranges.iter().map(|range| [range.0, range.1])).collect(),
        }),
        reason: &e.reason,
        formula: e.own.as_ref().map(|own| own.formula.as_str()),
    });
    let finite = |value: f64| value.is_finite().then_some(value);
    let document = Document {
        schema_version: SCHEMA_VERSION,
        airloop_version: env!("CARGO_PKG_VERSION"),
        case: report.case,
        settings: Settings {
            seed: report.settings.seed,
            draws: report.settings.draws,
            max_effects: report.settings.max_effects,
            table: table(report.settings),
            study: airloop_refine::engine::settings::STUDY,
        },
        verdict: word(answer.verdict),
        complete: answer.complete,
        partial: answer.partial,
        share: answer.share,
        effects: effects.collect(),
        unexplained: answer.unexplained.as_ref().map(|(place, variables)| {
            let (channel, at) = names::place(place);
            Unexplained {
                channel: stated(channel),
                port: at.or_else(|| port::of_channel(channel)),
                variables,
                share_of_free_form: answer.share_of_free_form,
            }
        }),
        law: answer.law.as_ref().map(law),
        residual: Residual {
            estimation: set(&answer.before[0], &answer.after[0]),
            validation: set(&answer.before[1], &answer.after[1]),
        },
        noise_floor: &answer.noise,
        error_floor: Floor { estimation: floor(answer, 0), validation: floor(answer, 1) },
        score_kind: if answer.by_share { "delta weighted chi2" } else { "delta BIC" },
        corrections: answer
            .corrections
            .iter()
            .map(|own| Correction {
                id: own.id.as_deref(),
                component: &own.component,
                parameter: &own.parameter,
                declared: own.declared,
                value: own.value,
                ci95: [own.interval.0, own.interval.1],
                tolerance: own.tolerance,
                params: parameters(&own.parameters),
            })
            .collect(),
        remaining: remaining(report),
        steps: answer
            .steps
            .iter()
            .map(|step| Step {
                model: &step.model,
                candidates: step
                    .candidates
                    .iter()
                    .map(|own| Tried {
                        id: &own.id,
                        port: own.port.as_deref(),
                        held_out_gain: own.held_out_gain,
                        rejected: own.rejected.as_deref(),
                    })
                    .collect(),
            })
            .collect(),
        not_testable: answer.not_testable.iter().map(|(id, why)| (id.as_str(), why.as_str())).collect(),
        localization: report
            .evidence
            .ports
            .iter()
            .map(|port| Localized {
                driven_by: port.from,
                compared_with: &port.to,
                left_before: finite(port.left[0]),
                left_after: finite(port.left[1]),
                limit: answer.limit,
            })
            .collect(),
        measure_next: next::advice(answer),
        amended_system: report.system.map(|folder| format!("{folder}/system.ssd")),
        notes: &answer.notes,
    };
    // Every value of the report is text or number, so this cannot fail.
    serde_json::to_string_pretty(&document).unwrap_or_default() + "\n"
}
