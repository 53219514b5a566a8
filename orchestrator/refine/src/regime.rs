//! Regimes of records: excitation above the noise of the sensors, and validation records that are like those of the
//! estimation.

use crate::answer::WARNING;
use crate::engine::settings::MIN_FACTOR_OF_OTHER_UNIT;
use crate::study::declaration::Role;
use crate::study::signal::scatter;

/// Spread of a signal in multiples of its noise below which it shows no motion.
const MIN_SPREAD_OVER_NOISE: f64 = 1.5;
/// Ratio of spreads or frequencies from which on records are of another regime.
const MIN_RATIO_OF_ANOTHER_REGIME: f64 = 3.0;
/// Ratio of spreads from which on what was fitted says nothing of the validation records: all of it is extrapolation.
const MIN_RATIO_OF_EXTRAPOLATION: f64 = 10.0;
/// Ratio of spreads up to which the smaller one is rounding: a signal that stands still.
const MAX_RATIO_OF_ROUNDING: f64 = 1e-9;
/// Periods that a frequency needs.
const MIN_PERIODS: f64 = 5.0;
/// Distance from the mean over the standard deviation at which a period is counted, so that noise is not.
const HYSTERESIS: f64 = 0.5;

/// A signal of one record.
#[derive(Debug, Clone, Copy)]
pub struct Values<'a> {
    /// Name of the record.
    pub name: &'a str,
    /// Step \[s\].
    pub step: f64,
    /// Values `[n]`.
    pub values: &'a [f64],
}

/// A signal of the records.
#[derive(Debug, Clone)]
pub struct Signal<'a> {
    /// Name of its column.
    pub name: &'a str,
    /// Whether it drives the system; else it is measured.
    pub driven: bool,
    /// Rms of the noise of its sensor, in the unit of the values.
    pub noise: f64,
    /// Estimation records.
    pub estimation: Vec<Values<'a>>,
    /// Validation records.
    pub validation: Vec<Values<'a>>,
}

impl<'a> Signal<'a> {
    fn of(&self, role: Role) -> &[Values<'a>] {
        if role == Role::Estimation { &self.estimation } else { &self.validation }
    }
}

/// Warnings on records that differ.
///
/// # Errors
/// Records that show no motion, or validation records so much larger that nothing can be said of them: record, signal,
/// sizes, remedy.
pub fn check(signals: &[Signal]) -> Result<Vec<String>, String> {
    signals.iter().try_for_each(check_unit)?;
    signals.iter().try_for_each(check_time)?;
    let mut warnings = Vec::new();
    for role in [Role::Estimation, Role::Validation] {
        let measured: Vec<&Signal> = signals.iter().filter(|own| !own.driven).collect();
        let records = measured.first().map_or(&[][..], |own| own.of(role));
        let still = |k: &usize| {
            measured.iter().all(|own| deviation(own.of(role)[*k].values) < MIN_SPREAD_OVER_NOISE * own.noise)
        };
        let names: Vec<&str> = (0..records.len()).filter(still).map(|k| records[k].name).collect();
        let role = role.word();
        if !names.is_empty() && names.len() == records.len() {
            return Err(format!(
                "no {role} record shows more than the noise of its sensors ({}); record a motion, or correct the stated noise",
                names.join(", ")
            ));
        }
        if !names.is_empty() {
            warnings.push(format!(
                "{WARNING}{} ({role}) shows no more than the noise of its sensors.",
                names.join(", ")
            ));
        }
    }
    for own in signals {
        let [fitted, judged] = [&own.estimation, &own.validation].map(|records| pooled(records));
        let ratio = judged / fitted;
        let significant = judged > MIN_SPREAD_OVER_NOISE * own.noise;
        if own.driven && judged > 0.0 && fitted <= MAX_RATIO_OF_ROUNDING * judged {
            return Err(format!(
                "`{}` does not move in the estimation records, and does in the validation records: nothing can be fitted to what it does. Exchange the roles, or give both roles records in which it moves",
                own.name
            ));
        }
        if fitted > 0.0 && ratio > MIN_RATIO_OF_EXTRAPOLATION && significant {
            return Err(format!(
                "`{}` is {ratio:.0} times larger in the validation records (standard deviation {judged:.3e}) than in the estimation records ({fitted:.3e}): what is fitted to small motion says nothing of large motion. Exchange the roles, or give both roles records of either kind",
                own.name
            ));
        }
        if fitted > 0.0 && significant && ratio > MIN_RATIO_OF_ANOTHER_REGIME {
            warnings.push(format!(
                "{WARNING}`{}` is {ratio:.1} times larger in the validation records (standard deviation {judged:.3e}) than in the estimation records ({fitted:.3e}): they are another regime, in which other effects may act.",
                own.name
            ));
        } else if own.driven && judged > 0.0 && ratio < 1.0 / MIN_RATIO_OF_EXTRAPOLATION {
            warnings.push(format!(
                "{WARNING}`{}` is {:.0} times smaller in the validation records than in the estimation records: they may not show what was fitted.",
                own.name,
                1.0 / ratio
            ));
        }
        let nearest = frequency(&own.validation).and_then(|judged| {
            let ratio = |fitted: &f64| (judged / fitted).max(fitted / judged);
            let fitted = frequencies(&own.estimation).into_iter();
            fitted.min_by(|a, b| ratio(a).total_cmp(&ratio(b))).map(|fitted| (judged, fitted, ratio(&fitted)))
        });
        if let Some((judged, fitted, ratio)) = nearest
            && ratio > MIN_RATIO_OF_ANOTHER_REGIME
        {
            warnings.push(format!(
                "{WARNING}`{}` has {judged:.3} periods per second in the validation records and {fitted:.3} in the estimation records: they are another regime.",
                own.name
            ));
        }
    }
    Ok(warnings)
}

