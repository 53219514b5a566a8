//! Which block an effect of the vocabulary becomes.

use super::network::{Block, Part, end};
use crate::answer::Effect;
use crate::case::Friction;
use airloop_cosim::system::ssp::Endpoint;
use airloop_fmi::derive::Value;

/// Where the further inputs of a block get their values: position, speed, angle, angular speed, pressure force.
#[derive(Debug, Clone, Default)]
pub struct Sources {
    /// Position \[m\].
    pub x: Option<Endpoint>,
    /// Speed \[m/s\].
    pub v: Option<Endpoint>,
    /// Angle of the pole \[rad\].
    pub theta: Option<Endpoint>,
    /// Angular speed of the pole \[rad/s\].
    pub omega: Option<Endpoint>,
    /// Force of the pressure difference \[N\].
    pub f_hat: Option<Endpoint>,
    /// Pressure of a chamber \[Pa\].
    pub p: Option<Endpoint>,
}

impl Sources {
    fn of(&self, input: &str) -> Option<(Option<&'static str>, Endpoint)> {
        let (unit, source) = match input {
            "x" => ("m", &self.x),
            "v" => ("m/s", &self.v),
            "theta" => ("rad", &self.theta),
            "omega" => ("rad/s", &self.omega),
            "F_hat" => ("N", &self.f_hat),
            "p" => ("Pa", &self.p),
            _ => return None,
        };
        source.clone().map(|source| (Some(unit), source))
    }
}

