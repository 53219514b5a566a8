//! One function per figure.

use super::Plan;
use crate::plot::axes::{curve, range};
use crate::plot::identification::panel::{Entry, Panel, Scale, Sheet};
use crate::plot::run::short;
use crate::plot::svg::{Shape, Svg};
use airloop_plan::record::SignalRecord;
use airloop_series::TimeSeries;

/// Classes of the plan, and of the roll-outs.
const PLANNED: &str = "s0";
const CONTINUOUS: &str = "s1 d1";
const SAMPLED: &str = "s2 d2";
/// Share of the range that is left free above and below.
const PAD: f64 = 0.06;

fn padded((min, max): (f64, f64)) -> (f64, f64) {
    let room = if max > min { PAD * (max - min) } else { 0.5 * min.abs().max(1.0) };
    (min - room, max + room)
}

fn label(signal: &SignalRecord) -> String {
    match signal.unit.as_deref() {
        None | Some("" | "1") => signal.name.clone(),
        Some(unit) => format!("{} [{unit}]", signal.name),
    }
}

fn legend(plan: &Plan) -> Vec<Entry<'static>> {
    let mut entries = vec![Entry { class: PLANNED, shape: None, text: "plan" }];
    if plan.continuous.is_some() {
        entries.push(Entry { class: CONTINUOUS, shape: None, text: "roll-out, continuous" });
    }
    if plan.sampled.is_some() {
        entries.push(Entry { class: SAMPLED, shape: None, text: "roll-out, sampled" });
    }
    entries
}

/// Lines of steps: every value is held until the next time.
fn steps(time: &[f64], values: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let (mut t, mut v) = (Vec::with_capacity(2 * time.len()), Vec::with_capacity(2 * time.len()));
    for (k, (&at, &value)) in time.iter().zip(values).enumerate() {
        if k > 0 {
            t.push(at);
            v.push(values[k - 1]);
        }
        t.push(at);
        v.push(value);
    }
    (t, v)
}

fn span(series: &TimeSeries) -> (f64, f64) {
    range(series.time().iter().copied())
}

/// Bounds that lie near enough to what is drawn to be shown.
fn bounds(signal: &SignalRecord, (min, max): (f64, f64)) -> Vec<f64> {
    let room = 0.6 * (max - min);
    let near = |bound: &f64| (min - room..=max + room).contains(bound);
    [signal.min, signal.max].into_iter().flatten().filter(near).collect()
}

/// Draws one signal: its bounds, the plan, and roll-outs that have it.
fn signal(sheet: &mut Sheet, index: usize, plan: &Plan, record: &SignalRecord) {
    let all = [Some(&plan.trajectory), plan.continuous.as_ref(), plan.sampled.as_ref()];
    let found: Vec<(&TimeSeries, &[f64], &str)> = all
        .into_iter()
        .zip([PLANNED, CONTINUOUS, SAMPLED])
        .filter_map(|(series, class)| {
            let series = series?;
            Some((series, plan.values(series, &record.name)?, class))
        })
        .collect();
    let drawn = range(found.iter().flat_map(|(_, values, _)| values.iter().copied()));
    let bounds = bounds(record, drawn);
    let limits = range([drawn.0, drawn.1].into_iter().chain(bounds.iter().copied()));
    let text = label(record);
    let panel = sheet.panel(
        index,
        "",
        (span(&plan.trajectory), Scale::Linear, "time [s]"),
        (padded(limits), Scale::Linear, &text),
    );
    for bound in bounds {
        panel.level(&mut sheet.svg, bound, "limit");
    }
    for (series, values, class) in found {
        let points = curve(series.time(), values, &panel.x, &panel.y, record.held);
        sheet.svg.polyline(&points, class);
    }
}

fn of_kind<'a>(plan: &'a Plan, kinds: &[&str]) -> Vec<&'a SignalRecord> {
    plan.summary.signals.iter().filter(|signal| kinds.contains(&signal.kind.as_str())).collect()
}

/// States and outputs over time: plan and roll-outs.
pub(super) fn states(plan: &Plan) -> String {
    let signals = of_kind(plan, &["state", "output"]);
    let columns = if signals.len() > 2 { 2 } else { 1 };
    let mut sheet = Sheet::new("States", "", &legend(plan), signals.len(), columns, 150.0);
    for (index, record) in signals.iter().enumerate() {
        signal(&mut sheet, index, plan, record);
    }
    sheet.svg.finish("States over time: plan and roll-outs")
}

