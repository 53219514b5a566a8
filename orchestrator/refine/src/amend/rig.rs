//! The declared rig of a case as a system of FMUs, and where the blocks of an answer go in it.

use super::blocks::{self, COMMAND_ORDER, Sources, output, value};
use super::network::{Network, Part, end};
use super::own;
use crate::answer::{Answer, Effect};
use crate::case::{Actuator, CartPole, Declaration, Declared, Friction, Kind};
use crate::law::found::Law;
use crate::rig::cylinder::Cylinder;
use crate::rig::extra::Place;
use airloop_fmi::derive::Value;

/// Stop time of the system \[s\]: the length of a usual record.
const STOP_TIME: f64 = 4.0;

/// The declared system of a case with the selected effects and corrections of an answer.
pub fn network(declaration: &Declaration, answer: &Answer) -> Network {
    let corrected = corrected(&declaration.model, answer);
    let selected: Vec<&Effect> = answer.effects.iter().filter(|effect| effect.selected).collect();
    match declaration.kind {
        Kind::Cartpole => cart_pole(&corrected, &selected, answer.cylinder, answer.law.as_ref()),
        Kind::Actuator => rod_fixed(&corrected, &selected),
        Kind::Friction => frictions(&corrected, &selected),
    }
}

/// Declared parameters with the corrections of an answer, and with the effects that change masses and lengths.
fn corrected(declared: &Declared, answer: &Answer) -> Declared {
    let mut model = declared.clone();
    let share =
        |name: &str| answer.corrections.iter().find(|own| own.path() == name).map_or(0.0, |own| own.moved);
    let scale = |value: &mut f64, name: &str| *value *= 1.0 + share(name);
    if let Some(actuator) = &mut model.actuator {
        *actuator = actuator.moved(share("actuator.gain"), share("actuator.poles"), share("actuator.spread"));
    }
    for (name, friction) in
        [("piston_friction", &mut model.piston_friction), ("cart_friction", &mut model.cart_friction)]
    {
        let Some(c) = friction else { continue };
        for (index, value) in [&mut c.c1, &mut c.c2, &mut c.c3, &mut c.c4, &mut c.c5].into_iter().enumerate()
        {
            scale(value, &format!("{name}.c{}", index + 1));
        }
    }
    let own = model.cylinder.cylinder();
    model.cylinder = own.map(|name, value| Some(value * (1.0 + share(&format!("cylinder.{name}")))));
    if let Some(body) = &mut model.cart_pole {
        for (value, name) in
            [(&mut body.m_c, "m_c"), (&mut body.m_p, "m_p"), (&mut body.l, "l"), (&mut body.b_p, "b_p")]
        {
            scale(value, &format!("cart_pole.{name}"));
        }
        for effect in answer.effects.iter().filter(|effect| effect.selected) {
            match effect.id.as_str() {
                "cart.mass" => body.m_c += value(effect, "mass"),
                "pole.length" => body.l += value(effect, "delta"),
                _ => {}
            }
        }
        if let Some(effect) = answer.effects.iter().find(|e| e.selected && e.id == "pole.payload") {
            load(body, value(effect, "mass"));
        }
    }
    model
}

/// A point mass at the free end of the rod: the masses and the length that have the same mass, first and second moment.
fn load(body: &mut CartPole, mass: f64) {
    let (m, l, d) = (body.m_p, body.l, body.tip_distance);
    let (total, first, second) = (body.m_c + m + mass, m * l + mass * d, m * l * l + mass * d * d);
    body.l = second / first;
    body.m_p = first / body.l;
    body.m_c = total - body.m_p;
}

fn reals(values: &[(String, f64)]) -> Vec<(String, Value)> {
    values.iter().map(|(name, value)| (name.clone(), Value::Real(*value))).collect()
}

fn actuator(model: &Actuator) -> Part {
    let mut values = vec![("sample_time".to_owned(), model.sample_time)];
    for i in 0..2 {
        for j in 0..2 {
            values.push((format!("A1[{},{}]", i + 1, j + 1), model.A1[i][j]));
        }
        values.push((format!("B0[{}]", i + 1), model.B0[i]));
        values.push((format!("B1[{}]", i + 1), model.B1[i]));
    }
    Part {
        name: "actuator".into(),
        template: "arx-actuator",
        description: "Declared actuator".into(),
        start: reals(&values),
    }
}

/// The cylinder under the name of the actuator whose place it takes.
fn moving(k: &Cylinder, sample_time: f64) -> Part {
    let named = k.named().into_iter().map(|(name, value)| (name.to_owned(), value));
    let values: Vec<(String, f64)> = named.chain([("sample_time".to_owned(), sample_time)]).collect();
    Part {
        name: "actuator".into(),
        template: "pneumatic-cylinder",
        description: "Pneumatic cylinder in place of the declared actuator".into(),
        start: reals(&values),
    }
}

