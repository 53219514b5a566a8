//! The sentences of a report.

use std::collections::BTreeSet;

use super::names;
use airloop_refine::answer::{Answer, Correction, Effect, Parameter, Verdict};
use airloop_refine::evidence::Signal;
use airloop_refine::law::found::Law;
use airloop_refine::share::percent;

/// Share of the error on held-out records that an effect has to take away to be named as the nearest of those that were
/// not accepted.
const MIN_SHARE_OF_NEAREST: f64 = 0.1;

/// A number with enough digits to read.
pub fn number(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 || (1e-3..1e5).contains(&size) {
        let digits = if size >= 100.0 {
            1
        } else if size >= 1.0 {
            3
        } else {
            5
        };
        format!("{value:.digits$}")
    } else {
        format!("{value:.3e}")
    }
}

/// Name of an effect, with the signal for sensors and the port where it is known.
pub fn name(effect: &Effect) -> String {
    match (&effect.signal, &effect.port) {
        (Some(signal), _) => format!("{} of {signal}", effect.id),
        (None, Some(port)) if !effect.id.contains('@') => format!("{} at {port}", effect.id),
        _ => effect.id.clone(),
    }
}

/// An effect in the words of a reader: at a port in those of any system, else in those of the rig.
pub fn what(effect: &Effect) -> String {
    match (&effect.signal, &effect.port) {
        (Some(signal), _) => format!("{} of {signal}", names::effect(&effect.id)),
        (None, Some(port)) => format!("{} at {port}", names::kind(effect.kind())),
        (None, None) => names::effect(&effect.id).to_owned(),
    }
}

/// An effect in the words of a reader, with its id.
fn in_words(effect: &Effect) -> String {
    match &effect.own {
        Some(own) if own.words.is_empty() => format!("{} ({})", effect.id, own.with_rates()),
        Some(own) => format!("{} ({}: {})", own.words, effect.id, own.with_rates()),
        None => format!("{} ({})", what(effect), effect.id),
    }
}

/// Parameters of an effect with half of their 95 % intervals.
fn size(effect: &Effect) -> String {
    let one = |p: &Parameter| {
        let unit = if p.unit == "1" { String::new() } else { format!(" {}", p.unit) };
        let half = 0.5 * (p.interval.1 - p.interval.0);
        let value = rounded(p.value, half);
        // A fit has no interval for a parameter that it holds at a bound.
        if half == 0.0 {
            return format!("{} {value}{unit} (as far as it may go)", p.name);
        }
        if !half.is_finite() {
            return format!("{} {value}{unit} (not determined by these records)", p.name);
        }
        format!("{} {value}{unit} \u{b1} {}", p.name, rounded(half, half))
    };
    let all: Vec<String> = effect.parameters.iter().map(one).collect();
    all.join(", ")
}

/// A value with as many digits as its uncertainty `half` leaves it, one more to read on.
pub fn rounded(value: f64, half: f64) -> String {
    if !(half > 0.0 && half.is_finite()) {
        return number(value);
    }
    let digits = 1 - half.log10().floor() as i32;
    match digits {
        _ if value.abs() >= 1e6 || (value != 0.0 && value.abs() < 1e-4) => {
            let significant = (value.abs().log10().floor() as i32 + digits).max(0) as usize;
            format!("{value:.significant$e}")
        }
        digits => format!("{value:.0$}", digits.max(0) as usize),
    }
}

/// The answer in one sentence, or two; of a search that ended early the best so far.
pub fn sentence(answer: &Answer) -> String {
    match (answer.partial, answer.verdict) {
        // Effects that were not tried are not excluded.
        (true, Verdict::Unexplained) => {
            let at = answer
                .unexplained
                .as_ref()
                .map_or_else(String::new, |(place, _)| format!(" at {}", at(place)));
            format!(
                "The search ended before it was through: something is missing{at}, and none of the effects tried so far explains it. Let it run to its end, or give it more time with --budget."
            )
        }
        (true, _) => format!("The search ended before it was through. So far: {}", answered(answer)),
        (false, _) => answered(answer),
    }
}

/// A place in words: its port, its channel, or both.
fn at(place: &str) -> String {
    match names::place(place) {
        ("", Some(port)) => port.to_owned(),
        (channel, Some(port)) => format!("{port} (channel {channel})"),
        (channel, None) => format!("{} (channel {channel})", names::channel(channel)),
    }
}

