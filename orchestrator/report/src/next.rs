//! Proposals for the next measurement, from the questions that the records left open.

use std::collections::BTreeSet;

use super::{names, words};
use airloop_refine::answer::{Answer, Effect, Verdict};

/// Share of a value above which its 95 % interval counts as wide.
const MIN_WIDE_INTERVAL_SHARE: f64 = 0.3;
/// Error as a multiple of its floor up to which nothing worth measuring is left.
const COMPLETE: f64 = 3.0;

/// Pieces of advice, most useful first, one sentence each.
pub fn advice(answer: &Answer) -> Vec<String> {
    let mut found = Vec::new();
    for chosen in answer.effects.iter().filter(|effect| effect.selected && effect.group.is_some()) {
        let rivals = answer.effects.iter().filter(|e| !e.selected && e.group == chosen.group);
        for rival in rivals {
            found.push(format!(
                "To tell {} from {}: {}.",
                words::name(chosen),
                words::name(rival),
                separation(chosen, rival, answer)
            ));
        }
    }
    if let Some((place, variables)) = answer.unexplained.as_ref().filter(|_| !answer.cylinder) {
        let (channel, port) = names::place(place);
        let on = match &variables[..] {
            [] => "over the whole range of the motion, slowly and fast".to_owned(),
            [one] if one == "time" => "of the same motion, begun at other times".to_owned(),
            [one] => format!(
                "that move {} over its whole range while the other variables stay small or repeat",
                names::variable(one)
            ),
            [first, second, ..] => {
                format!(
                    "that move {} and {} apart from each other",
                    names::variable(first),
                    names::variable(second)
                )
            }
        };
        let at = port.unwrap_or(names::channel(channel));
        found.push(format!("To learn what is missing at {at}: records {on}."));
    }
    for effect in answer.effects.iter().filter(|effect| effect.selected) {
        for p in &effect.parameters {
            let half = 0.5 * (p.interval.1 - p.interval.0);
            let apart_from_zero = p.interval.0 * p.interval.1 > 0.0;
            if half > MIN_WIDE_INTERVAL_SHARE * p.value.abs() && apart_from_zero {
                found.push(format!(
                    "{} of {} is known to {:.0} % only: record a command that excites it more, or repeat the trials; four times the data halve the interval.",
                    p.name,
                    words::name(effect),
                    100.0 * half / p.value.abs()
                ));
            }
        }
    }
    let measured: BTreeSet<&str> = answer.noise.keys().map(String::as_str).collect();
    let coupled = measured.contains("x") && measured.contains("theta");
    let rig = answer.effects.iter().all(|effect| effect.port.is_none());
    if rig && coupled && !measured.contains("F_p") && answer.verdict != Verdict::Nothing {
        found.push("A load cell between piston rod and cart (F_p) would separate the actuator and the piston from the cart.".into());
    }
    if answer.not_testable.iter().any(|(id, _)| id == "act.area") && answer.verdict == Verdict::Unexplained {
        found.push(
            "A chamber pressure sensor would make an error of the effective piston area (act.area) testable."
                .into(),
        );
    }
    let known = answer.floor[1].keys();
    let left = known.filter_map(|own| answer.times_floor(&answer.after[1], own)).fold(0.0, f64::max);
    if answer.verdict == Verdict::Effect && left > COMPLETE {
        found.push(format!(
            "The same motion as a validation record once more: what both runs leave alike (up to {left:.1} times what the sensors give) the model still lacks, the rest changes from run to run."
        ));
    }
    if found.is_empty() {
        found.push(match answer.verdict {
            Verdict::Nothing => "Nothing for the motions of these records. Effects that they do not excite (other amplitudes, longer runs, other positions) remain open.".into(),
            _ => "A new record that was not part of this case, run through the amended system: it should leave only sensor noise.".into(),
        });
    }
    found
}

/// Sentence on the measurement that separates two effects.
fn separation(one: &Effect, other: &Effect, answer: &Answer) -> String {
    let ids = [one.id.as_str(), other.id.as_str()];
    let both = |a: &str, b: &str| ids.contains(&a) && ids.contains(&b);
    let load_cell = !answer.noise.contains_key("F_p");
    let across = one.channel != other.channel;
    let rig = one.port.is_none() && other.port.is_none();
    if both("pole.payload", "pole.length") {
        return "weigh the pole, or measure where it balances".into();
    }
    if both("act.delay", "act.mode") {
        return "record the pressure force F_hat with the rod fixed, with steps of the command".into();
    }
    if both("act.gain", "act.droop") {
        return "record a run of several time constants under a constant command".into();
    }
    if ids.contains(&"cart.tilt") && ids.contains(&"sensor.offset") {
        return "put a spirit level on the guide, or record the pole at rest".into();
    }
    if let (Some(a), Some(b)) = (&one.port, &other.port)
        && a != b
        && ids.iter().all(|id| !id.starts_with("sensor."))
    {
        return format!(
            "move what {a} drives and what {b} drives apart from each other, or measure between them"
        );
    }
    if rig && across && load_cell {
        return "add a load cell between piston rod and cart (F_p), or pressure sensors (F_hat)".into();
    }
    if ids.iter().all(|id| id.starts_with("sensor.")) {
        return "calibrate the sensor at rest at two known values".into();
    }
    if ids.iter().any(|id| id.starts_with("sensor.")) {
        return "check the sensor against a second one, or at known values".into();
    }
    if rig && ids.iter().all(|id| id.starts_with("pf.") || id.starts_with("cf.")) {
        return "move the part alone through its load cell, slowly through standstill and fast in both directions".into();
    }
    "record commands with other amplitudes and speeds, in which the two act differently".into()
}
