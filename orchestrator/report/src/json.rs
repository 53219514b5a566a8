//! `report.json`.

use std::collections::BTreeMap;

use serde::Serialize;

use super::{Report, next};
use airloop_refine::answer::{self, Answer, Errors, Verdict};

/// Version of the layout of `report.json`.
pub const SCHEMA_VERSION: u32 = 1;

#[derive(Serialize)]
struct Document<'a> {
    schema_version: u32,
    airloop_version: &'static str,
    case: &'a str,
    settings: Settings,
    verdict: &'static str,
    effects: Vec<Effect<'a>>,
    unexplained: Option<Unexplained<'a>>,
    residual: Residual<'a>,
    noise_floor: &'a BTreeMap<String, f64>,
    error_floor: Floor<'a>,
    score_kind: &'static str,
    declared_corrections: BTreeMap<&'a str, Correction>,
    not_testable: BTreeMap<&'a str, &'a str>,
    localisation: Vec<Localised<'a>>,
    measure_next: Vec<String>,
    amended_system: Option<String>,
    notes: &'a [String],
}

#[derive(Serialize)]
struct Settings {
    seed: u64,
    draws: usize,
    max_effects: usize,
}

#[derive(Serialize)]
struct Floor<'a> {
    estimation: &'a BTreeMap<String, f64>,
    validation: &'a BTreeMap<String, f64>,
}

#[derive(Serialize)]
struct Localised<'a> {
    driven_by: &'a str,
    compared_with: &'a str,
    left_before: Option<f64>,
    left_after: Option<f64>,
    limit: f64,
}

#[derive(Serialize)]
struct Effect<'a> {
    id: &'a str,
    channel: &'a str,
    signal: Option<&'a str>,
    selected: bool,
    group: Option<usize>,
    score: f64,
    margin: f64,
    params: BTreeMap<&'a str, Parameter<'a>>,
    stability: Option<Stability<'a>>,
    reason: &'a str,
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
    channel: &'a str,
    variables: &'a [String],
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
struct Correction {
    relative: f64,
    standard_deviation: f64,
}

fn set<'a>(before: &'a Errors, after: &'a Errors) -> Set<'a> {
    Set {
        rms_before: &before.rms,
        rms_after: &after.rms,
        nrmse_before: &before.nrmse,
        nrmse_after: &after.nrmse,
    }
}

/// What noise alone gives; where it is carried nowhere, the noise.
fn floor(answer: &Answer, set: usize) -> &BTreeMap<String, f64> {
    if answer.floor[set].is_empty() { &answer.noise } else { &answer.floor[set] }
}

/// Names of the parameters of an effect.
fn names(effect: &answer::Effect) -> impl Iterator<Item = &str> {
    effect.parameters.iter().map(|p| p.name.as_str())
}

/// The word of a verdict.
pub fn word(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Effect => "effect",
        Verdict::Nothing => "none",
        Verdict::Unexplained => "unexplained",
    }
}

/// The report as JSON text.
pub fn text(report: &Report) -> String {
    let answer = report.answer;
    let best = answer.effects.iter().map(|effect| effect.score).fold(f64::MIN, f64::max);
    let effects = answer.effects.iter().map(|e| Effect {
        id: &e.id,
        channel: &e.channel,
        signal: e.signal.as_deref(),
        selected: e.selected,
        group: e.group,
        score: e.score,
        margin: best - e.score,
        params: e
            .parameters
            .iter()
            .map(|p| {
                (
                    p.name.as_str(),
                    Parameter { value: p.value, unit: &p.unit, ci95: [p.interval.0, p.interval.1] },
                )
            })
            .collect(),
        stability: e.stability.as_ref().map(|own| Stability {
            parts: own.parts,
            better: own.better,
            ranges: names(e).zip(own.ranges.iter().map(|range| [range.0, range.1])).collect(),
        }),
        reason: &e.reason,
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
        },
        verdict: word(answer.verdict),
        effects: effects.collect(),
        unexplained: answer
            .unexplained
            .as_ref()
            .map(|(channel, variables)| Unexplained { channel, variables }),
        residual: Residual {
            estimation: set(&answer.before[0], &answer.after[0]),
            validation: set(&answer.before[1], &answer.after[1]),
        },
        noise_floor: &answer.noise,
        error_floor: Floor { estimation: floor(answer, 0), validation: floor(answer, 1) },
        score_kind: "delta BIC",
        declared_corrections: answer
            .corrections
            .iter()
            .map(|(name, relative, sd)| {
                (name.as_str(), Correction { relative: *relative, standard_deviation: *sd })
            })
            .collect(),
        not_testable: answer.not_testable.iter().map(|(id, why)| (id.as_str(), why.as_str())).collect(),
        localisation: report
            .evidence
            .ports
            .iter()
            .map(|port| Localised {
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