/// Inputs over time, with their bounds where these are near.
pub(super) fn inputs(plan: &Plan) -> String {
    let signals = of_kind(plan, &["input"]);
    let entries: Vec<Entry> = legend(plan).into_iter().take(1).collect();
    let limits: Vec<String> = signals
        .iter()
        .filter_map(|signal| {
            let unit = signal.unit.as_deref().unwrap_or("");
            let text = match (signal.min, signal.max) {
                (Some(min), Some(max)) => format!("{} .. {} {unit}", short(min), short(max)),
                (Some(min), None) => format!("at least {} {unit}", short(min)),
                (None, Some(max)) => format!("at most {} {unit}", short(max)),
                (None, None) => return None,
            };
            Some(format!("{} within {text}", signal.name))
        })
        .collect();
    let mut sheet = Sheet::new("Input", &limits.join(", "), &entries, signals.len(), 1, 260.0);
    for (index, record) in signals.iter().enumerate() {
        signal(&mut sheet, index, plan, record);
    }
    sheet.svg.finish("Inputs over time")
}

/// The two columns of the phase portrait: the angle of the pole, or the first state, with its rate.
fn portrait_columns(plan: &Plan) -> Option<(&SignalRecord, &SignalRecord)> {
    let states = of_kind(plan, &["state"]);
    let pairs = plan.summary.portrait.as_ref()?;
    let find = |name: &str| states.iter().find(|signal| signal.name == name).copied();
    Some((find(&pairs.0)?, find(&pairs.1)?))
}

/// A state over its rate: plan and roll-outs.
pub(super) fn portrait(plan: &Plan) -> String {
    let mut sheet = Sheet::new("Phase portrait", "", &legend(plan), 1, 1, 380.0);
    if let Some((x, y)) = portrait_columns(plan) {
        let all = [Some(&plan.trajectory), plan.continuous.as_ref(), plan.sampled.as_ref()];
        let lines: Vec<(&[f64], &[f64], &str)> = all
            .into_iter()
            .zip([PLANNED, CONTINUOUS, SAMPLED])
            .filter_map(|(series, class)| {
                Some((plan.values(series?, &x.name)?, plan.values(series?, &y.name)?, class))
            })
            .collect();
        let across = range(lines.iter().flat_map(|line| line.0.iter().copied()));
        let upwards = range(lines.iter().flat_map(|line| line.1.iter().copied()));
        let panel = sheet.panel(
            0,
            "",
            (padded(across), Scale::Linear, &label(x)),
            (padded(upwards), Scale::Linear, &label(y)),
        );
        for (x, y, class) in &lines {
            let points: Vec<(f64, f64)> = x.iter().zip(*y).map(|(x, y)| panel.at(*x, *y)).collect();
            sheet.svg.polyline(&apart(&points), class);
        }
        let (x, y, _) = lines[0];
        ends(&mut sheet.svg, &panel, x, y);
    }
    sheet.svg.finish("Phase portrait: plan and roll-outs")
}

/// Points of a line that lie at least a pixel apart, and its last.
fn apart(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut kept: Vec<(f64, f64)> = Vec::new();
    for &(x, y) in points {
        if kept.last().is_none_or(|(a, b)| (x - a).hypot(y - b) >= 1.0) {
            kept.push((x, y));
        }
    }
    kept.extend(points.last().filter(|last| kept.last() != Some(last)));
    kept
}

/// Markers at the first and the last point.
fn ends(svg: &mut Svg, panel: &Panel, x: &[f64], y: &[f64]) {
    if let (Some((&x0, &y0)), Some((&x1, &y1))) = (x.first().zip(y.first()), x.last().zip(y.last())) {
        svg.marker(Shape::Circle, panel.at(x0, y0), 5.0, "s0 open");
        svg.marker(Shape::Square, panel.at(x1, y1), 5.0, "s0 open");
    }
}

/// Estimated error of every interval, relative to the size of each state, the worst state in each.
pub(super) fn interval_error(plan: &Plan) -> String {
    let note =
        plan.summary.max_interval_error.map_or(String::new(), |worst| format!("largest {}", short(worst)));
    let mut sheet = Sheet::new("Error between the knots", &note, &[], 1, 1, 220.0);
    if let Some(defects) = &plan.defects {
        let worst = plan.values(defects, "relative").unwrap_or_default().to_vec();
        let (low, high) = range(worst.iter().copied().filter(|error| *error > 0.0));
        let (low, high) = if low.is_finite() { (low, high) } else { (1e-12, 1e-6) };
        let panel = sheet.panel(
            0,
            "worst state of each interval, relative to its size",
            (span(&plan.trajectory), Scale::Linear, "time [s]"),
            ((f64::max(low / 2.0, high * 1e-6), high * 2.0), Scale::Logarithmic, "relative error"),
        );
        let mut time = defects.time().to_vec();
        let mut values = worst;
        if let (Some(&end), Some(&last)) = (plan.trajectory.time().last(), values.last()) {
            time.push(end);
            values.push(last);
        }
        let (t, v) = steps(&time, &values);
        panel.line(&mut sheet.svg, &t, &v, PLANNED);
    }
    sheet.svg.finish("Estimated error of the states over every interval")
}