/// Start values of a block: parameter and value.
pub type Start<'a> = &'a [(&'a str, f64)];

/// Value of a parameter of an effect; 0 where it has none of that name.
pub fn value(effect: &Effect, name: &str) -> f64 {
    effect.parameters.iter().find(|p| p.name == name).map_or(0.0, |p| p.value)
}

/// Name of the component of an effect: `effect_cart_spring`.
pub fn name(effect: &Effect) -> String {
    let id = effect.id.replace('.', "_");
    effect.signal.as_ref().map_or(format!("effect_{id}"), |signal| format!("effect_{id}_{signal}"))
}

fn part(name: String, effect: &Effect, template: &'static str, start: Start) -> Part {
    let start = start.iter().map(|(name, value)| ((*name).to_owned(), Value::Real(*value))).collect();
    Part { name, template, description: format!("What the declared model lacks: {}", effect.id), start }
}

fn block(
    part: Part,
    way: (&'static str, &'static str, Option<&'static str>),
    inputs: &[&'static str],
    sources: &Sources,
) -> Block {
    let further = inputs.iter().filter_map(|&input| {
        let (unit, source) = sources.of(input)?;
        Some((input, unit, source))
    });
    let further = further.collect();
    Block { part, way, further }
}

/// Force taken off the way of a force.
pub fn force(effect: &Effect, start: Start, inputs: &[&'static str], sources: &Sources) -> Block {
    block(part(name(effect), effect, "force-effect", start), ("F_in", "F_out", Some("N")), inputs, sources)
}

/// Torque taken off the way of a torque.
pub fn torque(effect: &Effect, start: Start, inputs: &[&'static str], sources: &Sources) -> Block {
    let name = name(effect) + if effect.channel == "pole" { "" } else { "_torque" };
    block(part(name, effect, "torque-effect", start), ("tau_in", "tau_out", Some("N.m")), inputs, sources)
}

/// Sampled change of a signal.
pub fn signal(
    effect: &Effect,
    suffix: &str,
    start: Start,
    inputs: &[&'static str],
    sources: &Sources,
) -> Block {
    block(part(name(effect) + suffix, effect, "signal-effect", start), ("u", "y", None), inputs, sources)
}

/// The block of an effect in the command path.
pub fn command(effect: &Effect, sample_time: f64, sources: &Sources) -> Option<Block> {
    let own = |name: &str| value(effect, name);
    let (start, inputs): (Vec<(&str, f64)>, &[&'static str]) = match effect.id.as_str() {
        "act.delay" => (vec![("delay", own("delay"))], &[]),
        "act.hysteresis" => (vec![("hysteresis_width", own("width"))], &[]),
        "act.deadband" => (vec![("deadband_width", own("width"))], &[]),
        "act.saturation" => (vec![("saturation_limit", own("limit"))], &[]),
        "act.gain" => (vec![("gain", own("gain"))], &[]),
        "act.posgain" => (vec![("posgain_slope", own("slope"))], &["x"]),
        "act.droop" => (vec![("droop_depth", own("depth")), ("droop_tau", own("tau"))], &[]),
        "act.mode" => (vec![("mode_freq", own("freq")), ("mode_zeta", own("zeta"))], &[]),
        _ => return None,
    };
    let start = [&[("sample_time", sample_time)], &start[..]].concat();
    Some(signal(effect, "", &start, inputs, sources))
}

/// The block of an effect on a command that remembers samples: held between them, or linear.
pub fn memory(effect: &Effect, name: &str, sample_time: f64, held: bool) -> Option<Block> {
    let own = |name: &str| value(effect, name);
    let (template, start) = match (effect.kind(), held) {
        ("delay", true) => ("signal-effect", ("delay", own("delay"))),
        ("delay", false) => ("sensor-effect", ("delay", own("delay"))),
        ("hysteresis", _) => ("signal-effect", ("hysteresis_width", own("width"))),
        _ => return None,
    };
    let mut part = part(name.to_owned(), effect, template, &[("sample_time", sample_time), start]);
    part.start.push(("starts_at_zero".into(), Value::Boolean(false)));
    Some(block(part, ("u", "y", None), &[], &Sources::default()))
}

/// The order in which effects of the command path act.
pub const COMMAND_ORDER: [&str; 8] = [
    "act.delay",
    "act.hysteresis",
    "act.deadband",
    "act.saturation",
    "act.gain",
    "act.posgain",
    "act.droop",
    "act.mode",
];

/// The block of a term that a declared friction lacks (`pf.*`, `cf.*`).
pub fn friction(effect: &Effect, declared: &Friction, sources: &Sources) -> Option<Block> {
    let own = |name: &str| value(effect, name);
    let sign = [("c2", declared.c2), ("c3", declared.c3)];
    let (_, kind) = effect.id.split_once('.').filter(|(part, _)| ["pf", "cf"].contains(part))?;
    let (start, inputs): (Vec<(&str, f64)>, &[&'static str]) = match kind {
        "viscous" => (vec![("viscous_coef", own("coef"))], &["v"]),
        "offset" => (vec![("offset_value", own("value"))], &[]),
        "coulomb" => (vec![("coulomb_force", own("force"))], &["v"]),
        "stribeck" => (vec![("stribeck_force", own("force")), ("stribeck_vs", own("vs"))], &["v"]),
        "presliding" => (vec![("presliding_disp", own("disp")), ("c1", declared.c1)], &["v"]),
        "pressure" => (vec![("pressure_coef", own("coef"))], &["v", "F_hat"]),
        "asymmetry" => (vec![("asymmetry_force", own("force")), ("asymmetry_coef", own("coef"))], &["v"]),
        "poscoulomb" => (vec![("poscoulomb_slope", own("slope"))], &["v", "x"]),
        _ => return None,
    };
    Some(force(effect, &[&sign[..], &start[..]].concat(), inputs, sources))
}

/// The block of a force on the cart; `weight` \[N\] of all that slides.
pub fn cart(effect: &Effect, weight: f64, sources: &Sources) -> Option<Block> {
    let own = |name: &str| value(effect, name);
    let (start, inputs): (Vec<(&str, f64)>, &[&'static str]) = match effect.id.as_str() {
        "cart.spring" => (vec![("spring_stiffness", own("stiffness")), ("spring_rest", own("rest"))], &["x"]),
        "cart.endstop" => (
            vec![
                ("endstop_pos", own("pos")),
                ("endstop_stiffness", own("stiffness")),
                ("endstop_damping", own("damping")),
            ],
            &["x", "v"],
        ),
        "cart.cogging" => (
            vec![
                ("cogging_amp", own("amp")),
                ("cogging_period", own("period")),
                ("cogging_phase", own("phase")),
            ],
            &["x"],
        ),
        "cart.tilt" => (vec![("tilt_angle", own("angle")), ("tilt_weight", weight)], &[]),
        _ => return None,
    };
    Some(force(effect, &start, inputs, sources))
}

/// The block of an error of the effective area of a chamber.
pub fn area(effect: &Effect, sources: &Sources) -> Option<Block> {
    let start = [("area_coef", value(effect, "coef"))];
    (effect.id == "act.area").then(|| force(effect, &start, &["p"], sources))
}

/// The block of a torque on the pole; `moment` \[N m\]: its weight times its arm.
pub fn pole(effect: &Effect, moment: f64, sources: &Sources) -> Option<Block> {
    let own = |name: &str| value(effect, name);
    let (start, inputs): (Vec<(&str, f64)>, &[&'static str]) = match effect.id.as_str() {
        "pole.viscous" => (vec![("viscous_coef", own("coef"))], &["omega"]),
        "pole.coulomb" => (vec![("coulomb_torque", own("torque"))], &["omega"]),
        "pole.quaddrag" => (vec![("quaddrag_coef", own("coef"))], &["omega"]),
        "cart.tilt" => (vec![("tilt_angle", own("angle")), ("tilt_moment", moment)], &["theta"]),
        _ => return None,
    };
    Some(torque(effect, &start, inputs, sources))
}

/// The block of a sensor. A sampled signal stays sampled; a continuous one had its first value before the record unless
/// it `starts_at_zero`.
pub fn sensor(effect: &Effect, sample_time: f64, sampled: bool, starts_at_zero: bool) -> Option<Block> {
    let parameter = match effect.id.as_str() {
        "sensor.offset" => ("offset_value", value(effect, "value")),
        "sensor.gain" => ("gain", value(effect, "gain")),
        "sensor.delay" => ("delay", value(effect, "delay")),
        _ => return None,
    };
    let none = Sources::default();
    let start = [parameter, ("sample_time", sample_time)];
    if sampled {
        return Some(signal(effect, "", &start, &[], &none));
    }
    let mut part = part(name(effect), effect, "sensor-effect", &start);
    part.start.push(("starts_at_zero".into(), Value::Boolean(starts_at_zero)));
    Some(block(part, ("u", "y", None), &[], &none))
}

/// An output of a component as a source.
pub fn output(component: &str, connector: &str) -> Option<Endpoint> {
    Some(end(component, connector))
}
