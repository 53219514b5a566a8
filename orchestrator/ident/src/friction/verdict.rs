//! Verdict on a fit in words, and the warnings that the user should know.

use std::collections::BTreeMap;

use super::fit::{Fit, Origin};
use super::law::{C1, C2, C4, MASS, names};
use super::report::{Alternative, Flag, Parameter, Quality};
use super::track::Track;
use super::{Mass, Predict, Settings};

/// Samples in a row at the extreme force that look like a limit.
const SAMPLES_AT_A_LIMIT: usize = 20;

/// Warnings about the data and the fit.
pub fn flags(fit: &Fit, tracks: &[Track], settings: &Settings) -> Vec<Flag> {
    let mut flags = Vec::new();
    let mut flag = |id, message: String| flags.push(Flag { id, message });
    if fit.origin[C4] == Origin::AtBound {
        flag(
            "no-viscous-friction",
            "no viscous friction is seen: the data would ask for a negative coefficient, which cannot be; c4 is held at 0"
                .into(),
        );
    }
    if fit.origin[C1] == Origin::AtBound {
        flag(
            "no-coulomb-friction",
            "no Coulomb friction is seen: c1 is held at 0, and c2, c3 mean nothing".into(),
        );
    }
    if fit.origin[C2] == Origin::AtBound && fit.parameters[C2] > 0.0 {
        flag(
            "slope-not-resolved",
            format!(
                "the sign change is steeper than the data resolve: c2 is held at {:.3e} s/m; fix it with --fix c2=VALUE",
                fit.parameters[C2]
            ),
        );
    }
    if !fit.dependent.is_empty() {
        let all = names(fit.law);
        let named: Vec<&str> =
            fit.dependent.iter().filter_map(|&j| all.get(j).map(|(_, name, _)| *name)).collect();
        flag(
            "not-told-apart",
            format!(
                "the data do not tell {} apart; fix one of them (--fix), or record motion in both directions at several speeds",
                named.join(", ")
            ),
        );
    }
    for (sign, direction) in [(1.0, "backwards"), (-1.0, "forwards")] {
        if tracks.iter().all(|track| track.motion.velocity.iter().all(|v| sign * v >= 0.0)) {
            flag(
                "one-direction",
                format!("nothing moves {direction}: Coulomb friction and bias are not told apart"),
            );
        }
    }
    for track in tracks {
        if track.unordered {
            flag(
                "not-smoothed",
                format!(
                    "{}: the velocity is not smooth over time; it is taken as measured, without error",
                    track.name
                ),
            );
        }
        let longest = longest_at_extreme(&track.force);
        if longest >= SAMPLES_AT_A_LIMIT {
            flag(
                "saturated",
                format!(
                    "{}: the force stays at its extreme for {longest} samples; it looks limited, leave that part out",
                    track.name
                ),
            );
        }
        let gap = widest_gap(&track.time);
        if gap.1 > 5.0 {
            flag(
                "gap",
                format!(
                    "{}: {:.3} s without samples at {:.3} s; the motion is interpolated there",
                    track.name, gap.2, gap.0
                ),
            );
        }
    }
    if settings.mass == Mass::None && settings.predict == Predict::Force {
        let share = inertia_share(fit, tracks);
        if share > 0.1 {
            flag(
                "inertia",
                format!(
                    "{:.0} % of the remaining error goes with the acceleration: give --mass or --fit-mass",
                    100.0 * share
                ),
            );
        }
    }
    if fit.agreement < 0.3 {
        flag(
            "several-minima",
            format!(
                "only {:.0} % of the starts reached the best minimum; richer data would settle it",
                100.0 * fit.agreement
            ),
        );
    }
    if !fit.converged {
        flag("not-converged", "the fit stopped before it settled; its parameters are not final".into());
    }
    if fit.memory > 3.0 {
        flag(
            "error-not-white",
            format!(
                "errors resemble their neighbors over {:.0} samples: the residual is more than white sensor noise; intervals are widened for it",
                fit.memory
            ),
        );
    }
    flags
}

