//! Shares of an error in words.

/// A share of an error that is taken away, in whole percent; `none` where the error stays or grows.
pub fn percent(share: f64) -> String {
    if share > 0.0 { format!("{:.0} %", 100.0 * share) } else { "none".into() }
}
