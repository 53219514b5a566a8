//! Figure of an effect that is written as a formula: its value over one variable of the port.

use super::axes::{Axis, range};
use super::svg::{Anchor, Svg};

const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 320.0;
const LEFT: f64 = 84.0;
const RIGHT: f64 = 20.0;
const TOP: f64 = 46.0;
const BOTTOM: f64 = 50.0;

/// Value of a formula along points (variable, value), with the labels of both axes; a figure as SVG.
pub fn curve(points: &[(f64, f64)], title: &str, (over, value): (&str, &str)) -> String {
    let mut svg = Svg::new(WIDTH, TOP + HEIGHT + BOTTOM);
    let x = Axis::new(range(points.iter().map(|p| p.0)), (LEFT, WIDTH - RIGHT)).padded(0.02);
    let (low, high) = range(points.iter().map(|p| p.1));
    let y = Axis::new((low.min(0.0), high.max(0.0)), (TOP + HEIGHT, TOP)).padded(0.05);
    for (value, text) in x.ticks(9) {
        let at = x.pixel(value);
        svg.line((at, y.from), (at, y.to), "grid");
        svg.text((at, y.from + 18.0), Anchor::Middle, "tick", &text);
    }
    for (value, text) in y.ticks(6) {
        let at = y.pixel(value);
        svg.line((x.from, at), (x.to, at), "grid");
        svg.text((x.from - 8.0, at + 4.0), Anchor::End, "tick", &text);
    }
    svg.frame(x.from, y.to, x.to - x.from, y.from - y.to);
    svg.line((x.from, y.pixel(0.0)), (x.to, y.pixel(0.0)), "zero");
    let line: Vec<(f64, f64)> = points.iter().map(|(a, b)| (x.pixel(*a), y.pixel(*b))).collect();
    svg.polyline(&line, "simulated");
    svg.text((LEFT, 24.0), Anchor::Start, "title", title);
    svg.text_upwards((20.0, 0.5 * (y.from + y.to)), "label", value);
    svg.text((0.5 * (x.from + x.to), y.from + 38.0), Anchor::Middle, "label", over);
    svg.finish(title)
}
