//! The curve of an effect over the variable that it depends on, with the band of its parameters.

use super::Record;
use crate::answer::{Answer, Effect};
use crate::case::{Case, Friction};

/// Points of a curve.
const POINTS: usize = 121;

/// An effect over a variable.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Effect.
    pub title: String,
    /// Variable and unit.
    pub over: (String, String),
    /// Meaning of the ordinate and its unit.
    pub what: (String, String),
    /// Per point: variable, value, lower and upper end of the 95 % band.
    pub points: Vec<[f64; 4]>,
}

/// One value of an effect, for a value of its variable and of its parameters by name.
pub(super) type Law<'a> = dyn Fn(f64, &dyn Fn(&str) -> f64) -> f64 + 'a;

/// A law with what it is over and what it gives, and their units on a cart.
struct Drawn {
    over: (&'static str, &'static str),
    what: (&'static str, &'static str),
    law: Box<Law<'static>>,
}

/// Curves of the selected effects that are a function of one variable.
pub fn of(case: &Case, answer: &Answer, records: &[Record]) -> Vec<Curve> {
    let model = &case.declaration.model;
    let friction = |effect: &Effect| {
        let own = match effect.channel.as_str() {
            "piston_friction" => model.piston_friction.clone(),
            _ => model.cart_friction.clone(),
        };
        own.unwrap_or_default()
    };
    let selected = answer.effects.iter().filter(|effect| effect.selected);
    selected
        .filter_map(|effect| {
            let Drawn { over, what, law } = drawn(effect, &friction(effect))?;
            let named = |(name, unit): (&str, &str)| (name.to_owned(), unit.to_owned());
            Some(sampled(effect, named(over), named(what), &law, range(records, over.0)?))
        })
        .collect()
}

/// Range of a variable in the records.
fn range(records: &[Record], name: &str) -> Option<(f64, f64)> {
    if name == "time" {
        let last = |r: &Record| r.residuals.first().map_or(0, |x| x.measured.len()) as f64 * r.sample_time;
        return Some((0.0, records.iter().map(last).fold(0.0, f64::max)));
    }
    let values = records.iter().flat_map(|r| r.variables.iter().filter(|v| v.name == name));
    let (low, high) = values
        .flat_map(|variable| variable.values.iter())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| (low.min(v), high.max(v)));
    (low < high).then_some((low, high))
}

/// A curve of an effect over a variable between two values, with the band of its parameters.
pub(super) fn sampled(
    effect: &Effect,
    over: (String, String),
    what: (String, String),
    law: &Law,
    (low, high): (f64, f64),
) -> Curve {
    let at = |moved: Option<(usize, f64)>| {
        move |name: &str| {
            let found = effect.parameters.iter().enumerate().find(|(_, p)| p.name == name);
            found.map_or(0.0, |(index, p)| match moved {
                Some((own, value)) if own == index => value,
                _ => p.value,
            })
        }
    };
    let point = |k: usize| {
        let x = low + (high - low) * k as f64 / (POINTS - 1) as f64;
        let value = law(x, &at(None));
        let spread = effect.parameters.iter().enumerate().map(|(index, p)| {
            let ends = [p.interval.0, p.interval.1].map(|end| law(x, &at(Some((index, end)))) - value);
            ends.iter().map(|difference| difference.abs()).fold(0.0, f64::max).powi(2)
        });
        let half = spread.filter(|square| square.is_finite()).sum::<f64>().sqrt();
        [x, value, value - half, value + half]
    };
    let signal = effect.signal.as_ref().map_or(String::new(), |signal| format!(" of {signal}"));
    let shown = |(name, unit): (String, String)| (name, unit.replace(['.', '*'], " "));
    Curve {
        title: format!("{}{signal}", effect.id),
        over: shown(over),
        what: shown(what),
        points: (0..POINTS).map(point).collect(),
    }
}