fn answered(answer: &Answer) -> String {
    let chosen: Vec<&Effect> = answer.effects.iter().filter(|effect| effect.selected).collect();
    let mut list: Vec<String> =
        chosen.iter().map(|effect| format!("{}: {}", in_words(effect), size(effect))).collect();
    if answer.verdict == Verdict::Effect {
        list.extend(answer.law.as_ref().map(lacking));
    }
    let list = list.join("; and ");
    let rest = answer.unexplained.as_ref().map(|(place, variables)| {
        let (channel, _) = names::place(place);
        let on = match variables.is_empty() {
            true => String::new(),
            false => {
                let all: Vec<&str> = variables.iter().map(|name| names::variable(name)).collect();
                format!(", depending on {}", all.join(" and "))
            }
        };
        if answer.cylinder {
            return format!(
                "The actuator does not follow its declared model where the piston moves (channel {channel}{on}): a pneumatic cylinder from first principles takes its place."
            );
        }
        let comma = if on.is_empty() { "" } else { "," };
        format!("something at {}{on}{comma} that is none of the known effects", at(place))
    });
    match (answer.verdict, rest) {
        (Verdict::Effect, Some(moving)) if answer.cylinder => {
            format!("The declared model lacks {list}. {moving}")
        }
        (Verdict::Unexplained, Some(moving)) if answer.cylinder => {
            format!("{moving} Nothing else is missing.")
        }
        (Verdict::Nothing, _) if !answer.corrections.is_empty() => {
            "Nothing is missing: with corrections of declared parameters within their tolerances, what the model leaves is sensor noise.".into()
        }
        (Verdict::Nothing, _) => "Nothing is missing: what the declared model leaves is sensor noise.".into(),
        (Verdict::Effect, None) if !answer.complete && answer.share.is_some() => {
            format!("The declared model lacks {list}. {}", share_and_remainder(answer))
        }
        (Verdict::Effect, None) => format!("The declared model lacks {list}."),
        (Verdict::Effect, Some(rest)) => format!("The declared model lacks {list}. It also lacks {rest}."),
        (Verdict::Law, _) => answer.law.as_ref().map_or_else(String::new, law),
        (Verdict::Unexplained, rest) => {
            let corrected = answer.share.filter(|_| !answer.corrections.is_empty()).map_or(String::new(), |share| {
                format!(
                    " Corrections of declared parameters within their tolerances take away {:.0} % of the error.",
                    100.0 * share
                )
            });
            format!(
                "The declared model lacks {}.{corrected}{}",
                rest.unwrap_or_else(|| "something that is none of the known effects".into()),
                nearest(answer)
            )
        }
    }
}

/// The effect that was not accepted and took more of the error away than any other, in a sentence; nothing where none
/// took much, or where one was accepted.
fn nearest(answer: &Answer) -> String {
    let tried = answer.steps.first().map_or(&[][..], |step| &step.candidates);
    let best = tried.iter().max_by(|a, b| a.held_out_gain.total_cmp(&b.held_out_gain));
    match best.filter(|own| own.rejected.is_some() && own.held_out_gain >= MIN_SHARE_OF_NEAREST) {
        Some(own) => format!(
            " Of the known effects {} comes nearest: it takes away {} of the error on held-out records.",
            own.id,
            percent(own.held_out_gain)
        ),
        None => String::new(),
    }
}

/// A law in one sentence, or two.
fn law(own: &Law) -> String {
    let share = format!("It takes away {:.0} % of the error on validation records.", 100.0 * own.share);
    format!("The declared model lacks {}. {share}", lacking(own))
}

/// A law as it follows "the model lacks".
fn lacking(own: &Law) -> String {
    let text = own.effect.own.as_ref().map_or_else(String::new, |own| own.with_rates());
    let on = over(own);
    if own.named {
        format!("a law at {}, over {on}: {text}, with {}", own.port, size(&own.effect))
    } else {
        format!("a law at {}, over {on}, that no short formula says: a curve", own.port)
    }
}

/// Variables of a law in words, each with its letter in the formula where that is another; those of a study by the
/// names of its signals.
fn over(own: &Law) -> String {
    let letters = own.covered.iter().map(|axis| axis.0.as_str()).chain(std::iter::repeat(""));
    let signal = |letter: &str| {
        let wiring = own.effect.wiring.as_ref()?;
        match letter {
            "x" => wiring.position.as_deref(),
            "v" => wiring.velocity.as_deref(),
            "f" => Some(own.port.as_str()),
            _ => None,
        }
    };
    let one = |(name, letter): (&String, &str)| {
        let name = signal(letter).unwrap_or(name);
        let word = names::variable(name);
        let is_said = !own.named || letter.is_empty() || name == letter || letter == "t";
        if is_said { word.to_owned() } else { format!("{word} ({letter})") }
    };
    own.variables.iter().zip(letters).map(one).collect::<Vec<_>>().join(" and ")
}

