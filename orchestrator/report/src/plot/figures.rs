//! One function per kind of figure.

use super::axes::{Axis, curve, range};
use super::svg::{Anchor, DASH_CLASSES, SERIES_CLASSES, Svg};

const WIDTH: f64 = 960.0;
const LEFT: f64 = 84.0;
const RIGHT: f64 = 20.0;
const TOP: f64 = 46.0;
const BOTTOM: f64 = 50.0;
/// Height of a row of the legend.
const ROW: f64 = 20.0;
/// Text widths are not known here; small letters are about this wide.
const LETTER: f64 = 7.0;
/// Room for the line of a legend entry.
const SWATCH: f64 = 46.0;

/// A curve over time.
#[derive(Debug, Clone, Copy)]
pub struct Curve<'a> {
    /// Times \[s\], shape \[n\].
    pub time: &'a [f64],
    /// Values, shape \[n\].
    pub values: &'a [f64],
    /// Drawn in steps.
    pub held: bool,
    /// Text of the legend.
    pub name: &'a str,
}

impl Curve<'_> {
    fn draw(&self, svg: &mut Svg, x: &Axis, y: &Axis, class: &str) {
        svg.polyline(&curve(self.time, self.values, x, y, self.held), class);
    }
}

/// A measured signal with its simulation.
#[derive(Debug, Clone, Copy)]
pub struct Comparison<'a> {
    /// Signal.
    pub name: &'a str,
    /// Unit; empty for none.
    pub unit: &'a str,
    /// Note next to the title (the fit).
    pub note: &'a str,
    /// Measured.
    pub measured: Curve<'a>,
    /// Simulated.
    pub simulated: Curve<'a>,
    /// Measured minus simulated at the measured times.
    pub residual: Curve<'a>,
}

/// Measured and simulated signal over each other, and their difference in a panel below on a scale of its own.
pub fn comparison(figure: &Comparison) -> String {
    let (upper, lower, gap) = (300.0, 110.0, 18.0);
    let left = format!("measured \u{2212} {}", figure.simulated.name);
    let entries = [("measured", "measured"), ("simulated", figure.simulated.name), ("residual", &left)];
    let heading = note_start(figure.name) + LETTER * figure.note.chars().count() as f64;
    let crowded = heading + legend_width(&entries) > WIDTH - RIGHT;
    let top = if crowded { TOP + ROW } else { TOP };
    let height = top + upper + gap + lower + BOTTOM;
    let mut svg = Svg::new(WIDTH, height);
    let times = [figure.measured.time, figure.simulated.time];
    let x = time_axis(&times);
    let values = figure.measured.values.iter().chain(figure.simulated.values).copied();
    let y = Axis::new(range(values), (top + upper, top)).padded(0.06);
    panel(&mut svg, &x, &y, 6, false, &axis_label(figure.name, figure.unit));
    figure.measured.draw(&mut svg, &x, &y, "measured");
    figure.simulated.draw(&mut svg, &x, &y, "simulated");
    let (begin, end) = (top + upper + gap, top + upper + gap + lower);
    let (min, max) = range(figure.residual.values.iter().copied());
    let y = Axis::new((min.min(0.0), max.max(0.0)), (end, begin)).padded(0.08);
    panel(&mut svg, &x, &y, 5, true, &axis_label("residual", figure.unit));
    svg.line((x.from, y.pixel(0.0)), (x.to, y.pixel(0.0)), "zero");
    figure.residual.draw(&mut svg, &x, &y, "residual");
    title(&mut svg, figure.name, figure.note);
    legend(&mut svg, &entries, if crowded { 24.0 + ROW } else { 24.0 });
    svg.finish(&format!("{}: measured and {} over time", figure.name, figure.simulated.name))
}

/// Several signals of one unit over time; one alone is named by the title, several by the legend.
pub fn signals(unit: &str, curves: &[Curve]) -> String {
    signals_of("", unit, curves)
}

