//! Single samples of a state that stand apart from the lines on both sides of them: no motion does that, a sensor does.
//!
//! Outliers of [`crate::outliers`] are so large that any signal shows them; these are a few times the noise. Only
//! signals that integrate something (positions, speeds, pressures, currents) are searched: a force or an acceleration
//! may be large for one sample, for instance in an impact.

use airloop_series::units;

use crate::outliers::{self, Outlier};

/// Least mean distance of a spike from both lines, over the scatter of this mean around it: eleven times white noise.
const MIN_OVER_SCATTER: f64 = 6.0;
/// Least distance from either line, over the mean of both: those of a spike are the same but for noise, those of a
/// corner of a motion differ.
const MIN_EITHER: f64 = 0.75;
/// Greatest distance of the samples beside a spike, over its own.
const MAX_BESIDE: f64 = 1.0 / 3.0;
/// Samples on each side, behind those that a spike reaches, in which nothing comes near it: in a short fast transient
/// the samples around it bend as much as itself.
const QUIET: std::ops::RangeInclusive<usize> = 3..=10;
/// Greatest distance there, over its own.
const MAX_WHERE_QUIET: f64 = 0.5;
/// Greatest share of the samples: a signal with more spikes means them.
const MAX_SHARE: f64 = 0.01;
/// Units of signals that may jump.
const JUMP: [&str; 5] = ["N", "N.m", "m/s2", "rad/s2", "V"];

/// Whether a signal in `unit` integrates something.
pub fn is_state(unit: &str) -> bool {
    let same =
        |own: &units::Unit, jump| units::lookup(jump).is_some_and(|jump| jump.exponents == own.exponents);
    units::lookup(unit).is_some_and(|own| !JUMP.iter().any(|jump| same(&own, jump)))
}

/// A sentence on the spikes of a column; `first`: when the first is.
pub fn note(record: &str, column: &str, count: usize, first: &str) -> String {
    match count {
        1 => format!(
            "Outlier in {record}: `{column}` leaves its neighbors for one sample {first}, as no motion does; it counts for no error."
        ),
        _ => format!(
            "{count} outliers in {record}: `{column}` leaves its neighbors for one sample, as no motion does, the first {first}; they count for no error."
        ),
    }
}

/// Change of a command from sample to sample that is a jump: over the median of the changes, and over the range.
const MIN_JUMP: (f64, f64) = (10.0, 0.05);
/// Samples from a jump on that a signal behind the command may bend in.
const BEND: usize = 3;
/// Probability that as many spikes lie behind jumps by chance, below which they are bends of the signal.
const MIN_CHANCE: f64 = 0.05;

/// Whether each sample lies behind a jump of a command: a signal may bend there within a sample.
pub fn behind_jumps(command: &[f64]) -> Vec<bool> {
    let (low, high) =
        command.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), u| (a.min(*u), b.max(*u)));
    let mut sizes: Vec<f64> = command.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    let mut behind = vec![false; command.len()];
    if sizes.is_empty() {
        return behind;
    }
    let half = sizes.len() / 2;
    let usual = *sizes.select_nth_unstable_by(half, f64::total_cmp).1;
    let least = (MIN_JUMP.0 * usual).max(MIN_JUMP.1 * (high - low));
    for (k, pair) in command.windows(2).enumerate() {
        if (pair[1] - pair[0]).abs() > least {
            let last = (k + 1 + BEND).min(command.len());
            behind[k + 1..last].fill(true);
        }
    }
    behind
}

/// The spikes of a record that `left` shows: the record itself, or what a model leaves of it. Where a model jumps a
/// sample too early, what it leaves has a spike, and the record none. Samples `behind` a jump of a command are spikes
/// only where as many may lie there by chance: sensors fail whatever the command does.
pub fn find(left: &[f64], record: &[f64], behind: &[bool]) -> Vec<Outlier> {
    let mut found = candidates(left, record);
    let is_behind = |own: &Outlier| behind.get(own.first).copied().unwrap_or(false);
    let count = found.iter().filter(|own| is_behind(own)).count();
    let share = behind.iter().filter(|own| **own).count() as f64 / behind.len().max(1) as f64;
    if chance(found.len(), count, share) < MIN_CHANCE {
        found.retain(|own| !is_behind(own));
    }
    found
}

