//! Charts of a report: SVG parts of a page whose style sheet and script they share.
//!
//! A chart is complete without the script, which adds values under the pointer and zoom. What it needs for that stands
//! in `data-` attributes: the rectangle of the plot and the ranges of both axes.

use std::fmt::Write;

use crate::plot::axes::{Axis, curve, range};
use crate::plot::svg::escape;

/// Margins of the plot \[px\]: left, right, top, bottom.
const MARGINS: (f64, f64, f64, f64) = (76.0, 14.0, 34.0, 42.0);

/// Drawn element.
#[derive(Debug, Clone, PartialEq)]
pub enum Mark {
    /// A curve.
    Line {
        /// Name in the legend and under the pointer.
        name: &'static str,
        /// Class of the style sheet.
        class: &'static str,
        /// Points.
        points: Vec<(f64, f64)>,
    },
    /// Points with a line through them.
    Dots {
        /// Name.
        name: &'static str,
        /// Class.
        class: &'static str,
        /// Points.
        points: Vec<(f64, f64)>,
    },
    /// A band: x, lower and upper end.
    Band {
        /// Name.
        name: &'static str,
        /// Points.
        points: Vec<(f64, f64, f64)>,
    },
}

impl Mark {
    fn extent(&self) -> (Vec<f64>, Vec<f64>) {
        match self {
            Mark::Line { points, .. } | Mark::Dots { points, .. } => points.iter().copied().unzip(),
            Mark::Band { points, .. } => {
                (points.iter().map(|p| p.0).collect(), points.iter().flat_map(|p| [p.1, p.2]).collect())
            }
        }
    }

    fn legend(&self) -> (&'static str, &'static str) {
        match self {
            Mark::Line { name, class, .. } | Mark::Dots { name, class, .. } => (name, class),
            Mark::Band { name, .. } => (name, "band"),
        }
    }
}

/// A chart with two linear axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// Title.
    pub title: String,
    /// Labels of the axes.
    pub labels: (String, String),
    /// Size \[px\].
    pub size: (f64, f64),
    /// Drawn elements, from back to front.
    pub marks: Vec<Mark>,
    /// Range of values that noise explains, around zero.
    pub noise: Option<f64>,
    /// Charts of one name zoom together along x.
    pub linked: Option<String>,
}

impl Chart {
    /// The chart as SVG.
    pub fn svg(&self) -> String {
        let (width, height) = self.size;
        let (left, right, top, bottom) = MARGINS;
        let (mut xs, mut ys) = (Vec::new(), Vec::new());
        for mark in &self.marks {
            let (x, y) = mark.extent();
            xs.extend(x);
            ys.extend(y);
        }
        ys.extend(self.noise.into_iter().flat_map(|noise| [-noise, noise]));
        let x = Axis::new(range(xs), (left, width - right));
        let y = Axis::new(range(ys), (height - bottom, top)).padded(0.06);
        let mut out = String::new();
        let link =
            self.linked.as_ref().map_or(String::new(), |name| format!(" data-link=\"{}\"", escape(name)));
        // Writing into a String cannot fail.
        let _ = writeln!(
            out,
            "<svg class=\"chart\" viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{}\" data-box=\"{left},{top},{},{}\" data-x=\"{},{}\" data-y=\"{},{}\"{link}>",
            escape(&self.title),
            width - left - right,
            height - top - bottom,
            x.min,
            x.max,
            y.min,
            y.max
        );
        let _ = writeln!(out, "<text class=\"t\" x=\"{left}\" y=\"18\">{}</text>", escape(&self.title));
        axes(&mut out, &x, &y);
        let _ = writeln!(
            out,
            "<svg x=\"{left}\" y=\"{top}\" width=\"{0}\" height=\"{1}\" viewBox=\"{left} {top} {0} {1}\" preserveAspectRatio=\"none\"><g class=\"data\">",
            width - left - right,
            height - top - bottom
        );
        if let Some(noise) = self.noise {
            let (upper, lower) = (y.pixel(noise), y.pixel(-noise));
            let _ = writeln!(
                out,
                "<rect class=\"noise\" x=\"{left}\" y=\"{upper:.1}\" width=\"{}\" height=\"{:.1}\"/>",
                width - left - right,
                lower - upper
            );
        }
        self.marks.iter().for_each(|mark| draw(&mut out, mark, &x, &y));
        out.push_str("</g></svg>\n");
        let _ = writeln!(
            out,
            "<rect class=\"frame\" x=\"{left}\" y=\"{top}\" width=\"{}\" height=\"{}\"/>",
            width - left - right,
            height - top - bottom
        );
        let _ = writeln!(
            out,
            "<text class=\"l\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text><text class=\"l\" transform=\"translate(14,{:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            (left + width - right) / 2.0,
            height - 8.0,
            escape(&self.labels.0),
            (top + height - bottom) / 2.0,
            escape(&self.labels.1)
        );
        self.legend(&mut out, width - right);
        out.push_str("</svg>\n");
        out
    }

