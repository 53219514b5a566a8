//! One function per kind of figure.

use super::axes::{Axis, curve, range};
use super::svg::{Anchor, SERIES_CLASSES, Svg};

const WIDTH: f64 = 960.0;
const LEFT: f64 = 84.0;
const RIGHT: f64 = 20.0;
const TOP: f64 = 46.0;
const BOTTOM: f64 = 50.0;

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
    /// What stands beside the title (the fit).
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
    let entries =
        [("measured", "measured"), ("simulated", "simulated"), ("residual", "measured \u{2212} simulated")];
    let head = Head::new(figure.name, figure.note, &entries);
    let top = head.bottom();
    let mut svg = Svg::new(WIDTH, top + upper + gap + lower + BOTTOM);
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
    head.draw(&mut svg);
    svg.finish(&format!("{}: measured and simulated over time", figure.name))
}

/// Several signals of one unit over time.
pub fn signals(name: &str, unit: &str, curves: &[Curve]) -> String {
    let upper = 320.0;
    let classes: Vec<String> =
        (0..curves.len()).map(|index| format!("s{}", index % SERIES_CLASSES)).collect();
    let entries: Vec<(&str, &str)> =
        classes.iter().zip(curves).map(|(class, curve)| (class.as_str(), curve.name)).collect();
    let head = Head::new(name, "", if curves.len() > 1 { &entries } else { &[] });
    let top = head.bottom();
    let mut svg = Svg::new(WIDTH, top + upper + BOTTOM);
    let times: Vec<&[f64]> = curves.iter().map(|curve| curve.time).collect();
    let x = time_axis(&times);
    let values = curves.iter().flat_map(|curve| curve.values.iter().copied());
    let y = Axis::new(range(values), (top + upper, top)).padded(0.06);
    let label = if curves.len() == 1 { axis_label(name, unit) } else { axis_label("", unit) };
    panel(&mut svg, &x, &y, 6, true, &label);
    for (curve, class) in curves.iter().zip(&classes) {
        curve.draw(&mut svg, &x, &y, class);
    }
    head.draw(&mut svg);
    svg.finish(&format!("{name} over time"))
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

/// Title and legend above the plot: side by side where they fit, else the legend in rows of its own.
struct Head<'a> {
    title: String,
    note: &'a str,
    /// Entries (class, text) by row; the first row is that of the title.
    rows: Vec<Vec<(&'a str, &'a str)>>,
}

/// Height of a row of the legend.
const ROW: f64 = 20.0;
/// Room between title and legend.
const ROOM: f64 = 20.0;

impl<'a> Head<'a> {
    fn new(name: &str, note: &'a str, entries: &[(&'a str, &'a str)]) -> Head<'a> {
        let most = ((WIDTH - RIGHT - LEFT - note_width(note)) / TITLE_LETTER) as usize;
        let title = match name.chars().count() > most {
            true => name.chars().take(most.saturating_sub(1)).chain(['\u{2026}']).collect(),
            false => name.to_owned(),
        };
        let begin = LEFT + title_width(&title) + note_width(note) + ROOM;
        let width = |entries: &[(&str, &str)]| entries.iter().map(|(_, text)| entry_width(text)).sum::<f64>();
        if entries.is_empty() || begin + width(entries) <= WIDTH - RIGHT {
            return Head { title, note, rows: vec![entries.to_vec()] };
        }
        let mut rows = vec![Vec::new(), Vec::new()];
        for entry in entries {
            let last = rows.last_mut().expect("there is a row");
            if !last.is_empty() && LEFT + width(last) + entry_width(entry.1) > WIDTH - RIGHT {
                rows.push(vec![*entry]);
            } else {
                last.push(*entry);
            }
        }
        Head { title, note, rows }
    }

    /// Where the plot may begin.
    fn bottom(&self) -> f64 {
        TOP + ROW * (self.rows.len() - 1) as f64
    }

    fn draw(&self, svg: &mut Svg) {
        svg.text((LEFT, 24.0), Anchor::Start, "title", &self.title);
        svg.text((LEFT + 14.0 + title_width(&self.title), 24.0), Anchor::Start, "note", self.note);
        for (row, entries) in self.rows.iter().enumerate() {
            legend(svg, entries, 24.0 + ROW * row as f64);
        }
    }
}

// Text widths are not known here; letters of the title are about 9 pixels wide, those of note and legend 7.
const TITLE_LETTER: f64 = 9.0;

fn title_width(text: &str) -> f64 {
    TITLE_LETTER * text.chars().count() as f64
}

fn note_width(text: &str) -> f64 {
    7.0 * text.chars().count() as f64
}

/// Width of an entry of the legend with its line and the room before it.
fn entry_width(text: &str) -> f64 {
    7.0 * text.chars().count() as f64 + 46.0
}

/// Entries (class, text) right-aligned on the base line `y`.
fn legend(svg: &mut Svg, entries: &[(&str, &str)], y: f64) {
    let mut right = WIDTH - RIGHT;
    for (class, text) in entries.iter().rev() {
        let width = 7.0 * text.chars().count() as f64;
        svg.text((right - width, y), Anchor::Start, "legend", text);
        svg.line((right - width - 28.0, y - 4.0), (right - width - 6.0, y - 4.0), class);
        right -= entry_width(text);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn title_and_legend_never_overlap() {
        let long = "Float64_continuous_output";
        for (count, rows) in [(1, 1), (2, 2), (3, 2), (4, 3), (6, 3)] {
            let entries = vec![("s0", long); count];
            let name = vec![long; count].join(", ");
            let head = Head::new(if count == 1 { "y" } else { &name }, "", &entries);
            assert_eq!(head.rows.len(), rows, "{count} entries");
            assert_eq!(head.rows.concat().len(), count);
            assert!(title_width(&head.title) <= WIDTH - LEFT - RIGHT, "{}", head.title);
            for row in &head.rows {
                let width: f64 = row.iter().map(|(_, text)| entry_width(text)).sum();
                assert!(LEFT + width <= WIDTH - RIGHT);
            }
        }
        let entries = [("measured", "measured"), ("simulated", "simulated")];
        assert_eq!(Head::new("x", "fit 99.52 %", &entries).rows.len(), 1);
        assert_eq!(Head::new(&long.repeat(2), "fit 99.52 %, RMS error 1 N", &entries).rows.len(), 2);
    }
}
