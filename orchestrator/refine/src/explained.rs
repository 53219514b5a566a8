//! Withdrawal of answers that validation records contradict: "nothing is missing" where the declared model explains no
//! signal, or leaves what the estimation records do not show; effects and laws that leave more than half of a signal.

use super::answer::{Answer, Effect, Verdict, WARNING};

/// Error over the spread of the measured signal from which on a model explains nothing of it.
const MIN_NRMSE_OF_NO_MODEL: f64 = 0.9;

/// Withdraws the verdict that nothing is missing where the declared model explains no signal on validation records. The
/// residual has its place at `place`.
pub fn refuse_where_nothing_is(found: &mut Answer, place: &str) {
    let errors = &found.before[1].nrmse;
    // An error that is no number explains nothing either.
    let is_blind =
        !errors.is_empty() && errors.values().all(|error| error.is_nan() || *error >= MIN_NRMSE_OF_NO_MODEL);
    if found.verdict != Verdict::Nothing || !is_blind {
        return;
    }
    let shares: Vec<String> =
        errors.iter().map(|(signal, error)| format!("{signal} {:.1} %", 100.0 * error)).collect();
    found.notes.push(format!(
        "The declared model explains nothing of the records: its error on validation records is as large as the spread of the data ({}). Whether an effect is missing cannot be told from them; record more than noise, or check the columns.",
        shares.join(", ")
    ));
    (found.verdict, found.complete) = (Verdict::Unexplained, false);
    found.unexplained = Some((place.to_owned(), Vec::new()));
}

/// Ratio of a signal's error on validation records to its floor, and to the same ratio on estimation records, from
/// which on validation records show what the others do not.
const MIN_RATIO_OF_UNSEEN: f64 = 2.0;

/// Says where validation records show something that estimation records do not, another range or larger commands, and
/// no effect was found; withdraws the verdict that nothing is missing. The residual has its place at `place`.
pub fn refuse_where_validation_shows_more(found: &mut Answer, place: &str) {
    if !matches!(found.verdict, Verdict::Nothing | Verdict::Unexplained) {
        return;
    }
    let unseen = unseen(found, MIN_RATIO_OF_UNSEEN);
    if unseen.is_empty() {
        return;
    }
    found.notes.push(format!(
        "{WARNING}the declared model leaves on validation records what estimation records do not show: {}. Either they are of another kind, with larger commands or another range, or what is fitted to each estimation record hides it there: give one of them `role = \"estimation\"`, so that the search sees what is missing.",
        unseen.join(", ")
    ));
    (found.verdict, found.complete) = (Verdict::Unexplained, false);
    found.unexplained.get_or_insert_with(|| (place.to_owned(), Vec::new()));
}

/// Signals whose error on validation records is at least `least` times that on estimation records, in multiples of
/// their floors and at least that floor, in words.
fn unseen(found: &Answer, least: f64) -> Vec<String> {
    let ratio = |set: usize, signal: &str| found.times_floor_on(set, &found.after[set], signal);
    let signals = found.after[1].rms.keys();
    signals
        .filter_map(|signal| Some((signal, ratio(0, signal)?, ratio(1, signal)?)))
        .filter(|(_, seen, there)| seen.is_finite() && *there >= least * seen.max(1.0))
        .map(|(signal, seen, there)| {
            format!("`{signal}` {there:.1} times the noise ({seen:.1} on estimation records)")
        })
        .collect()
}

/// The same ratio from which on another value of a declared parameter is one that suits the estimation records alone.
const MIN_RATIO_OF_UNSUITED: f64 = 4.0;

/// Takes other values of declared parameters back that validation records refute: they suit the estimation records, and
/// what is missing has another form. The residual has its place at `place`. Returns whether an answer was withdrawn.
pub fn refuse_other_values_of_estimation(found: &mut Answer, place: &str) -> bool {
    let mut chosen = found.effects.iter().filter(|effect| effect.selected).peekable();
    let is_other_value = |effect: &Effect| effect.kind() == "parameter";
    let all = chosen.peek().is_some() && chosen.all(is_other_value);
    let unseen = if all && found.law.is_none() { unseen(found, MIN_RATIO_OF_UNSUITED) } else { Vec::new() };
    if unseen.is_empty() {
        return false;
    }
    found.notes.push(format!(
        "{WARNING}another value of a declared parameter would suit the estimation records and not those for validation: {}. What is missing has another form than that parameter.",
        unseen.join(", ")
    ));
    withdraw(found, place, "validation records refute it");
    true
}