/// How much of the error effects and corrections take away, and where the rest is.
fn share_and_remainder(answer: &Answer) -> String {
    let chosen: Vec<&Effect> = answer.effects.iter().filter(|effect| effect.selected).collect();
    let alone = match chosen[..] {
        [one] if answer.law.is_none() => {
            one.share.map(|share| format!("It takes away {} of the error", percent(share)))
        }
        _ => None,
    };
    let whole = answer.share.map(percent).unwrap_or_default();
    let taken = match alone {
        Some(alone) if answer.corrections.is_empty() => alone,
        Some(alone) => format!("{alone}, with corrections of declared parameters {whole}"),
        None => format!("Together they take away {whole} of the error"),
    };
    let floors = |signal: &String| Some((signal.clone(), answer.times_floor(&answer.after[1], signal)?));
    let worst = answer.after[1].rms.keys().filter_map(floors).max_by(|a, b| a.1.total_cmp(&b.1));
    match worst {
        Some((signal, times)) if times > 1.05 => {
            format!(
                "{taken}; the largest residual, {} times the noise, is that of {signal}.",
                super::chart::short(times)
            )
        }
        _ => format!("{taken}; the residual is about the noise."),
    }
}

/// Header of [`step_rows`].
pub const STEP_HEADER: [&str; 4] = ["beside", "candidate", "held-out share", "not accepted because"];

/// Candidates of every step of a search for a share of the error.
pub fn step_rows(answer: &Answer) -> Vec<Vec<String>> {
    let rows = answer.steps.iter().flat_map(|step| {
        let none = if answer.by_share { "corrections" } else { "declared model" };
        let model = if step.model.is_empty() { none.into() } else { step.model.join(", ") };
        step.candidates.iter().map(move |own| {
            vec![
                model.clone(),
                own.id.clone(),
                share_of_error(own.held_out_gain),
                own.rejected.clone().unwrap_or_default(),
            ]
        })
    });
    rows.collect()
}

/// A share of the declared model's error in a table. Above 1 where corrections alone enlarge the error on held-out
/// parts, below -1 where the candidate does.
fn share_of_error(share: f64) -> String {
    match share {
        share if share > 1.0 => "over 100 %".into(),
        share if share < -1.0 => "the error grows".into(),
        // Without the sign of a share that is zero.
        share => format!("{:.0} %", (100.0 * share).round() + 0.0),
    }
}

/// Note under the table of steps.
pub fn step_note(answer: &Answer) -> String {
    if !answer.by_share {
        return "Share of the declared model's error on held-out parts of the estimation records that each model takes away beyond the one before it.".into();
    }
    let note = "An effect counts for the share of the declared model's error that it takes away on held-out records, beyond what corrections of declared parameters within their tolerances do.";
    let why = if answer.complete { "" } else { "No model of the vocabulary reaches the noise. " };
    // Studies carry the noise to a floor and say themselves when they begin again.
    let rig = answer.floor[1].is_empty();
    let windows = " Predictions of the coupled rig begin again every half second from the measured motion.";
    format!("{why}{note}{}", if rig { windows } else { "" })
}

/// Change of the error by the amended model, in one sentence: the signal that improves most.
pub fn effect_on_error(answer: &Answer) -> Option<String> {
    if answer.verdict != Verdict::Effect || !answer.complete && answer.share.is_some() {
        return None;
    }
    let (before, after) = (&answer.before[1], &answer.after[1]);
    let improved = before.rms.keys().filter_map(|signal| {
        let [from, to] = [before, after].map(|errors| answer.times_floor(errors, signal));
        Some((signal, from?, to?))
    });
    let (signal, from, to) = improved.max_by(|a, b| (a.1 / a.2).total_cmp(&(b.1 / b.2)))?;
    let parts = answer.effects.iter().filter(|effect| effect.selected).count() + answer.law.iter().count();
    let it = if parts > 1 { "them" } else { "it" };
    Some(format!(
        "With {it}, the error of {signal} on records that the fit has not seen falls from {} to {} times what sensor noise alone gives.",
        super::chart::short(from),
        super::chart::short(to)
    ))
}

/// Sentences on the effects that the records cannot tell from selected ones, one for each group of them.
pub fn rivals(answer: &Answer) -> Vec<String> {
    let chosen: Vec<&Effect> = answer.effects.iter().filter(|effect| effect.selected).collect();
    let groups: BTreeSet<usize> = chosen.iter().filter_map(|effect| effect.group).collect();
    let sentences = groups.into_iter().filter_map(|group| {
        let named = |selected: bool| {
            let own = answer.effects.iter().filter(move |e| e.selected == selected && e.group == Some(group));
            own.map(in_words).collect::<Vec<_>>()
        };
        let others = named(false).join(", ");
        let own = if chosen.len() == 1 { "it".into() } else { named(true).join(" and ") };
        (!others.is_empty()).then(|| format!("These records cannot tell {own} from: {others}."))
    });
    sentences.collect()
}

