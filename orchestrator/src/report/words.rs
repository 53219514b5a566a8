//! The sentences of a report.

use crate::refine::answer::{Answer, Effect, Verdict};

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

/// Name of an effect, with the signal for sensors.
pub fn name(effect: &Effect) -> String {
    match &effect.signal {
        Some(signal) => format!("{} of {signal}", effect.id),
        None => effect.id.clone(),
    }
}

/// Parameters of an effect with their 95 % intervals.
pub fn parameters(effect: &Effect) -> String {
    let one = |p: &crate::refine::answer::Parameter| {
        let unit = if p.unit == "1" { String::new() } else { format!(" {}", p.unit) };
        let half = 0.5 * (p.interval.1 - p.interval.0);
        format!("{} = {}{unit} (95 %: +-{half:.1e})", p.name, number(p.value))
    };
    effect.parameters.iter().map(one).collect::<Vec<_>>().join(", ")
}

/// The answer in one sentence.
pub fn sentence(answer: &Answer) -> String {
    let chosen: Vec<&Effect> = answer.effects.iter().filter(|effect| effect.selected).collect();
    let list = chosen
        .iter()
        .map(|e| format!("{} ({}; {})", name(e), e.channel, parameters(e)))
        .collect::<Vec<_>>()
        .join(" and ");
    let rest = answer.unexplained.as_ref().map(|(channel, variables)| {
        let on = if variables.is_empty() {
            String::new()
        } else {
            format!(", depending on {}", variables.join(", "))
        };
        format!("something at the channel `{channel}`{on}, that is none of the known effects")
    });
    match (answer.verdict, rest) {
        (Verdict::Nothing, _) => "Nothing is missing: what the declared model leaves is sensor noise.".into(),
        (Verdict::Effect, None) => format!("The declared model lacks {list}."),
        (Verdict::Effect, Some(rest)) => format!("The declared model lacks {list}; it also lacks {rest}."),
        (Verdict::Unexplained, rest) => {
            format!(
                "The declared model lacks {}.",
                rest.unwrap_or_else(|| "something that is none of the known effects".into())
            )
        }
    }
}

/// The other effects that the records cannot tell from a selected one, if any.
pub fn rivals(answer: &Answer) -> Vec<String> {
    answer.effects.iter().filter(|e| !e.selected && e.group.is_some()).map(name).collect()
}

/// Rows of the table of errors: signal, noise, then before and after on validation records.
pub fn errors(answer: &Answer) -> Vec<[String; 6]> {
    let (before, after) = (&answer.before[1], &answer.after[1]);
    let row = |(signal, &rms): (&String, &f64)| {
        let left = after.rms.get(signal).copied().unwrap_or(f64::NAN);
        let noise = answer.noise.get(signal).copied().unwrap_or(f64::NAN);
        let share = before.nrmse.get(signal).copied().unwrap_or(f64::NAN);
        let times = format!("{:.1} -> {:.1}", rms / noise, left / noise);
        [signal.clone(), number(noise), number(rms), number(left), format!("{:.2} %", 100.0 * share), times]
    };
    before.rms.iter().map(row).collect()
}