/// Same as [`signals`], where several are of one quantity, which the axis names.
pub fn signals_of(quantity: &str, unit: &str, curves: &[Curve]) -> String {
    let upper = 320.0;
    let classes: Vec<String> = (0..curves.len()).map(series_class).collect();
    let entries: Vec<(&str, &str)> =
        classes.iter().zip(curves).map(|(class, curve)| (class.as_str(), curve.name)).collect();
    let rows = if curves.len() > 1 { legend_rows(&entries, WIDTH - LEFT - RIGHT) } else { Vec::new() };
    let top = TOP + ROW * rows.len().saturating_sub(1) as f64;
    let mut svg = Svg::new(WIDTH, top + upper + BOTTOM);
    let times: Vec<&[f64]> = curves.iter().map(|curve| curve.time).collect();
    let x = time_axis(&times);
    let values = curves.iter().flat_map(|curve| curve.values.iter().copied());
    let y = Axis::new(range(values), (top + upper, top)).padded(0.06);
    let names: Vec<&str> = curves.iter().map(|curve| curve.name).collect();
    let label = axis_label(if let [name] = names[..] { name } else { quantity }, unit);
    panel(&mut svg, &x, &y, 6, true, &label);
    for (curve, class) in curves.iter().zip(&classes) {
        curve.draw(&mut svg, &x, &y, class);
    }
    if let [name] = names[..] {
        title(&mut svg, name, "");
    }
    for (index, row) in rows.iter().enumerate() {
        legend(&mut svg, row, 24.0 + ROW * index as f64);
    }
    svg.finish(&format!("{} over time", names.join(", ")))
}

/// Class of a curve: a color, and from the second use of the colors on a dash.
fn series_class(index: usize) -> String {
    let color = format!("s{}", index % SERIES_CLASSES);
    match index / SERIES_CLASSES {
        0 => color,
        dash => format!("{color} d{}", dash.min(DASH_CLASSES)),
    }
}

fn time_axis(times: &[&[f64]]) -> Axis {
    Axis::new(range(times.iter().flat_map(|time| time.iter().copied())), (LEFT, WIDTH - RIGHT))
}

fn axis_label(name: &str, unit: &str) -> String {
    match (name, unit) {
        ("", "") => "value".into(),
        ("", unit) => format!("[{unit}]"),
        (name, "") => name.into(),
        (name, unit) => format!("{name} [{unit}]"),
    }
}

/// Grid, frame, ticks and labels of a panel between the pixels of its axes.
fn panel(svg: &mut Svg, x: &Axis, y: &Axis, ticks: usize, with_time: bool, label: &str) {
    for (value, text) in x.ticks(9) {
        let at = x.pixel(value);
        svg.line((at, y.from), (at, y.to), "grid");
        if with_time {
            svg.line((at, y.from), (at, y.from + 4.0), "mark");
            svg.text((at, y.from + 18.0), Anchor::Middle, "tick", &text);
        }
    }
    for (value, text) in y.ticks(ticks) {
        let at = y.pixel(value);
        svg.line((x.from, at), (x.to, at), "grid");
        svg.line((x.from - 4.0, at), (x.from, at), "mark");
        svg.text((x.from - 8.0, at + 4.0), Anchor::End, "tick", &text);
    }
    svg.frame(x.from, y.to, x.to - x.from, y.from - y.to);
    svg.text_upwards((20.0, 0.5 * (y.from + y.to)), "label", label);
    if with_time {
        svg.text((0.5 * (x.from + x.to), y.from + 38.0), Anchor::Middle, "label", "time [s]");
    }
}

fn title(svg: &mut Svg, name: &str, note: &str) {
    svg.text((LEFT, 24.0), Anchor::Start, "title", name);
    svg.text((note_start(name), 24.0), Anchor::Start, "note", note);
}

/// Horizontal start of the note next to a title; letters of the title are about 9 pixels wide.
fn note_start(name: &str) -> f64 {
    LEFT + 14.0 + 9.0 * name.chars().count() as f64
}

/// Room that entries take above the plot.
fn legend_width(entries: &[(&str, &str)]) -> f64 {
    entries.iter().map(|(_, text)| LETTER * text.chars().count() as f64 + SWATCH).sum()
}

/// Entries in rows that fit into `width`.
fn legend_rows<'a>(entries: &[(&'a str, &'a str)], width: f64) -> Vec<Vec<(&'a str, &'a str)>> {
    let mut rows: Vec<Vec<(&str, &str)>> = Vec::new();
    for entry in entries {
        match rows.last_mut() {
            Some(row) if legend_width(row) + legend_width(&[*entry]) <= width => row.push(*entry),
            _ => rows.push(vec![*entry]),
        }
    }
    rows
}

/// Entries (class, text) right-aligned above the plot.
fn legend(svg: &mut Svg, entries: &[(&str, &str)], baseline: f64) {
    let mut right = WIDTH - RIGHT;
    for (class, text) in entries.iter().rev() {
        let width = LETTER * text.chars().count() as f64;
        svg.text((right - width, baseline), Anchor::Start, "legend", text);
        svg.line((right - width - 28.0, baseline - 4.0), (right - width - 6.0, baseline - 4.0), class);
        right -= width + SWATCH;
    }
}