/// Header of [`errors`].
pub const ERROR_HEADER: [&str; 7] =
    ["signal", "noise rms", "rms before", "rms after", "NRMSE before", "NRMSE after", "times floor"];

/// Meaning of the columns of [`errors`].
pub fn error_note(answer: &Answer) -> &'static str {
    if !answer.before[1].white.is_empty() {
        "Simulated as the study says, in windows, on records that the fit has not seen. NRMSE: rms error over the standard deviation of the measured signal. Times floor: rms of the residuals over the noise of the sensor, without what noise of the measured states gives that windows start from; 1 is as good as these sensors can tell."
    } else if answer.floor[1].is_empty() {
        "Simulated from the command over whole records that the fit has not seen. NRMSE: rms error over the standard deviation of the measured signal. Times floor: rms error over the noise of the sensor; 1 is as good as the sensor can tell."
    } else {
        "Simulated as the study says, on records that the fit has not seen. NRMSE: rms error over the standard deviation of the measured signal. Times floor: rms error over that of a true model, which is the noise of the sensors carried through measured inputs, initial states, filters and derivatives; 1 is as good as these sensors can tell."
    }
}

/// In place of an error of a model that cannot be simulated to the end of every record.
const NO_END: &str = "diverges";

/// Rows of the table of errors on validation records.
pub fn errors(answer: &Answer, signals: &[Signal]) -> Vec<[String; 7]> {
    let models = [&answer.before[1], &answer.after[1]];
    let row = |signal: &String| {
        let cell = |value: Option<f64>, shown: &dyn Fn(f64) -> String| match value {
            Some(value) if value.is_finite() => shown(value),
            Some(_) => NO_END.to_owned(),
            None => "-".to_owned(),
        };
        let unit = signals.iter().find(|own| own.name == *signal).map_or("", |own| own.unit.as_str());
        let shown = if unit.is_empty() { signal.clone() } else { format!("{signal} [{unit}]") };
        let noise = cell(answer.noise.get(signal).copied(), &number);
        let [rms, left] = models.map(|errors| cell(errors.rms.get(signal).copied(), &number));
        let percent = |value: f64| format!("{:.2} %", 100.0 * value);
        let [share, share_left] = models.map(|errors| cell(errors.nrmse.get(signal).copied(), &percent));
        let floors = |value: f64| format!("{value:.2}");
        let [from, to] = models.map(|errors| cell(answer.times_floor(errors, signal), &floors));
        [shown, noise, rms, left, share, share_left, format!("{from} \u{2192} {to}")]
    };
    answer.before[1].rms.keys().map(row).collect()
}

/// Header of [`parameter_rows`].
pub const PARAMETER_HEADER: [&str; 6] = ["effect", "parameter", "value", "95 % from", "to", "unit"];

/// Parameters of the selected effects.
pub fn parameter_rows(answer: &Answer) -> Vec<Vec<String>> {
    let law = answer.law.iter().map(|law| &law.effect);
    let rows = answer.effects.iter().filter(|effect| effect.selected).chain(law).flat_map(|effect| {
        effect.parameters.iter().map(|p| {
            let half = 0.5 * (p.interval.1 - p.interval.0);
            // Records that do not determine a parameter leave both ends open.
            let end = |v: f64| if v.is_finite() { rounded(v, half) } else { "open".to_owned() };
            let (value, low, high) = (rounded(p.value, half), end(p.interval.0), end(p.interval.1));
            vec![name(effect), p.name.clone(), value, low, high, p.unit.clone()]
        })
    });
    rows.collect()
}

/// Header of [`stability_rows`].
pub const STABILITY_HEADER: [&str; 4] =
    ["effect", "folds it helps on", "parameter", "values without one fold"];
/// Meaning of stability.
pub const STABILITY_NOTE: &str = "The estimation records in folds, each held out in turn: on how many of them the model with the effect, fitted on the others, is better than the one without it, and between which values its parameters then move. An effect next to others that helps on no more than half of the folds, and little, is left out.";