fn friction(name: &str, c: &Friction) -> Part {
    let values = [("c1", c.c1), ("c2", c.c2), ("c3", c.c3), ("c4", c.c4), ("c5", c.c5)];
    Part {
        name: name.into(),
        template: "friction",
        description: format!("Declared {}", name.replace('_', " ")),
        start: reals(&values.map(|(name, value)| (name.to_owned(), value))),
    }
}

/// `cylinder`: a pneumatic cylinder from first principles stands in for the declared actuator.
fn cart_pole(model: &Declared, selected: &[&Effect], cylinder: bool, law: Option<&Law>) -> Network {
    let mut network = Network::new("amended_cart_pole", STOP_TIME);
    let (piston, cart) =
        (model.piston_friction.clone().unwrap_or_default(), model.cart_friction.clone().unwrap_or_default());
    let body = model.cart_pole.clone().unwrap_or_default();
    let sample_time = model.actuator.as_ref().map_or(1e-3, |actuator| actuator.sample_time);
    match &model.actuator {
        _ if cylinder => network.add(moving(&model.cylinder.cylinder(), sample_time)),
        Some(own) => network.add(actuator(own)),
        None => {}
    }
    network.add(friction("piston_friction", &piston));
    network.add(friction("cart_friction", &cart));
    let values = [("m_c", body.m_c), ("m_p", body.m_p), ("l", body.l), ("g", body.g), ("b_p", body.b_p)];
    network.add(Part {
        name: "cart_pole".into(),
        template: "cart-pole",
        description: "Declared cart and pole".into(),
        start: reals(&values.map(|(name, value)| (name.to_owned(), value))),
    });
    let force = Some("N");
    for (from, to) in [
        (end("", "u"), end("actuator", "u")),
        (end("actuator", "F_act"), end("piston_friction", "F_in")),
        (end("piston_friction", "F_out"), end("cart_friction", "F_in")),
        (end("cart_friction", "F_out"), end("cart_pole", "F")),
        (end("actuator", "F_hat"), end("", "F_hat")),
        (end("actuator", "F_act"), end("", "F_act")),
        (end("piston_friction", "F_out"), end("", "F_p")),
    ] {
        network.connect(from, to, force, 1.0);
    }
    for (name, unit) in [("x", "m"), ("v", "m/s")].into_iter().filter(|_| cylinder) {
        network.connect(end("cart_pole", name), end("actuator", name), Some(unit), 1.0);
    }
    for friction in ["piston_friction", "cart_friction"] {
        network.connect(end("cart_pole", "v"), end(friction, "v"), Some("m/s"), 1.0);
    }
    for (name, unit) in [("x", "m"), ("theta", "rad"), ("v", "m/s"), ("omega", "rad/s")] {
        network.connect(end("cart_pole", name), end("", name), Some(unit), 1.0);
    }
    let plant = |name: &str| output("cart_pole", name);
    let mut sources = Sources {
        x: plant("x"),
        v: plant("v"),
        theta: plant("theta"),
        omega: plant("omega"),
        f_hat: output("actuator", "F_hat"),
        p: None,
    };
    commands(&mut network, selected, sample_time, &sources);
    let found = |id: &str| selected.iter().find(|effect| effect.id == id).copied();
    if let Some(effect) = found("act.backpressure") {
        let start = [("sample_time", sample_time), ("backpressure_coef", value(effect, "coef"))];
        for (to, suffix) in [(end("", "F_hat"), "_F_hat"), (end("piston_friction", "F_in"), "_F_act")] {
            network.insert(&to, blocks::signal(effect, suffix, &start, &["v"], &sources), true);
        }
        sources.f_hat = output("effect_act_backpressure_F_hat", "y");
    }
    let [piston, cart] = [(&piston, "pf.coulomb"), (&cart, "cf.coulomb")].map(|(own, id)| {
        // Presliding acts on the level that is added, too.
        Friction { c1: own.c1 + found(id).map_or(0.0, |effect| value(effect, "force")), ..own.clone() }
    });
    let weight = (body.m_c + body.m_p) * body.g;
    let moment = body.m_p * body.l * body.g;
    for &effect in selected {
        let (to, outputs, block) = match effect.channel.as_str() {
            "piston_friction" => {
                (end("cart_friction", "F_in"), true, blocks::friction(effect, &piston, &sources))
            }
            "cart_friction" => (end("cart_pole", "F"), false, blocks::friction(effect, &cart, &sources)),
            "cart" => (end("cart_pole", "F"), false, blocks::cart(effect, weight, &sources)),
            _ => continue,
        };
        if let Some(block) = block {
            network.insert(&to, block, outputs);
        }
    }
    if let Some(law) = law
        && let Some(own) = &law.effect.own
    {
        let angular = Sources { x: plant("theta"), v: plant("omega"), ..Sources::default() };
        let place = Place::at(&law.port);
        let own_sources = if place == Some(Place::Pole) { &angular } else { &sources };
        let name = blocks::name(&law.effect);
        let block =
            |suffix: &str| own::block(own, (&law.effect, format!("{name}{suffix}")), 1.0, own_sources);
        match place {
            Some(Place::Command) => network.insert(&end("actuator", "u"), block(""), false),
            // Both sides of the piston feel it, and so do the pressures.
            Some(Place::Force) => {
                network.insert(&end("", "F_hat"), block("_F_hat"), true);
                network.insert(&end("piston_friction", "F_in"), block("_F_act"), true);
            }
            Some(Place::Piston) => network.insert(&end("cart_friction", "F_in"), block(""), true),
            Some(Place::Cart) => network.insert(&end("cart_pole", "F"), block(""), false),
            Some(Place::Pole) => network.insert(&end("cart_pole", "tau_ext"), block(""), false),
            None => {}
        }
    }
    for block in selected.iter().filter_map(|effect| blocks::pole(effect, moment, &sources)) {
        network.insert(&end("cart_pole", "tau_ext"), block, false);
    }
    sensors(&mut network, selected, sample_time, &["F_hat"]);
    network
}

