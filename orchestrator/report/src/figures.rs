//! The charts of a report.

use super::chart::{Chart, Mark, bars};
use super::{names, words};
use airloop_refine::answer::Answer;
use airloop_refine::evidence::{Correlation, Curve, Dependence, Evidence, Port, Record};
use airloop_refine::law::found::Law;
use airloop_refine::vocabulary::own::{Own, VARIABLES};

/// Size of a chart over the whole width, and of one of a pair \[px\].
const FULL_WIDTH_SIZE: (f64, f64) = (920.0, 230.0);
const HALF_WIDTH_SIZE: (f64, f64) = (470.0, 250.0);
/// Most points of a curve over time.
const MAX_DRAWN_POINTS: usize = 6000;

/// Errors on validation records in multiples of the noise floor.
pub fn errors(answer: &Answer) -> Option<String> {
    let (before, after) = (&answer.before[1], &answer.after[1]);
    let rows: Vec<_> = before
        .rms
        .keys()
        .filter_map(|signal| {
            let [from, to] = [before, after].map(|errors| answer.times_floor(errors, signal));
            Some((signal.clone(), from?, to?))
        })
        .collect();
    let label = "rms error on validation records / error that sensor noise alone gives";
    (!rows.is_empty()).then(|| bars("Error in multiples of the noise floor", &rows, (1.0, "noise"), label))
}

/// Power of the residual at each port.
pub fn ports(ports: &[Port], limit: f64) -> Option<String> {
    let rows: Vec<_> = ports
        .iter()
        .map(|port| (format!("{} \u{2192} {}", port.from, port.to), port.left[0], port.left[1]))
        .collect();
    let label = "residual, in standard deviations above sensor noise";
    (!rows.is_empty())
        .then(|| bars("Residuals by part of the system", &rows, (limit.max(1.0), "limit"), label))
}

/// Points of a curve over time: all of them, or the least and the largest of spans of equal length where there are more
/// than a chart can show.
fn thinned(values: &[f64], step: f64) -> Vec<(f64, f64)> {
    let at = |k: usize| (k as f64 * step, values[k]);
    if values.len() <= MAX_DRAWN_POINTS {
        return (0..values.len()).map(at).collect();
    }
    let length = values.len().div_ceil(MAX_DRAWN_POINTS / 2);
    let mut found = Vec::with_capacity(MAX_DRAWN_POINTS);
    for begin in (0..values.len()).step_by(length) {
        let span = begin..(begin + length).min(values.len());
        let least = span.clone().min_by(|&a, &b| values[a].total_cmp(&values[b])).unwrap_or(begin);
        let largest = span.max_by(|&a, &b| values[a].total_cmp(&values[b])).unwrap_or(begin);
        found.push(at(least.min(largest)));
        if least != largest {
            found.push(at(least.max(largest)));
        }
    }
    found
}

/// Residuals of one record over time.
pub fn residuals(record: &Record, evidence: &Evidence) -> Vec<String> {
    let one = |residual: &airloop_refine::evidence::Residual| {
        let signal = evidence.signals.get(residual.signal)?;
        let points = |model: usize| thinned(&residual.values[model], record.sample_time);
        let chart = Chart {
            title: format!("{}: measured less predicted", signal.name),
            labels: ("time [s]".into(), format!("residual [{}]", signal.unit)),
            size: FULL_WIDTH_SIZE,
            marks: vec![
                Mark::Line { name: "before", class: "before", points: points(0) },
                Mark::Line { name: "after", class: "after", points: points(1) },
            ],
            noise: Some(2.0 * signal.noise),
            linked: Some(record.name.clone()),
        };
        Some(chart.svg())
    };
    record.residuals.iter().filter_map(one).collect()
}

/// Mean residual over a variable.
pub fn dependence(dependence: &Dependence) -> String {
    let (name, unit) = &dependence.variable;
    let chart = Chart {
        title: format!("{} over {name}", dependence.signal),
        labels: (
            format!("{} [{unit}]", names::variable(name)),
            format!("mean residual [{}]", dependence.unit),
        ),
        size: HALF_WIDTH_SIZE,
        marks: vec![
            Mark::Dots {
                name: "before",
                class: "before",
                points: dependence.bins.iter().map(|bin| (bin.0, bin.1)).collect(),
            },
            Mark::Dots {
                name: "after",
                class: "after",
                points: dependence.bins.iter().map(|bin| (bin.0, bin.2)).collect(),
            },
        ],
        noise: Some(2.0 * dependence.noise),
        linked: None,
    };
    chart.svg()
}

