//! Kinds of effects: which laws a port or a channel may lack, with names, units and signs of their parameters.

use super::command::Command;
use super::law::Law;

/// An effect of a channel: id, law, names with units, which of its parameters must not be negative.
pub(super) struct Kind {
    pub(super) id: &'static str,
    pub(super) law: Law,
    pub(super) parameters: &'static [(&'static str, &'static str)],
    pub(super) positive: &'static [usize],
}

const fn kind(
    id: &'static str,
    law: Law,
    parameters: &'static [(&'static str, &'static str)],
    positive: &'static [usize],
) -> Kind {
    Kind { id, law, parameters, positive }
}

const PISTON: [Kind; 7] = [
    kind("pf.viscous", Law::Viscous, &[("coef", "E/V")], &[0]),
    kind("pf.coulomb", Law::Coulomb, &[("force", "E")], &[0]),
    kind("pf.stribeck", Law::Stribeck, &[("force", "E"), ("vs", "V")], &[0, 1]),
    kind("pf.presliding", Law::Presliding, &[("disp", "X")], &[0]),
    kind("pf.pressure", Law::Pressure, &[("coef", "1")], &[0]),
    kind("pf.offset", Law::Offset, &[("value", "E")], &[]),
    kind("pf.asymmetry", Law::Asymmetry, &[("force", "E"), ("coef", "E/V")], &[]),
];

const CART_FRICTION: [Kind; 7] = [
    kind("cf.viscous", Law::Viscous, &[("coef", "E/V")], &[0]),
    kind("cf.coulomb", Law::Coulomb, &[("force", "E")], &[0]),
    kind("cf.stribeck", Law::Stribeck, &[("force", "E"), ("vs", "V")], &[0, 1]),
    kind("cf.presliding", Law::Presliding, &[("disp", "X")], &[0]),
    kind("cf.offset", Law::Offset, &[("value", "E")], &[]),
    kind("cf.asymmetry", Law::Asymmetry, &[("force", "E"), ("coef", "E/V")], &[]),
    kind("cf.poscoulomb", Law::PositionCoulomb, &[("slope", "E/X")], &[]),
];

const CART: [Kind; 3] = [
    kind("cart.spring", Law::Spring, &[("stiffness", "E/X"), ("rest", "X")], &[0]),
    kind("cart.endstop", Law::EndStop, &[("stiffness", "E/X"), ("damping", "E/V"), ("pos", "X")], &[0, 1]),
    kind("cart.cogging", Law::Cogging, &[("amp", "E"), ("phase", "rad"), ("period", "X")], &[2]),
];

const POLE: [Kind; 3] = [
    kind("pole.viscous", Law::Viscous, &[("coef", "E/V")], &[0]),
    kind("pole.coulomb", Law::Coulomb, &[("torque", "E")], &[0]),
    kind("pole.quaddrag", Law::Drag, &[("coef", "E/V2")], &[0]),
];

const ACTUATOR: [Kind; 6] = [
    kind("act.area", Law::Area, &[("coef", "m2")], &[]),
    kind("act.gain", Law::Gain, &[("gain", "1")], &[]),
    kind("act.deadband", Law::DeadBand, &[("width", "E")], &[0]),
    kind("act.saturation", Law::Saturation, &[("limit", "E")], &[0]),
    kind("act.posgain", Law::PositionGain, &[("slope", "1/X")], &[]),
    kind("act.droop", Law::Droop, &[("depth", "1"), ("tau", "s")], &[1]),
];

/// Effects on a force or torque. Units: E of the value that passes, V of the velocity, X of the position.
pub(super) const MECHANICAL: [Kind; 17] = [
    kind("viscous", Law::Viscous, &[("coef", "E/V")], &[0]),
    kind("coulomb", Law::Coulomb, &[("force", "E"), ("vt", "V")], &[0, 1]),
    kind("stribeck", Law::Stribeck, &[("force", "E"), ("vs", "V")], &[0, 1]),
    kind("presliding", Law::Presliding, &[("disp", "X")], &[0]),
    kind("pressure", Law::Pressure, &[("coef", "1")], &[0]),
    kind("offset", Law::Offset, &[("value", "E")], &[]),
    kind("asymmetry", Law::Asymmetry, &[("force", "E"), ("coef", "E/V")], &[]),
    kind("poscoulomb", Law::PositionCoulomb, &[("slope", "E/X")], &[]),
    kind("periodic_friction", Law::PeriodicCoulomb, &[("amp", "E"), ("phase", "rad"), ("period", "X")], &[2]),
    kind("load_friction", Law::Load, &[("coef", "1"), ("vt", "V")], &[0, 1]),
    kind("quaddrag", Law::Drag, &[("coef", "E/V2")], &[0]),
    kind("spring", Law::Spring, &[("stiffness", "E/X"), ("rest", "X")], &[0]),
    kind("cubic_spring", Law::CubicSpring, &[("stiffness", "E/X3"), ("rest", "X")], &[0]),
    kind("endstop", Law::EndStop, &[("stiffness", "E/X"), ("damping", "E/V"), ("pos", "X")], &[0, 1]),
    kind("lower_endstop", Law::LowerStop, &[("stiffness", "E/X"), ("damping", "E/V"), ("pos", "X")], &[0, 1]),
    kind("cogging", Law::Cogging, &[("amp", "E"), ("phase", "rad"), ("period", "X")], &[2]),
    kind("drift", Law::Drift, &[("slope", "E/s")], &[]),
];

/// Effects on a voltage that drives a current, which takes the place of the velocity.
pub(super) const ELECTRICAL: [Kind; 4] = [
    kind("resistance", Law::Viscous, &[("coef", "E/V")], &[0]),
    kind("voltage_drop", Law::Coulomb, &[("drop", "E"), ("vt", "V")], &[0, 1]),
    kind("offset", Law::Bias, &[("value", "E")], &[]),
    kind("drift", Law::Drift, &[("slope", "E/s")], &[]),
];