/// Probability that at least `least` of `count` independent events happen, each with probability `p`.
fn chance(count: usize, least: usize, p: f64) -> f64 {
    let mut choices = 1.0;
    let mut sum = 0.0;
    for k in 0..=count {
        if k >= least {
            sum += choices * p.powi(k as i32) * (1.0 - p).powi((count - k) as i32);
        }
        choices *= (count - k) as f64 / (k + 1) as f64;
    }
    sum
}

fn candidates(left: &[f64], record: &[f64]) -> Vec<Outlier> {
    let n = left.len();
    if n < 5 {
        return Vec::new();
    }
    let (mean, least) = distances(left);
    let (_, least_of_record) = distances(record);
    let whole = outliers::scatter(mean[2..n - 2].iter().map(|own| own.abs()).collect());
    let floor = whole.max(outliers::digit(record));
    let is_spike = |k: &usize| {
        let own = mean[*k].abs();
        own > MIN_OVER_SCATTER * floor
            && least[*k].min(least_of_record[*k]) > MIN_EITHER * own
            && least[k - 1].max(least[k + 1]) < MAX_BESIDE * own
            && own > MIN_OVER_SCATTER * outliers::scatter_around(&mean, *k)
            && QUIET
                .flat_map(|far| [k.checked_sub(far), k.checked_add(far)])
                .flatten()
                .all(|other| mean.get(other).is_none_or(|beside| beside.abs() < MAX_WHERE_QUIET * own))
    };
    let one = |k| Outlier { first: k, count: 1, value: record[k], neighbors: record[k] - mean[k] };
    let found: Vec<Outlier> = (2..n - 2).filter(is_spike).map(one).collect();
    if found.len() as f64 > MAX_SHARE * n as f64 { Vec::new() } else { found }
}

/// Distances of the samples from the lines through the two before and the two after: the mean of both, and the size of
/// the lesser, zero where they have different signs.
fn distances(values: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let n = values.len();
    let (mut mean, mut least) = (vec![0.0; n], vec![0.0; n]);
    for k in 2..n - 2 {
        let before = values[k] - (2.0 * values[k - 1] - values[k - 2]);
        let after = values[k] - (2.0 * values[k + 1] - values[k + 2]);
        mean[k] = 0.5 * (before + after);
        if before * after > 0.0 {
            least[k] = before.abs().min(after.abs());
        }
    }
    (mean, least)
}

#[cfg(test)]
mod tests {
    use super::is_state;
    use crate::outliers::Outlier;
    use airloop_series::random::Random;

    const NOISE: f64 = 1e-3;

    fn find(values: &[f64]) -> Vec<Outlier> {
        super::find(values, values, &[])
    }

    fn noisy(count: usize, motion: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut random = Random::new(3);
        (0..count).map(|k| motion(0.01 * k as f64) + NOISE * random.normal()).collect()
    }

    #[test]
    fn bends_behind_jumps_of_a_command_are_no_spikes_and_spikes_at_any_sample_are() {
        let with_spikes = |places: &[usize]| -> Vec<f64> {
            let mut values = noisy(2_000, |t| 0.1 * (0.3 * t).sin());
            places.iter().for_each(|&k| values[k] += 0.02);
            values
        };
        let command = |period: usize| -> Vec<f64> { (0..2_000).map(|k| (k / period % 2) as f64).collect() };
        let count = |places: &[usize], period: usize| {
            let values = with_spikes(places);
            super::find(&values, &values, &super::behind_jumps(&command(period))).len()
        };
        assert_eq!(count(&[700], 100), 0);
        assert_eq!(count(&[700, 900, 1101], 100), 0);
        assert_eq!(count(&[650, 950, 1150], 100), 3);
        // One of ten may lie behind one of 20 jumps by chance; one of three may where a third of all samples do.
        assert_eq!(count(&[150, 250, 350, 450, 550, 650, 700, 850, 950, 1050], 100), 10);
        assert_eq!(count(&[700, 905, 1107], 9), 3);
        // A command that always moves has no jumps.
        let moving: Vec<f64> = (0..2_000).map(|k| (0.05 * f64::from(k)).sin()).collect();
        assert!(!super::behind_jumps(&moving).contains(&true));
    }