    /// Names at the upper right, each behind a piece of its line.
    fn legend(&self, out: &mut String, end: f64) {
        let mut entries: Vec<(&str, &str)> = Vec::new();
        for entry in self.marks.iter().map(Mark::legend).filter(|entry| !entry.0.is_empty()) {
            if !entries.contains(&entry) {
                entries.push(entry);
            }
        }
        // A narrow chart has no room for it next to its title; the text around it says what is gray.
        if self.noise.is_some() && self.size.0 > 600.0 {
            entries.push(("sensor noise", "noise"));
        }
        let mut x = end;
        for (name, class) in entries.into_iter().rev() {
            x -= 7.2 * name.len() as f64;
            let shape = if class == "band" || class == "noise" {
                format!("<rect class=\"{class}\" x=\"{:.1}\" y=\"9\" width=\"22\" height=\"10\"/>", x - 28.0)
            } else {
                format!("<path class=\"{class}\" d=\"M{:.1} 14h22\"/>", x - 28.0)
            };
            let _ = writeln!(out, "{shape}<text class=\"k\" x=\"{x:.1}\" y=\"18\">{}</text>", escape(name));
            x -= 42.0;
        }
    }
}

/// Grid and ticks; the script replaces this group when it zooms.
fn axes(out: &mut String, x: &Axis, y: &Axis) {
    out.push_str("<g class=\"axes\">");
    for (value, label) in x.ticks(8) {
        let at = x.pixel(value);
        let _ = write!(
            out,
            "<path class=\"g\" d=\"M{at:.1} {:.1}V{:.1}\"/><text class=\"n\" x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{label}</text>",
            y.to,
            y.from,
            y.from + 16.0
        );
    }
    for (value, label) in y.ticks(5) {
        let at = y.pixel(value);
        let _ = write!(
            out,
            "<path class=\"g\" d=\"M{:.1} {at:.1}H{:.1}\"/><text class=\"n\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>",
            x.from,
            x.to,
            x.from - 6.0,
            at + 4.0
        );
    }
    out.push_str("</g>\n");
}

fn draw(out: &mut String, mark: &Mark, x: &Axis, y: &Axis) {
    let pixel = |(a, b): &(f64, f64)| (x.pixel(*a), y.pixel(*b));
    match mark {
        Mark::Line { name, class, points } => {
            let (a, b): (Vec<f64>, Vec<f64>) = points.iter().copied().unzip();
            // Half as many columns as pixels: a page of many records stays small.
            let coarse = Axis { to: x.from + 0.5 * (x.to - x.from), ..*x };
            let points: Vec<(f64, f64)> = curve(&a, &b, &coarse, y, false)
                .into_iter()
                .map(|(px, py)| (x.from + 2.0 * (px - x.from), py))
                .collect();
            let _ = writeln!(
                out,
                "<path class=\"{class}\" data-name=\"{}\" d=\"{}\"/>",
                escape(name),
                path(&points)
            );
        }
        Mark::Dots { name, class, points } => {
            let points: Vec<(f64, f64)> = points.iter().map(pixel).collect();
            let _ = writeln!(
                out,
                "<path class=\"{class}\" data-name=\"{}\" d=\"{}\"/>",
                escape(name),
                path(&points)
            );
            let dots: String = points.iter().map(|(a, b)| format!("M{a:.1} {b:.1}h0")).collect();
            let _ = writeln!(out, "<path class=\"{class} dots\" d=\"{dots}\"/>");
        }
        Mark::Band { points, .. } => {
            let lower = points.iter().map(|p| pixel(&(p.0, p.1)));
            let upper = points.iter().rev().map(|p| pixel(&(p.0, p.2)));
            let outline: Vec<(f64, f64)> = lower.chain(upper).collect();
            let _ = writeln!(out, "<path class=\"band\" d=\"{}z\"/>", path(&outline));
        }
    }
}

/// A line through points, relative and to a tenth of a pixel; errors do not add up.
fn path(points: &[(f64, f64)]) -> String {
    let mut text = String::with_capacity(points.len() * 8);
    let mut at = (0i64, 0i64);
    for (index, (px, py)) in points.iter().filter(|p| p.0.is_finite() && p.1.is_finite()).enumerate() {
        let next = ((px * 10.0).round() as i64, (py * 10.0).round() as i64);
        let (dx, dy) = (next.0 - at.0, next.1 - at.1);
        // Writing into a String cannot fail.
        let _ = match index {
            0 => write!(text, "M{} {}", tenth(next.0), tenth(next.1)),
            _ => write!(text, "l{} {}", tenth(dx), tenth(dy)),
        };
        at = next;
    }
    text
}