/// Takes the effects and the law of an answer back.
fn withdraw(found: &mut Answer, place: &str, reason: &str) {
    for effect in found.effects.iter_mut().filter(|effect| effect.selected) {
        (effect.selected, effect.group) = (false, None);
        reason.clone_into(&mut effect.reason);
    }
    (found.verdict, found.complete, found.share) = (Verdict::Unexplained, false, None);
    found.unexplained.get_or_insert_with(|| (place.to_owned(), Vec::new()));
    found.law = None;
    found.cylinder = false;
    found.corrections.clear();
    found.after = found.before.clone();
    found.parameters[1] = found.parameters[0].clone();
    found.left[1] = found.left[0].clone();
}

/// Error above the floor, over the spread of the measured signal, from which on an answer is none.
const MIN_NRMSE_OF_NO_ANSWER: f64 = 0.5;
/// Ratio of the errors with and without the answer from which on it has not halved the error.
const MIN_RATIO_OF_NO_ANSWER: f64 = 0.5;
/// Relative change of the error of a signal from which on the answer claims something about it.
const MIN_CHANGE_OF_A_CLAIM: f64 = 0.05;

/// Takes effects and laws back that leave nearly all of a signal on validation records that they claim to explain, or
/// more than half of it and have not even halved its error; an answer that changes no signal claims all of them. The
/// residual has its place at `place`. Returns whether an answer was withdrawn.
pub fn refuse_what_explains_too_little(found: &mut Answer, place: &str) -> bool {
    if !matches!(found.verdict, Verdict::Effect | Verdict::Law) {
        return false;
    }
    let [before, after] = [&found.before[1], &found.after[1]];
    let change = |signal: &str| {
        let [was, is] = [before, after].map(|errors| errors.rms.get(signal).copied().unwrap_or(f64::NAN));
        is / was
    };
    let claimed =
        |signal: &str| (change(signal) - 1.0).abs() >= MIN_CHANGE_OF_A_CLAIM || change(signal).is_nan();
    let claims = after.nrmse.keys().any(|signal| claimed(signal));
    let left = |(signal, nrmse): (&String, &f64)| {
        let rms = after.rms.get(signal).copied().unwrap_or(f64::NAN);
        let noise = (found.floor_of(signal).unwrap_or(0.0) / rms).min(1.0);
        let above = nrmse * (1.0 - noise * noise).sqrt();
        // What explains nothing is no answer, however far off the declared model was.
        let nothing = above >= MIN_NRMSE_OF_NO_MODEL || above.is_nan();
        let far = nothing
            || (above >= MIN_NRMSE_OF_NO_ANSWER
                && (change(signal) >= MIN_RATIO_OF_NO_ANSWER || change(signal).is_nan()));
        (far && (claimed(signal) || !claims)).then(|| format!("{signal} {:.0} %", 100.0 * nrmse))
    };
    let left: Vec<String> = after.nrmse.iter().filter_map(left).collect();
    if left.is_empty() {
        return false;
    }
    let kind = if found.verdict == Verdict::Law { "a law" } else { "effects" };
    found.notes.push(format!(
        "{WARNING}the search ended with {kind}, but on validation records the error would still be {} of the spread of the data: what leaves more than {:.0} % of a signal is no answer. Check signs, units, parameters and initial states of the declared model, or give it shorter records or windows over which it can be predicted.",
        left.join(", "),
        100.0 * MIN_NRMSE_OF_NO_ANSWER
    ));
    withdraw(found, place, "with it, more than half of a signal is left on validation records");
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An answer with these errors before and after of signals with a spread of 1 and a floor of 0.01.
    fn effect(errors: &[(f64, f64)]) -> Answer {
        let of = |pick: fn(&(f64, f64)) -> f64| {
            let own = errors.iter().enumerate().map(|(k, pair)| (format!("y{k}"), pick(pair)));
            let own: std::collections::BTreeMap<String, f64> = own.collect();
            crate::answer::Errors { rms: own.clone(), nrmse: own, ..crate::answer::Errors::default() }
        };
        let (mut found, floor) = (Answer { verdict: Verdict::Effect, ..Answer::default() }, 0.01);
        found.before[1] = of(|pair| pair.0);
        found.after[1] = of(|pair| pair.1);
        found.noise = errors.iter().enumerate().map(|(k, _)| (format!("y{k}"), floor)).collect();
        found
    }

    #[test]
    fn what_leaves_half_of_a_signal_that_it_changes_is_no_answer() {
        for errors in [
            &[(2.036, 2.036), (2.8, 2.72)][..],
            &[(0.9, 0.01), (0.9, 0.7)],
            &[(1.3, 1.7)],
            &[(0.9, f64::NAN)],
            &[(1004.0, 0.988)],
        ] {
            let mut found = effect(errors);
            assert!(refuse_what_explains_too_little(&mut found, "cart"), "{errors:?}");
            assert_eq!(found.verdict, Verdict::Unexplained);
            assert!(found.notes[0].contains("is no answer"), "{:?}", found.notes);
        }
    }

    #[test]
    fn a_signal_that_is_not_touched_and_one_of_noise_are_no_objection() {
        for errors in [&[(0.9, 0.01), (0.9, 0.9)][..], &[(2.0, 0.6)], &[(0.9, 0.4)]] {
            assert!(!refuse_what_explains_too_little(&mut effect(errors), "cart"), "{errors:?}");
        }
        let mut noisy = effect(&[(0.9, 0.8)]);
        noisy.noise.insert("y0".into(), 0.75);
        assert!(!refuse_what_explains_too_little(&mut noisy, "cart"));
    }

    fn answer(errors: &[f64]) -> Answer {
        let mut found = Answer { verdict: Verdict::Nothing, complete: true, ..Answer::default() };
        found.before[1].nrmse =
            errors.iter().enumerate().map(|(k, error)| (format!("y{k}"), *error)).collect();
        found
    }

    #[test]
    fn a_model_that_explains_nothing_lacks_nothing_that_can_be_told() {
        for errors in [&[0.999][..], &[0.95, 1.2], &[f64::NAN]] {
            let mut found = answer(errors);
            refuse_where_nothing_is(&mut found, "pole");
            assert_eq!((found.verdict, found.complete), (Verdict::Unexplained, false), "{errors:?}");
            assert!(found.notes[0].contains("explains nothing"), "{:?}", found.notes);
        }
    }

    #[test]
    fn validation_records_that_show_more_than_estimation_records_contradict_nothing_is_missing() {
        let judged = |estimation: f64, validation: f64| {
            let mut found = answer(&[0.01]);
            found.noise.insert("y0".into(), 0.1);
            for (set, error) in [estimation, validation].into_iter().enumerate() {
                found.after[set].rms.insert("y0".into(), error);
            }
            refuse_where_validation_shows_more(&mut found, "pole");
            (found.verdict, found.notes.len())
        };
        assert_eq!(judged(0.1, 0.7), (Verdict::Unexplained, 1));
        let mut open = Answer { verdict: Verdict::Unexplained, ..answer(&[0.01]) };
        open.unexplained = Some(("actuator".into(), vec!["u".into()]));
        open.noise.insert("y0".into(), 0.1);
        for (set, error) in [0.11, 0.7].into_iter().enumerate() {
            open.after[set].rms.insert("y0".into(), error);
        }
        refuse_where_validation_shows_more(&mut open, "pole");
        assert_eq!((open.notes.len(), open.unexplained.unwrap().0.as_str()), (1, "actuator"));
        assert_eq!(judged(0.1, 0.15), (Verdict::Nothing, 0));
        assert_eq!(judged(0.4, 0.7), (Verdict::Nothing, 0));
    }

    #[test]
    fn another_value_that_suits_the_estimation_records_alone_is_withdrawn() {
        let judged = |id: &str, estimation: f64, validation: f64| {
            let mut found = effect(&[(1.0, validation)]);
            found.after[0].rms.insert("y0".into(), estimation);
            found.effects.push(Effect { id: id.into(), selected: true, ..Effect::default() });
            (refuse_other_values_of_estimation(&mut found, "motor"), found.verdict, found.effects[0].selected)
        };
        assert_eq!(judged("parameter@R", 0.01, 0.15), (true, Verdict::Unexplained, false));
        assert_eq!(judged("parameter@R", 0.01, 0.03), (false, Verdict::Effect, true));
        assert_eq!(judged("parameter@R", 0.1, 0.15), (false, Verdict::Effect, true));
        assert_eq!(judged("coulomb@tau", 0.01, 0.15), (false, Verdict::Effect, true));
    }

    #[test]
    fn one_signal_that_is_explained_is_enough() {
        let mut found = answer(&[0.01, 0.999]);
        refuse_where_nothing_is(&mut found, "pole");
        assert_eq!((found.verdict, found.notes.len()), (Verdict::Nothing, 0));
    }
}