/// Refuses a signal that is in another unit on one record: motion and noise of its sensor differ from those of all
/// other records by a factor that no motion has.
fn check_unit(signal: &Signal) -> Result<(), String> {
    let records: Vec<&Values> = signal.estimation.iter().chain(&signal.validation).collect();
    let size = |own: &&Values| [deviation(own.values), scatter(own.values)];
    let sizes: Vec<[f64; 2]> = records.iter().map(size).collect();
    for (k, own) in records.iter().enumerate() {
        let others = [&sizes[..k], &sizes[k + 1..]].concat();
        let all_far = |ratio: &dyn Fn(f64, f64) -> f64| {
            let factor =
                |of: usize| others.iter().map(|other| ratio(sizes[k][of], other[of])).reduce(f64::min);
            let [spread, noise] = [factor(0)?, factor(1)?];
            let far = |factor: f64| factor.is_finite() && factor >= MIN_FACTOR_OF_OTHER_UNIT;
            (far(spread) && far(noise)).then_some(spread)
        };
        let larger = all_far(&|own, other| own / other).map(|factor| (factor, "larger"));
        if let Some((factor, word)) =
            larger.or_else(|| Some((all_far(&|own, other| other / own)?, "smaller")))
        {
            let than = match &records[..] {
                [one, other] => format!("in {}", if k == 0 { other.name } else { one.name }),
                _ => "in any other record".to_owned(),
            };
            return Err(format!(
                "`{}` is {factor:.0} times {word} in {} than {than}, and the noise of its sensor is, too: another unit? The header of that file says it behind the name, as in `p [bar]`; else leave the record out",
                signal.name, own.name
            ));
        }
    }
    Ok(())
}

/// Refuses a record whose time is in another unit: its samples are much farther apart than those of all other records,
/// or much closer together, and hold as many periods of the signal.
fn check_time(signal: &Signal) -> Result<(), String> {
    let records: Vec<&Values> = signal.estimation.iter().chain(&signal.validation).collect();
    let per_sample = |own: &&Values| frequency(std::slice::from_ref(*own)).map(|found| found * own.step);
    for (k, own) in records.iter().enumerate() {
        let others = [&records[..k], &records[k + 1..]].concat();
        let factor = |other: &&Values| (own.step / other.step).max(other.step / own.step);
        let is_far = others.iter().all(|other| factor(other) >= MIN_FACTOR_OF_OTHER_UNIT);
        let Some((here, there)) = per_sample(own).zip(others.iter().find_map(per_sample)).filter(|_| is_far)
        else {
            continue;
        };
        if (here / there).max(there / here) <= MIN_RATIO_OF_ANOTHER_REGIME {
            return Err(format!(
                "samples of {} are {} s apart, those of the other records {} s, and `{}` has about as many periods per sample: is its time in another unit? The header says it behind the name, as in `time [ms]`",
                own.name,
                short(own.step),
                short(others[0].step),
                signal.name
            ));
        }
    }
    Ok(())
}