/// The free form of a law over its variable with its 95 % band, and the law through it; none for two variables.
pub fn law(law: &Law) -> Option<String> {
    let own = law.effect.own.as_ref()?;
    let (name, _, _, unit) = law.covered.first()?;
    let place = VARIABLES.iter().position(|known| known == name)?;
    let p: Vec<f64> = law.effect.parameters.iter().map(|p| p.value).collect();
    let value = |at: f64| {
        let mut variables = [0.0; 4];
        variables[place] = at;
        taken_off(own, variables, &p)
    };
    let (first, last) = (law.curve.first()?[0], law.curve.last()?[0]);
    let points = (0..=200).map(|k| first + (last - first) * f64::from(k) / 200.0);
    let mut marks = vec![
        Mark::Band {
            name: "95 % of the free form",
            points: law.curve.iter().map(|[at, y, half]| (*at, y - half, y + half)).collect(),
        },
        Mark::Dots {
            name: "free form",
            class: "before",
            points: law.curve.iter().map(|[at, y, _]| (*at, *y)).collect(),
        },
    ];
    if own.states.is_empty() {
        let points = points.map(|at| (at, value(at))).collect();
        marks.push(Mark::Line { name: "law", class: "after", points });
    }
    let chart = Chart {
        title: format!("What is missing at {}", law.port),
        labels: (format!("{name} [{unit}]"), format!("[{}]", own.units[2])),
        size: FULL_WIDTH_SIZE,
        marks,
        noise: None,
        linked: None,
    };
    Some(chart.svg())
}

/// Amount that the formula of a law takes off at its port, as its free form counts it: at a signal or command the
/// formula says what is left of it.
fn taken_off(own: &Own, variables: [f64; 4], p: &[f64]) -> f64 {
    let (value, passes) = (own.value(variables, &[0.0; 3], p), variables[2]);
    match own.port.replaces() {
        false => value,
        true if own.formula.starts_with("f + (") => value - passes,
        true => passes - value,
    }
}

/// Autocorrelation of one signal.
pub fn correlation(correlation: &Correlation) -> String {
    let points = |model: usize| {
        correlation.lags.iter().copied().zip(correlation.values[model].iter().copied()).collect::<Vec<_>>()
    };
    let chart = Chart {
        title: format!("{}: autocorrelation", correlation.signal),
        labels: ("lag [s]".into(), "correlation".into()),
        size: HALF_WIDTH_SIZE,
        marks: vec![
            Mark::Line { name: "before", class: "before", points: points(0) },
            Mark::Line { name: "after", class: "after", points: points(1) },
        ],
        noise: Some(correlation.limit),
        linked: None,
    };
    chart.svg()
}

/// The curve of an effect with its band.
pub fn curve(curve: &Curve) -> String {
    let chart = Chart {
        title: curve.title.clone(),
        labels: (
            format!("{} [{}]", names::variable(&curve.over.0), curve.over.1),
            format!("{} [{}]", curve.what.0, curve.what.1),
        ),
        size: (920.0, 280.0),
        marks: vec![
            Mark::Band {
                name: "95 % band",
                points: curve.points.iter().map(|p| (p[0], p[2], p[3])).collect(),
            },
            Mark::Line {
                name: "effect",
                class: "curve",
                points: curve.points.iter().map(|p| (p[0], p[1])).collect(),
            },
        ],
        noise: None,
        linked: None,
    };
    chart.svg()
}

/// The dependence of the residuals in words, for readers of the text form.
pub fn dependence_row(dependence: &Dependence) -> [String; 5] {
    let largest = |f: &dyn Fn(&(f64, f64, f64)) -> f64| {
        dependence.bins.iter().map(|bin| f(bin).abs()).fold(0.0, f64::max)
    };
    [
        dependence.signal.clone(),
        dependence.variable.0.clone(),
        format!("{:.0} %", 100.0 * dependence.share),
        words::number(largest(&|bin| bin.1)),
        words::number(largest(&|bin| bin.2)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_record_keeps_its_extremes_and_its_order() {
        let mut values: Vec<f64> = (0..100_000).map(|k| f64::from(k % 7)).collect();
        (values[54_321], values[77_777]) = (50.0, -50.0);
        let points = thinned(&values, 0.5);
        assert!(points.len() <= MAX_DRAWN_POINTS && points.windows(2).all(|pair| pair[0].0 < pair[1].0));
        assert!(points.contains(&(27_160.5, 50.0)) && points.contains(&(38_888.5, -50.0)));
        assert_eq!(thinned(&values[..5], 1.0).len(), 5);
    }

    #[test]
    fn a_law_is_drawn_as_its_free_form_counts_it() {
        let taken = |port: &str, formula: &str| {
            let text = format!(
                "kind = \"law\"\nport = {port:?}\nformula = {formula:?}\n[parameters]\na = {{ unit = \"N\", start = 2.0 }}\n"
            );
            let text = if port == "force" { text } else { text.replace("\"N\"", "\"1\"") };
            taken_off(&Own::read(&text).unwrap(), [0.0, 0.0, 5.0, 0.0], &[2.0])
        };
        assert_eq!(taken("force", "a"), 2.0);
        assert_eq!(taken("signal", "f - (a)"), 2.0);
        assert_eq!(taken("signal", "f + (a)"), 2.0);
    }
}