/// How effects hold on parts of the estimation records.
pub fn stability_rows(answer: &Answer) -> Vec<Vec<String>> {
    let known = answer.effects.iter().filter_map(|effect| Some((effect, effect.stability.as_ref()?)));
    let rows = known.flat_map(|(effect, own)| {
        effect.parameters.iter().zip(&own.ranges).map(move |(p, (low, high))| {
            let unit = if p.unit == "1" { String::new() } else { format!(" {}", p.unit) };
            let (low, high) = (rounded(*low, high - low), rounded(*high, high - low));
            vec![
                name(effect),
                format!("{} of {}", own.better, own.parts),
                p.name.clone(),
                format!("{low} to {high}{unit}"),
            ]
        })
    });
    rows.collect()
}

/// Header of [`correction_rows`].
pub const CORRECTION_HEADER: [&str; 5] =
    ["parameter", "declared", "corrected", "\u{b1} (95 %)", "in tolerances"];

/// Declared parameters that were corrected.
pub fn correction_rows(answer: &Answer) -> Vec<Vec<String>> {
    let row = |own: &Correction| {
        let half = 0.5 * (own.interval.1 - own.interval.0);
        vec![
            own.path(),
            number(own.declared),
            rounded(own.value, half),
            // A fit has no interval for a parameter that it holds at a bound.
            if half == 0.0 { "as far as it may go".to_owned() } else { rounded(half, half) },
            format!("{:+.1}", own.moved / own.tolerance),
        ]
    };
    answer.corrections.iter().map(row).collect()
}

/// A score as a whole number, in powers of ten where it is long.
fn count(value: f64) -> String {
    if value.abs() < 1e5 { format!("{value:.0}") } else { format!("{value:.2e}") }
}

/// Header of [`candidate_rows`].
pub const CANDIDATE_HEADER: [&str; 6] = ["effect", "what", "improvement", "margin", "parameters", "why"];

/// Meaning of the improvement of a candidate.
pub fn candidate_note(answer: &Answer) -> &'static str {
    if !answer.by_share {
        "Improvement: decrease of the Bayesian information criterion against the declared model on the estimation records. Margin: how much less than the best; candidates within some 12 of each other cannot be told apart."
    } else {
        "Improvement: decrease of the sum of squares beyond the corrections, on the estimation records, each residual counted as many independent samples as it holds. Margin: how much less than the best."
    }
}

/// All candidates that were fitted, in the order of the report.
pub fn candidate_rows(answer: &Answer) -> Vec<Vec<String>> {
    let best = answer.effects.iter().map(|effect| effect.score).fold(f64::MIN, f64::max);
    let row = |effect: &Effect| {
        vec![
            name(effect),
            what(effect),
            count(effect.score),
            count(best - effect.score),
            size(effect),
            effect.reason.clone(),
        ]
    };
    answer.effects.iter().map(row).collect()
}

#[cfg(test)]
mod tests {
    use airloop_refine::answer::{Errors, Step, Tried};

    use super::*;

    #[test]
    fn errors_of_a_model_that_diverges_are_said_to_be_so() {
        let errors = |rms: f64| Errors {
            rms: [("x".to_owned(), rms)].into(),
            nrmse: [("x".to_owned(), rms)].into(),
            ..Errors::default()
        };
        let noise = [("x".to_owned(), 0.1)].into();
        let answer = Answer {
            before: [errors(0.5), errors(f64::NAN)],
            after: [errors(0.2), errors(0.2)],
            noise,
            ..Answer::default()
        };
        let cells = super::errors(&answer, &[]);
        assert_eq!(cells[0][2..], ["diverges", "0.20000", "diverges", "20.00 %", "diverges \u{2192} 2.00"]);
    }

    #[test]
    fn the_nearest_effect_is_named_where_it_was_refused_and_took_much() {
        let tried = |id: &str, held_out_gain: f64, rejected: Option<&str>| Tried {
            id: id.into(),
            held_out_gain,
            rejected: rejected.map(str::to_owned),
            port: None,
        };
        let said = |candidates: Vec<Tried>| {
            let steps = vec![Step { candidates, ..Step::default() }];
            let unexplained = Some(("@der_v".to_owned(), Vec::new()));
            sentence(&Answer { verdict: Verdict::Unexplained, unexplained, steps, ..Answer::default() })
        };
        let lacking = "The declared model lacks something at der_v that is none of the known effects.";
        let lag = |rejected| tried("sensor.lag(table)", 0.247, rejected);
        assert_eq!(
            said(vec![tried("gain@i", 0.1, Some("less")), lag(Some("less"))]),
            format!(
                "{lacking} Of the known effects sensor.lag(table) comes nearest: it takes away 25 % of the error on held-out records."
            )
        );
        assert_eq!(said(vec![lag(None)]), lacking);
        assert_eq!(said(vec![tried("gain@i", 0.09, Some("less"))]), lacking);
    }
}