/// A step \[s\] without needless digits.
fn short(step: f64) -> String {
    format!("{step:.6}").trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Standard deviation about the mean.
pub fn deviation(values: &[f64]) -> f64 {
    (squares(values) / values.len().max(1) as f64).sqrt()
}

/// Standard deviation about the mean of each record.
fn pooled(records: &[Values]) -> f64 {
    let count: usize = records.iter().map(|own| own.values.len()).sum();
    (records.iter().map(|own| squares(own.values)).sum::<f64>() / count.max(1) as f64).sqrt()
}

/// Sum of squares about the mean.
fn squares(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    values.iter().map(|value| (value - mean).powi(2)).sum()
}

/// Periods per second of the records together, and of each that holds enough of them.
fn frequencies(records: &[Values]) -> Vec<f64> {
    let each = records.iter().filter_map(|own| frequency(std::slice::from_ref(own)));
    frequency(records).into_iter().chain(each).collect()
}

/// Periods per second of the records together; none where they hold too few.
fn frequency(records: &[Values]) -> Option<f64> {
    let (mut periods, mut time) = (0.0, 0.0);
    for own in records {
        let Values { step, values, .. } = own;
        let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
        let level = HYSTERESIS * deviation(own.values);
        let mut above = false;
        for value in *values {
            if !above && value - mean > level {
                (above, periods) = (true, periods + 1.0);
            } else if value - mean < -level {
                above = false;
            }
        }
        time += step * values.len() as f64;
    }
    (periods >= MIN_PERIODS).then_some(periods / time)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(size: f64, frequency: f64) -> Vec<f64> {
        let mut noise = crate::engine::noise::Noise::new(1, 0);
        let w = std::f64::consts::TAU * frequency;
        (0..4000).map(|k| size * (w * 0.005 * f64::from(k)).sin() + 0.01 * noise.normal()).collect()
    }

    fn checked(estimation: &[f64], validation: &[f64]) -> Result<Vec<String>, String> {
        checked_beside(&[estimation], validation)
    }

    fn checked_beside(estimation: &[&[f64]], validation: &[f64]) -> Result<Vec<String>, String> {
        let record = |values| Values { name: "a.csv", step: 0.005, values };
        let signal = Signal {
            name: "x",
            driven: false,
            noise: 0.01,
            estimation: estimation.iter().map(|values| record(values)).collect(),
            validation: vec![Values { name: "b.csv", step: 0.005, values: validation }],
        };
        check(&[signal])
    }

    #[test]
    fn records_of_one_kind_give_no_warning() {
        assert_eq!(checked(&wave(1.0, 1.0), &wave(1.5, 1.7)), Ok(Vec::new()));
        // A free swing that dies out is fitted where it is large.
        assert_eq!(checked(&wave(1.0, 1.0), &wave(0.05, 1.0)), Ok(Vec::new()));
    }

    #[test]
    fn larger_and_faster_validation_is_told_and_much_larger_one_refused() {
        let found = checked(&wave(1.0, 1.0), &wave(5.0, 1.0)).unwrap();
        assert!(found.len() == 1 && found[0].contains("5.0 times larger"), "{found:?}");
        let found = checked(&wave(1.0, 1.0), &wave(1.0, 5.0)).unwrap();
        assert!(found.len() == 1 && found[0].contains("periods per second"), "{found:?}");
        let problem = checked(&wave(1.0, 1.0), &wave(30.0, 1.0)).unwrap_err();
        assert!(problem.contains("30 times larger") && problem.contains("Exchange"), "{problem}");
    }

    #[test]
    fn a_record_in_another_unit_is_told_by_its_noise() {
        let usual = [wave(1.0, 0.4), wave(0.8, 0.6)];
        let milli: Vec<f64> = wave(1.0, 0.5).iter().map(|value| 1e3 * value).collect();
        let problem = checked_beside(&[&usual[0], &usual[1], &milli], &usual[0]).unwrap_err();
        assert!(problem.contains("times larger"), "{problem}");
        let kilo: Vec<f64> = wave(1.0, 0.5).iter().map(|value| 1e-3 * value).collect();
        let problem = checked_beside(&[&usual[0], &kilo, &usual[1]], &usual[0]).unwrap_err();
        assert!(problem.contains("times smaller"), "{problem}");
        // A machine at rest has the noise of its sensor.
        assert!(checked_beside(&[&usual[0], &wave(0.0, 1.0)], &usual[1]).is_ok());
    }

    #[test]
    fn a_record_in_milliseconds_is_told_by_its_periods_per_sample() {
        let wave = wave(1.0, 0.6);
        let record = |name, step| Values { name, step, values: &wave };
        let signal = |step| Signal {
            name: "x",
            driven: false,
            noise: 0.01,
            estimation: vec![record("a.csv", 0.005), record("b.csv", 0.01)],
            validation: vec![record("c.csv", step)],
        };
        let problem = check(&[signal(5.0)]).unwrap_err();
        assert!(problem.contains("c.csv") && problem.contains("time [ms]"), "{problem}");
        assert!(check(&[signal(0.02)]).is_ok());
    }

    #[test]
    fn validation_like_one_of_the_estimation_records_is_no_other_regime() {
        let slow = [wave(1.0, 0.4), wave(1.0, 0.3), wave(1.0, 0.4)];
        let mut records: Vec<&[f64]> = slow.iter().map(Vec::as_slice).collect();
        assert_eq!(checked_beside(&records, &wave(1.0, 5.0)).unwrap().len(), 1);
        let quick = wave(1.0, 4.6);
        records.push(&quick);
        assert_eq!(checked_beside(&records, &wave(1.0, 5.0)), Ok(Vec::new()));
    }

    #[test]
    fn records_of_noise_alone_are_refused() {
        let problem = checked(&wave(0.0, 1.0), &wave(1.0, 1.0)).unwrap_err();
        assert!(problem.contains("estimation") && problem.contains("a.csv"), "{problem}");
        assert!(checked(&wave(1.0, 1.0), &wave(0.0, 1.0)).unwrap_err().contains("validation"));
    }
}
