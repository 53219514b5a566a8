//! Whether a trial is a success.

use crate::Error;
use airloop_series::TimeSeries;

/// A signal within limits in a span of time.
#[derive(Debug, Clone, PartialEq)]
pub struct Check {
    /// Name of the criterion it belongs to.
    pub name: String,
    /// Column of the result.
    pub column: String,
    /// Limits, in the unit of the column.
    pub limits: (f64, f64),
    /// Span \[s\].
    pub span: (f64, f64),
}

/// Each criterion in the order of the file: name, and whether the trial keeps it.
pub type Judgment = Vec<(String, bool)>;

/// Judges a result; one that ended early keeps no criterion.
///
/// # Errors
/// A column that the result does not have.
pub fn judge(checks: &[Check], result: &TimeSeries, ended_early: bool) -> Result<Judgment, Error> {
    let mut judgment: Judgment = Vec::new();
    for check in checks {
        let channel = result.channel(&check.column).ok_or_else(|| Error::Place {
            place: format!("criterion `{}`", check.name),
            problem: format!("the result of a trial has no column `{}`", check.column),
        })?;
        let (low, high) = check.limits;
        // A millionth of the span for times that are sums of steps.
        let slack = 1e-9 * (1.0 + check.span.1.abs());
        let mut seen = false;
        let mut kept = !ended_early;
        for (t, value) in result.time().iter().zip(&channel.values) {
            if *t >= check.span.0 - slack && *t <= check.span.1 + slack {
                seen = true;
                kept &= (low..=high).contains(value);
            }
        }
        let kept = kept && seen;
        match judgment.iter_mut().find(|(name, _)| *name == check.name) {
            Some((_, all)) => *all &= kept,
            None => judgment.push((check.name.clone(), kept)),
        }
    }
    Ok(judgment)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(name: &str, limits: (f64, f64), span: (f64, f64)) -> Check {
        Check { name: name.into(), column: "x".into(), limits, span }
    }

    #[test]
    fn a_criterion_holds_where_all_its_checks_do_over_their_spans() {
        let mut result = TimeSeries::new(vec![0.0, 0.1, 0.2, 0.1 + 0.2]).unwrap();
        result.push("x", None, vec![9.0, 1.0, 2.0, 3.0]).unwrap();
        let inside = check("a", (0.0, 3.0), (0.1, 0.3));
        let whole = check("b", (0.0, 3.0), (0.0, 0.3));
        let both = [
            inside.clone(),
            whole.clone(),
            check("a", (2.5, 3.5), (0.3, 0.3)),
            check("b", (0.0, 9.0), (0.0, 0.3)),
        ];
        let judged = judge(&both, &result, false).unwrap();
        assert_eq!(judged, [("a".to_owned(), true), ("b".to_owned(), false)]);
        assert!(!judge(&both[..1], &result, true).unwrap()[0].1);
        // A span that the run did not reach.
        assert!(!judge(&[check("c", (0.0, 9.0), (1.0, 2.0))], &result, false).unwrap()[0].1);
        let unknown = Check { column: "y".into(), ..inside };
        assert!(judge(&[unknown], &result, false).unwrap_err().to_string().contains("`y`"));
    }
}
