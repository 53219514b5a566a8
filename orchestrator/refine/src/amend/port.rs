//! The block of an effect at a port of a study: a derived `port-effect`, which works in the units of the port.

use airloop_cosim::system::ssp::Endpoint;
use airloop_fmi::derive::Value;

use super::blocks::{self, Sources};
use super::network::{Block, Part};
use crate::answer::{Effect, Wiring};

/// Order of the kinds that change the value that passes, as the search has them; all others add up behind them.
pub const ORDER: [&str; 14] = [
    "delay",
    "hysteresis",
    "lag",
    "fill",
    "rate_limit",
    "mode",
    "quantization",
    "deadband",
    "saturation",
    "limits",
    "gain",
    "posgain",
    "droop",
    "load_friction",
];

/// The block, with the name of its component; none for an effect that is no block.
pub fn block(effect: &Effect, name: String, wiring: &Wiring, step: f64, sources: &Sources) -> Option<Block> {
    let value = |index: usize| effect.parameters.get(index).map_or(0.0, |p| p.value);
    let (names, inputs): (&[&str], &[&'static str]) = match effect.kind() {
        "viscous" => (&["viscous_coef"], &["v"]),
        "resistance" => (&["viscous_coef"], &["v"]),
        "coulomb" | "voltage_drop" => (&["coulomb_level"], &["v"]),
        "cubic_spring" => (&["cubic_stiffness", "cubic_rest"], &["x"]),
        "linear_leakage" => (&["spring_stiffness"], &["x"]),
        "leakage" => (&["outlet_coef"], &["x"]),
        "overflow" | "caught_overflow" => (&["endstop_stiffness", "endstop_pos"], &["x"]),
        "drift" => (&["drift_slope"], &[]),
        "lag" => (&["lag_up", "lag_down"], &[]),
        "fill" => (&["lag_up", "lag_down"], &[]),
        "rate_limit" => (&["rate_limit"], &[]),
        "stribeck" => (&["stribeck_level", "stribeck_vs"], &["v"]),
        "presliding" => (&["presliding_disp"], &["v"]),
        "pressure" => (&["load_coef"], &["v", "load"]),
        "offset" => (&["offset_value"], &[]),
        "asymmetry" => (&["asymmetry_level", "asymmetry_coef"], &["v"]),
        "poscoulomb" => (&["poscoulomb_slope"], &["v", "x"]),
        "quaddrag" => (&["drag_coef"], &["v"]),
        "spring" => (&["spring_stiffness", "spring_rest"], &["x"]),
        "endstop" => (&["endstop_stiffness", "endstop_damping", "endstop_pos"], &["x", "v"]),
        "cogging" => (&["cogging_amp", "cogging_phase", "cogging_period"], &["x"]),
        "area" => (&["area_coef"], &["p"]),
        "gain" => (&["gain"], &[]),
        "deadband" => (&["deadband_width"], &[]),
        "saturation" => (&["saturation_limit"], &[]),
        "posgain" => (&["posgain_slope"], &["x"]),
        "droop" => (&["droop_depth", "droop_tau"], &[]),
        "mode" => (&["mode_freq", "mode_zeta"], &[]),
        _ => return None,
    };
    let mut start: Vec<(String, Value)> = names
        .iter()
        .enumerate()
        .map(|(index, name)| ((*name).to_owned(), Value::Real(value(index))))
        .collect();
    let mut set = |name: &str, value: f64| {
        start.retain(|(own, _)| own != name);
        start.push((name.into(), Value::Real(value)));
    };
    set("vt", wiring.vt);
    set("v0", wiring.v0);
    set("sign", wiring.sign);
    match effect.kind() {
        "presliding" => set("presliding_level", wiring.level),
        "lag" => set("lag_down", value(0)),
        // Fast enough to follow anything below the limit.
        "rate_limit" => ["lag_up", "lag_down"].iter().for_each(|name| set(name, 0.1 * step)),
        _ => {}
    }
    let description = description(effect);
    let part = Part { name, template: "port-effect", description, start };
    let source = |input: &'static str| {
        let source: &Option<Endpoint> = match input {
            "x" => &sources.x,
            "v" => &sources.v,
            "load" => &sources.f_hat,
            _ => &sources.p,
        };
        source.clone().map(|source| (input, None, source))
    };
    let further = inputs.iter().filter_map(|&input| source(input)).collect();
    Some(Block { part, way: ("u", "y", None), further })
}

/// The block of the part of an overflow that the next level gets; `all`: value there of all that runs over, below zero
/// where a larger value makes that level fall, `sources`: those of the level that runs over.
pub fn caught(effect: &Effect, name: String, all: f64, sources: &Sources) -> Block {
    let value = |name: &str| blocks::value(effect, name);
    let values = [
        ("endstop_stiffness", value("coef") * value("caught") * all.abs()),
        ("endstop_pos", value("level")),
        // What the other port loses comes in here.
        ("sign", -all.signum()),
    ];
    let start = values.map(|(name, value)| (name.to_owned(), Value::Real(value))).into();
    let part = Part { name, template: "port-effect", description: description(effect), start };
    let further = sources.x.clone().map(|source| ("x", None, source)).into_iter().collect();
    Block { part, way: ("u", "y", None), further }
}

/// One sentence on an effect.
pub fn description(effect: &Effect) -> String {
    let at = effect.port.as_ref().map_or_else(String::new, |port| format!(" at {port}"));
    format!("What the declared model lacks: {}{at}", effect.id)
}
