//! Shares of an error in words.

/// A share of an error that is taken away, in whole percent; `none` where the error stays or grows.
pub fn percent(share: f64) -> String {
    if share > 0.0 { format!("{:.0} %", 100.0 * share) } else { "none".into() }
}

/// A share below a limit, and the limit, with as many digits as it takes to see that it is below.
pub fn percent_below(share: f64, limit: f64) -> [String; 2] {
    let written = |value: f64, digits: usize| format!("{:.digits$} %", 100.0 * value);
    let digits = (0..3).find(|&digits| written(share, digits) != written(limit, digits)).unwrap_or(3);
    let own = if share > 0.0 { written(share, digits) } else { percent(share) };
    [own, written(limit, if share > 0.0 { digits } else { 0 })]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_below_a_limit_is_seen_to_be_below() {
        assert_eq!(percent_below(0.12, 0.25), ["12 %", "25 %"]);
        assert_eq!(percent_below(0.2471, 0.25), ["24.7 %", "25.0 %"]);
        assert_eq!(percent_below(-0.3, 0.25), ["none", "25 %"]);
    }
}
