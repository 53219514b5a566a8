//! Withdrawal of the verdict "nothing is missing" where the declared model explains no signal of the records.

use super::answer::{Answer, Verdict};

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

#[cfg(test)]
mod tests {
    use super::*;

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
    fn one_signal_that_is_explained_is_enough() {
        let mut found = answer(&[0.01, 0.999]);
        refuse_where_nothing_is(&mut found, "pole");
        assert_eq!((found.verdict, found.notes.len()), (Verdict::Nothing, 0));
    }
}