    #[test]
    fn the_chance_is_that_of_the_binomial_distribution() {
        assert!((super::chance(3, 2, 0.5) - 0.5).abs() < 1e-12);
        assert!((super::chance(10, 1, 0.06) - (1.0 - 0.94f64.powi(10))).abs() < 1e-12);
        assert!((super::chance(4, 0, 0.3) - 1.0).abs() < 1e-12);
        assert!((super::chance(0, 0, 0.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_sample_of_twenty_times_the_noise_is_found_and_nothing_else() {
        let mut values = noisy(20_000, |t| 0.1 * (3.0 * t).sin());
        assert_eq!(find(&values), []);
        let places = [2, 500, 7_000, 19_997];
        places.iter().for_each(|&k| values[k] += 20.0 * NOISE);
        let found = find(&values);
        assert_eq!(found.iter().map(|own| own.first).collect::<Vec<_>>(), places);
        assert!(found.iter().all(|own| (own.neighbors - values[own.first]).abs() > 10.0 * NOISE));
    }

    #[test]
    fn reversals_stops_and_fast_motion_have_none() {
        // A triangle (an impact seen by a position), a staircase, a motion that begins, and five samples per period.
        assert_eq!(find(&noisy(3000, |t| (t % 1.0 - 0.5).abs())), []);
        assert_eq!(find(&noisy(3000, |t| t.floor() % 3.0)), []);
        assert_eq!(find(&noisy(3000, |t| (t - 15.0).max(0.0).powi(2))), []);
        assert_eq!(find(&noisy(3000, |t| (125.66 * t).sin())), []);
        let rounded: Vec<f64> =
            (0..3000).map(|k| (1e2 * (0.002 * f64::from(k)).sin()).round() / 1e2).collect();
        assert_eq!(find(&rounded), []);
    }

    #[test]
    fn a_model_that_jumps_a_sample_too_early_leaves_no_outlier() {
        let record = noisy(3000, |t| t.floor() % 3.0);
        let early = |k: usize| (0.01 * (k + 1) as f64 + 1e-9).floor() % 3.0;
        let left: Vec<f64> = record.iter().enumerate().map(|(k, value)| value - early(k)).collect();
        assert!(left.iter().filter(|own| own.abs() > 0.5).count() > 20);
        assert_eq!(super::find(&left, &record, &[]), []);
    }

    #[test]
    fn a_fast_transient_has_none() {
        // A pressure behind a step of its command, a sample every third of its rise.
        let step = |t: f64| if t < 0.0 { 0.0 } else { 1.0 - (-t / 0.02).exp() * (t / 0.01).cos() };
        for shift in 0..10 {
            let begin = 10.0 + 1e-3 * f64::from(shift);
            assert_eq!(find(&noisy(3000, |t| step(t - begin))), []);
        }
    }

    #[test]
    fn a_corner_has_none() {
        // A stage under control that leaves its place within two samples: changes in units of the noise.
        let leaves = [38.0, 197.0, 270.0, 218.0];
        let change = |k: usize| leaves.get(k.saturating_sub(2000)).filter(|_| k >= 2000).unwrap_or(&218.0);
        let mut place = 0.0;
        let mut motion = noisy(2200, |_| 0.0);
        for (k, value) in motion.iter_mut().enumerate().skip(2000) {
            place -= NOISE * change(k);
            *value += place;
        }
        assert_eq!(find(&motion), []);
        motion[1000] += 100.0 * NOISE;
        assert_eq!(find(&motion).len(), 1);
    }

    #[test]
    fn a_signal_full_of_spikes_means_them() {
        let mut values = noisy(1000, |_| 0.0);
        values.iter_mut().step_by(50).for_each(|value| *value += 0.1);
        assert_eq!(find(&values), []);
    }

    #[test]
    fn forces_and_accelerations_may_jump() {
        for unit in ["m", "mm", "rad", "m/s", "Pa", "bar", "A", "K", "degC"] {
            assert!(is_state(unit), "{unit}");
        }
        for unit in ["N", "kN", "N.m", "m/s2", "V", "mV", "no unit"] {
            assert!(!is_state(unit), "{unit}");
        }
    }
}