/// Tenths without a needless zero.
fn tenth(value: i64) -> String {
    if value % 10 == 0 {
        return (value / 10).to_string();
    }
    let sign = if value < 0 { "-" } else { "" };
    format!("{sign}{}.{}", value.abs() / 10, value.abs() % 10)
}

/// A row of a bar chart: label, value before and after.
pub type Row = (String, f64, f64);

/// Share of the reference of a bar chart up to which a value has no bar.
const MIN_SHARE_OF_REFERENCE: f64 = 0.03;

/// Two horizontal bars per row on a logarithmic axis, with a mark at `reference`.
pub fn bars(title: &str, rows: &[Row], (reference, name): (f64, &str), label: &str) -> String {
    let (width, left, right, top) = (920.0, 250.0, 74.0, 40.0);
    let height = top + 44.0 * rows.len() as f64 + 46.0;
    // Nothing and next to nothing have no bar.
    let least = MIN_SHARE_OF_REFERENCE * reference;
    let positive = |value: f64| if value.is_finite() { value.max(least) } else { reference };
    let values = rows.iter().flat_map(|row| [row.1, row.2]).map(positive).chain([reference]);
    let (low, high) = range(values.map(f64::log10));
    let begin = (low - 0.15).max(least.log10());
    let x = Axis::new((begin, high.max(low + 0.7) + 0.1), (left, width - right));
    let mut out = format!(
        "<svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{0}\">\n<text class=\"t\" x=\"14\" y=\"18\">{0}</text>\n",
        escape(title)
    );
    let bottom = height - 46.0;
    // Writing into a String cannot fail.
    for (value, label) in x.log_ticks(8) {
        let at = x.pixel(value);
        let _ = writeln!(
            out,
            "<path class=\"g\" d=\"M{at:.1} {top}V{bottom}\"/><text class=\"n\" x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{label}</text>",
            bottom + 16.0
        );
    }
    for (index, (name, before, after)) in rows.iter().enumerate() {
        let y = top + 44.0 * index as f64 + 6.0;
        let _ = writeln!(
            out,
            "<text class=\"k\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            left - 10.0,
            y + 20.0,
            escape(name)
        );
        for (offset, value, class) in [(0.0, *before, "before"), (16.0, *after, "after")] {
            let end = x.pixel(positive(value).log10());
            let _ = writeln!(
                out,
                "<rect class=\"{class}\" x=\"{left}\" y=\"{:.1}\" width=\"{:.1}\" height=\"13\"/><text class=\"n\" x=\"{:.1}\" y=\"{:.1}\">{}</text>",
                y + offset,
                end - left,
                end + 5.0,
                y + offset + 11.0,
                short(value)
            );
        }
    }
    let at = x.pixel(reference.log10());
    let _ = writeln!(
        out,
        "<path class=\"limit\" d=\"M{at:.1} {:.1}V{bottom}\"/><text class=\"n\" x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
        top - 4.0,
        top - 8.0,
        escape(name)
    );
    let _ = writeln!(
        out,
        "<rect class=\"before\" x=\"{0}\" y=\"8\" width=\"22\" height=\"10\"/><text class=\"k\" x=\"{1}\" y=\"18\">before</text><rect class=\"after\" x=\"{2}\" y=\"8\" width=\"22\" height=\"10\"/><text class=\"k\" x=\"{3}\" y=\"18\">after</text>",
        width - 200.0,
        width - 172.0,
        width - 100.0,
        width - 72.0
    );
    let _ = writeln!(
        out,
        "<text class=\"l\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>\n</svg>",
        (left + width - right) / 2.0,
        height - 8.0,
        escape(label)
    );
    out
}

/// A number with three significant digits.
pub fn short(value: f64) -> String {
    match value.abs() {
        v if !v.is_finite() => "-".into(),
        v if v >= 1e6 => format!("{value:.2e}"),
        v if v >= 100.0 => format!("{value:.0}"),
        v if v >= 10.0 => format!("{value:.1}"),
        _ => format!("{value:.2}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_relative_path_ends_where_the_points_end() {
        let points: Vec<(f64, f64)> =
            (0..1000).map(|k| (0.333 * f64::from(k), 50.0 + 0.07 * f64::from(k))).collect();
        let text = path(&points);
        let (mut x, mut y) = (0.0, 0.0);
        for pair in text.trim_start_matches('M').split('l') {
            let (a, b) = pair.split_once(' ').unwrap();
            x += a.parse::<f64>().unwrap();
            y += b.parse::<f64>().unwrap();
        }
        assert!((x - 332.667).abs() < 0.051 && (y - 119.93).abs() < 0.051, "{x} {y}");
        assert_eq!((tenth(-3), tenth(-20), tenth(125)), ("-0.3".into(), "-2".into(), "12.5".into()));
    }
}