fn drawn(effect: &Effect, declared: &Friction) -> Option<Drawn> {
    let (c1, c2, c3) = (declared.c1, declared.c2, declared.c3);
    let s = move |v: f64| (c2 * (v - c3)).tanh();
    let (force, torque) = (("friction force", "N"), ("torque", "N m"));
    let (v, x, omega, u, t) = (("xdot", "m/s"), ("x", "m"), ("thetadot", "rad/s"), ("u", "N"), ("time", "s"));
    let command = ("command behind the effect", "N");
    let make = |over, what, law: Box<Law<'static>>| Some(Drawn { over, what, law });
    let (channel, kind) = effect.id.split_once('.')?;
    match (channel, kind) {
        ("pf" | "cf", "viscous") => make(v, force, Box::new(|v, p| p("coef") * v)),
        ("pf" | "cf", "coulomb") => make(v, force, Box::new(move |v, p| p("force") * s(v))),
        ("pf" | "cf", "stribeck") => make(
            v,
            force,
            Box::new(move |v, p| p("force") * (-((v - c3) / p("vs").max(1e-9)).powi(2)).exp() * s(v)),
        ),
        ("pf" | "cf", "offset") => make(v, force, Box::new(|_, p| p("value"))),
        ("pf" | "cf", "asymmetry") => make(
            v,
            force,
            Box::new(move |v, p| if v > 0.0 { p("force") * s(v) + p("coef") * v } else { 0.0 }),
        ),
        ("cf", "poscoulomb") => make(x, ("Coulomb level", "N"), Box::new(|x, p| p("slope") * x)),
        ("pf", "pressure") => make(("F", "N"), ("Coulomb level", "N"), Box::new(|f, p| p("coef") * f.abs())),
        // The first slip from rest: z/disp = 1 - exp(-way/disp).
        ("pf" | "cf", "presliding") => make(
            ("x", "m"),
            ("friction after a reversal", "N"),
            Box::new(move |x, p| c1 * (1.0 - (-x.abs() / p("disp").max(1e-9)).exp())),
        ),
        ("cart", "spring") => {
            make(x, ("force on the cart", "N"), Box::new(|x, p| -p("stiffness") * (x - p("rest"))))
        }
        ("cart", "endstop") => make(
            x,
            ("force on the cart at rest", "N"),
            Box::new(|x, p| -(p("stiffness") * (x - p("pos"))).max(0.0)),
        ),
        ("cart", "cogging") => make(
            x,
            ("force on the cart", "N"),
            Box::new(|x, p| {
                -p("amp") * (std::f64::consts::TAU * x / p("period").max(1e-9) + p("phase")).sin()
            }),
        ),
        ("pole", "viscous") => make(omega, torque, Box::new(|w, p| p("coef") * w)),
        ("pole", "coulomb") => make(omega, torque, Box::new(|w, p| p("torque") * (w / 0.05).tanh())),
        ("pole", "quaddrag") => make(omega, torque, Box::new(|w, p| p("coef") * w.abs() * w)),
        ("act", "gain") => make(u, command, Box::new(|u, p| (1.0 + p("gain")) * u)),
        ("act", "deadband") => {
            make(u, command, Box::new(|u, p| u - u.clamp(-p("width").abs(), p("width").abs())))
        }
        ("act", "saturation") => {
            make(u, command, Box::new(|u, p| u.clamp(-p("limit").abs(), p("limit").abs())))
        }
        ("act", "posgain") => make(x, ("gain of the command", "1"), Box::new(|x, p| 1.0 + p("slope") * x)),
        ("act", "backpressure") => make(v, ("force lost", "N"), Box::new(|v, p| p("coef") * v)),
        ("act", "droop") => make(
            t,
            ("gain of the command", "1"),
            Box::new(|t, p| 1.0 - p("depth") * (1.0 - (-t / p("tau").max(1e-9)).exp())),
        ),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::answer::Parameter;

    #[test]
    fn the_band_of_a_line_grows_with_the_distance_from_its_root() {
        let parameter = |name: &str, value: f64, half: f64| Parameter {
            name: name.into(),
            unit: String::new(),
            value,
            interval: (value - half, value + half),
        };
        let effect = Effect {
            id: "cart.spring".into(),
            channel: "cart".into(),
            signal: None,
            selected: true,
            group: None,
            score: 0.0,
            parameters: vec![parameter("stiffness", 20.0, 1.0), parameter("rest", 0.0, 0.0)],
            reason: String::new(),
            ..Effect::default()
        };
        let Drawn { law, .. } = drawn(&effect, &Friction::default()).unwrap();
        let axes = [("phi", "rad"), ("added to tau", "N.m")].map(|(a, b)| (a.to_owned(), b.to_owned()));
        let [over, what] = axes;
        let curve = sampled(&effect, over, what, &law, (-0.1, 0.1));
        assert_eq!([&curve.over.1, &curve.what.1], ["rad", "N m"]);
        let [x, y, low, high] = curve.points[0];
        assert_eq!(x, -0.1);
        assert!((y - 2.0).abs() < 1e-12 && (low - 1.9).abs() < 1e-12 && (high - 2.1).abs() < 1e-12);
        let middle = curve.points[POINTS / 2];
        assert!(middle[3] - middle[2] < 1e-12);
    }
}