/// Longest run of samples at the highest or lowest force.
fn longest_at_extreme(force: &[f64]) -> usize {
    let high = force.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let low = force.iter().copied().fold(f64::INFINITY, f64::min);
    let runs = force.chunk_by(|a, b| a == b).filter(|run| run[0] == high || run[0] == low);
    runs.map(<[f64]>::len).max().unwrap_or(0)
}

/// Widest gap between samples: time before it, times the mean sample time, in s.
fn widest_gap(time: &[f64]) -> (f64, f64, f64) {
    let mean = (time[time.len() - 1] - time[0]) / (time.len() - 1) as f64;
    let widest = time.windows(2).map(|pair| (pair[0], pair[1] - pair[0])).max_by(|a, b| a.1.total_cmp(&b.1));
    widest.map_or((0.0, 0.0, 0.0), |(at, gap)| (at, gap / mean, gap))
}

/// Share of the squared errors that a linear term in the acceleration explains.
fn inertia_share(fit: &Fit, tracks: &[Track]) -> f64 {
    let (mut ee, mut ea, mut aa) = (0.0, 0.0, 0.0);
    for (errors, track) in fit.errors.iter().zip(tracks) {
        for (e, a) in errors.iter().zip(&track.motion.acceleration) {
            (ee, ea, aa) = (ee + e * e, ea + e * a, aa + a * a);
        }
    }
    if ee * aa > 0.0 { ea * ea / (ee * aa) } else { 0.0 }
}

/// The result in words.
pub fn sentences(
    fit: &Fit,
    parameters: &BTreeMap<&'static str, Parameter>,
    estimation: &Quality,
    validation: Option<&Quality>,
    alternatives: &[Alternative],
    settings: &Settings,
) -> Vec<String> {
    let mut said = Vec::new();
    let unit = if settings.predict == Predict::Force { "N" } else { "m" };
    let percent = |fit: Option<f64>| fit.map_or(String::new(), |fit| format!(" (fit {fit:.1} %)"));
    said.push(match validation {
        Some(validation) => format!(
            "{}: rms error {:.4} {unit}{} on estimation, {:.4} {unit}{} on validation records",
            fit.law.words(),
            estimation.rms,
            percent(estimation.fit),
            validation.rms,
            percent(validation.fit)
        ),
        None => format!(
            "{}: rms error {:.4} {unit}{}; no validation records were given, so nothing says how it predicts others",
            fit.law.words(),
            estimation.rms,
            percent(estimation.fit)
        ),
    });
    if fit.origin[C4] == Origin::AtBound {
        let upper = parameters
            .get("c4")
            .and_then(|c4| c4.ci95)
            .map_or(String::new(), |ci| format!(", at most {:.3} N.s/m", ci[1]));
        said.push(format!("no viscous friction is seen{upper}"));
    }
    let zero = |name: &&str| {
        let parameter = &parameters[*name];
        parameter.origin == "estimated" && parameter.ci95.is_some_and(|[low, high]| low <= 0.0 && high >= 0.0)
    };
    let small: Vec<&str> = ["c3", "c4", "c5"].into_iter().filter(zero).collect();
    if !small.is_empty() {
        let out: Vec<String> = small.iter().map(|name| format!("--fix {name}=0")).collect();
        let them = if small.len() == 1 { "it" } else { "them" };
        said.push(format!(
            "{} cannot be told from zero; {} leaves {them} out",
            small.join(", "),
            out.join(" ")
        ));
    }
    let offered: Vec<&Alternative> = alternatives.iter().filter(|a| a.offered).collect();
    match validation {
        Some(validation) if !offered.is_empty() => {
            said.extend(offered.iter().enumerate().map(|(index, found)| {
                format!(
                    "the data {}ask for {}: rms error {:.4} instead of {:.4} {unit} on validation records (--law {})",
                    if index == 0 { "" } else { "also " },
                    found.what,
                    found.validation_rms,
                    validation.rms,
                    found.law.id()
                )
            }));
        }
        Some(_) if !alternatives.is_empty() => {
            said.push("no alternative improves the validation records clearly".into());
        }
        _ => {}
    }
    if settings.mass == Mass::Fit && fit.origin[MASS] == Origin::AtBound {
        said.push("the moving mass does not show in these records".into());
    }
    said
}