/// Id of the one effect at two ports.
pub(super) const CAUGHT_OVERFLOW: &str = "caught_overflow";

/// Effects on a flow into a level, or on anything else that a state integrates.
pub(super) const FLOW: [Kind; 7] = [
    kind("offset", Law::Bias, &[("value", "E")], &[]),
    kind("linear_leakage", Law::Leakage, &[("coef", "E/X")], &[0]),
    kind("leakage", Law::Outlet, &[("coef", "E/X0.5")], &[0]),
    kind("overflow", Law::Overflow, &[("coef", "E/X"), ("level", "X")], &[0]),
    kind(CAUGHT_OVERFLOW, Law::CaughtOverflow, &[("coef", "E/X"), ("level", "X"), ("caught", "1")], &[0, 2]),
    kind("choked_flow", Law::Choked, &[("coef", "E/X"), ("outside", "X")], &[0, 1]),
    kind("drift", Law::Drift, &[("slope", "E/s")], &[]),
];

/// Effects on a command, or on a signal that one component gives another.
pub(super) const COMMAND: [Kind; 7] = [
    kind("gain", Law::Gain, &[("gain", "1")], &[]),
    kind("deadband", Law::DeadBand, &[("width", "E")], &[0]),
    kind("saturation", Law::Saturation, &[("limit", "E")], &[0]),
    kind("limits", Law::Limits, &[("low", "E"), ("high", "E")], &[]),
    kind("quantization", Law::Quantization, &[("step", "E")], &[0]),
    kind("posgain", Law::PositionGain, &[("slope", "1/X")], &[]),
    kind("droop", Law::Droop, &[("depth", "1"), ("tau", "s")], &[1]),
];

/// An effect on a command, with a memory: id, kind, names with units.
pub(super) type Memory = (&'static str, Command, &'static [(&'static str, &'static str)]);

pub(super) const COMMANDS: [Memory; 3] = [
    ("act.delay", Command::Delay, &[("delay", "s")]),
    ("act.hysteresis", Command::Hysteresis, &[("width", "E")]),
    ("act.mode", Command::Mode, &[("freq", "Hz"), ("zeta", "1")]),
];

/// The same at ports without a channel.
pub(super) const PORT_COMMANDS: [Memory; 6] = [
    ("delay", Command::Delay, &[("delay", "s")]),
    ("hysteresis", Command::Hysteresis, &[("width", "E")]),
    ("mode", Command::Mode, &[("freq", "Hz"), ("zeta", "1")]),
    ("lag", Command::Lag, &[("tau", "s")]),
    ("fill", Command::Fill, &[("up", "s"), ("down", "s")]),
    ("rate_limit", Command::RateLimit, &[("rate", "E/s")]),
];

/// Channels of the vocabulary that attachments may name.
pub const CHANNELS: [&str; 5] = ["actuator", "piston_friction", "cart_friction", "cart", "pole"];

/// Kinds that attachments without a channel may name.
pub fn kinds_of_ports() -> Vec<&'static str> {
    let blocks = MECHANICAL.iter().chain(&ELECTRICAL).chain(&FLOW).chain(&COMMAND).map(|kind| kind.id);
    blocks.chain(PORT_COMMANDS.iter().map(|own| own.0)).collect()
}

/// Unit of a parameter from those of the value that passes, of velocity and position.
pub(super) fn unit(template: &str, [value, velocity, position]: &[String; 3]) -> String {
    let spaced = |unit: &str| unit.replace(['.', '*'], " ");
    let over = |unit: &str, power: &str| {
        let raised = |own: &str| if own == "1" { String::new() } else { format!("{own}{power}") };
        // A velocity in the denominator: N s/m.
        match unit.split_once('/') {
            Some((length, "s")) => (format!(" s{power}"), raised(length)),
            _ if unit.contains(['/', '.', '*']) => (String::new(), format!("({unit}){power}")),
            _ => (String::new(), raised(unit)),
        }
    };
    let ratio = |(times, below): (String, String)| {
        let own = spaced(value);
        if below.is_empty() { format!("{own}{times}") } else { format!("{own}{times}/{below}") }
    };
    match template {
        "E" => spaced(value),
        "V" => velocity.clone(),
        "X" => position.clone(),
        "E/V" => ratio(over(velocity, "")),
        "E/V2" => ratio(over(velocity, "^2")),
        "E/X" => ratio(over(position, "")),
        "E/X3" => ratio(over(position, "^3")),
        "E/X0.5" => ratio(over(position, "^0.5")),
        "1/X" => format!("1/{position}"),
        "E/s" => match spaced(value).strip_suffix("/s") {
            Some(length) => format!("{length}/s^2"),
            None => format!("{}/s", spaced(value)),
        },
        other => other.to_owned(),
    }
}

pub(super) fn kinds(channel: &str) -> (&'static str, &'static [Kind]) {
    match channel {
        "piston_friction" => ("piston_friction", &PISTON),
        "cart_friction" => ("cart_friction", &CART_FRICTION),
        "cart" => ("cart", &CART),
        "pole" => ("pole", &POLE),
        _ => ("actuator", &ACTUATOR),
    }
}

/// Ids of the vocabulary that an attachment with these channels can have.
pub fn ids(channels: &[String]) -> Vec<&'static str> {
    let commands = channels.iter().any(|c| c == "actuator").then_some(COMMANDS.map(|c| c.0));
    let blocks = channels.iter().flat_map(|channel| kinds(channel).1.iter().map(|kind| kind.id));
    blocks.chain(commands.into_iter().flatten()).collect()
}