/// Blocks in the command path, in the order in which they act.
fn commands(network: &mut Network, selected: &[&Effect], sample_time: f64, sources: &Sources) {
    for id in COMMAND_ORDER {
        for effect in selected.iter().filter(|effect| effect.id == id) {
            if let Some(block) = blocks::command(effect, sample_time, sources) {
                network.insert(&end("actuator", "u"), block, false);
            }
        }
    }
}

/// Blocks in front of the outputs of the system: delay first, then gain and offset, as a sensor applies them.
fn sensors(network: &mut Network, selected: &[&Effect], sample_time: f64, sampled: &[&str]) {
    for id in ["sensor.delay", "sensor.gain", "sensor.offset"] {
        for effect in selected.iter().filter(|effect| effect.id == id) {
            let Some(signal) = effect.signal.as_deref() else { continue };
            let starts_at_zero = signal == "F_p";
            let block = blocks::sensor(effect, sample_time, sampled.contains(&signal), starts_at_zero);
            if let Some(block) = block {
                network.insert(&end("", signal), block, false);
            }
        }
    }
}

/// The actuator alone; the load cell reads its force.
fn rod_fixed(model: &Declared, selected: &[&Effect]) -> Network {
    let mut network = Network::new("amended_actuator", STOP_TIME);
    let Some(own) = &model.actuator else { return network };
    network.add(actuator(own));
    network.connect(end("", "u"), end("actuator", "u"), Some("N"), 1.0);
    for (from, to) in [("F_hat", "F_hat"), ("F_act", "F_p")] {
        network.connect(end("actuator", from), end("", to), Some("N"), 1.0);
    }
    let none = Sources::default();
    commands(&mut network, selected, own.sample_time, &none);
    sensors(&mut network, selected, own.sample_time, &["F_hat", "F_p"]);
    network
}

/// Both frictions, moved at `v` through `x`; the outputs are their forces (of the cart without its inertia).
fn frictions(model: &Declared, selected: &[&Effect]) -> Network {
    let mut network = Network::new("amended_frictions", STOP_TIME);
    let input = |name: &str| Some(end("", name));
    let sources = Sources { x: input("x"), v: input("v"), ..Sources::default() };
    for (name, channel, shown, declared) in [
        ("piston_friction", "piston_friction", "f_piston", &model.piston_friction),
        ("cart_friction", "cart_friction", "f_cart", &model.cart_friction),
    ] {
        let declared = declared.clone().unwrap_or_default();
        network.add(friction(name, &declared));
        network.connect(end("", "v"), end(name, "v"), Some("m/s"), 1.0);
        network.connect(end(name, "F_out"), end("", shown), Some("N"), -1.0);
        let cart = channel == "cart_friction";
        for effect in selected {
            let block = match effect.channel.as_str() {
                own if own == channel => blocks::friction(effect, &declared, &sources),
                "cart" if cart => blocks::cart(effect, 0.0, &sources),
                _ => None,
            };
            if let Some(block) = block {
                network.insert(&end("", shown), block, false);
            }
        }
    }
    network
}
