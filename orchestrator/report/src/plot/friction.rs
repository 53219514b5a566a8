//! Figures of friction: force over velocity with the model, and the residual.

use super::axes::{Axis, range};
use super::svg::{Anchor, Svg};

/// A point of the model: velocity, force, half the width of its band.
pub type ModelPoint = (f64, f64, f64);

const WIDTH: f64 = 960.0;
const LEFT: f64 = 84.0;
const RIGHT: f64 = 20.0;
const TOP: f64 = 46.0;
const BOTTOM: f64 = 50.0;

/// Measured forces \[N\] over velocities \[m/s\] as dots, the model as a line with its 95 % band.
pub fn force_velocity(measured: &[(f64, f64)], model: &[ModelPoint], note: &str) -> String {
    let height = 380.0;
    let mut svg = Svg::new(WIDTH, TOP + height + BOTTOM);
    let velocities = measured.iter().map(|p| p.0).chain(model.iter().map(|p| p.0));
    let forces = measured.iter().map(|p| p.1).chain(model.iter().map(|p| p.1));
    let x = Axis::new(range(velocities), (LEFT, WIDTH - RIGHT)).padded(0.02);
    let y = Axis::new(range(forces), (TOP + height, TOP)).padded(0.05);
    frame(&mut svg, &x, &y, "friction force [N]");
    svg.dots(&pixels(measured, &x, &y), "dots");
    let line = |sign: f64| -> Vec<(f64, f64)> {
        model.iter().map(|(v, f, half)| (x.pixel(*v), y.pixel(f + sign * half))).collect()
    };
    svg.polyline(&line(1.0), "s5");
    svg.polyline(&line(-1.0), "s5");
    svg.polyline(&line(0.0), "simulated");
    title(&mut svg, "Friction", note);
    svg.finish("friction force over velocity: measured, model, 95 % band")
}

/// Residual of the model over velocity, as dots.
pub fn residual(left: &[(f64, f64)], note: &str) -> String {
    let height = 240.0;
    let mut svg = Svg::new(WIDTH, TOP + height + BOTTOM);
    let x = Axis::new(range(left.iter().map(|p| p.0)), (LEFT, WIDTH - RIGHT)).padded(0.02);
    let (low, high) = range(left.iter().map(|p| p.1));
    let y = Axis::new((low.min(0.0), high.max(0.0)), (TOP + height, TOP)).padded(0.05);
    frame(&mut svg, &x, &y, "residual [N]");
    svg.line((x.from, y.pixel(0.0)), (x.to, y.pixel(0.0)), "zero");
    svg.dots(&pixels(left, &x, &y), "dots");
    title(&mut svg, "Measured \u{2212} model", note);
    svg.finish("residual force over velocity")
}

fn pixels(points: &[(f64, f64)], x: &Axis, y: &Axis) -> Vec<(f64, f64)> {
    points.iter().map(|(v, f)| (x.pixel(*v), y.pixel(*f))).collect()
}

fn title(svg: &mut Svg, name: &str, note: &str) {
    svg.text((LEFT, 24.0), Anchor::Start, "title", name);
    svg.text((LEFT + 18.0 + 10.5 * name.chars().count() as f64, 24.0), Anchor::Start, "note", note);
}

fn frame(svg: &mut Svg, x: &Axis, y: &Axis, label: &str) {
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
    svg.text_upwards((20.0, 0.5 * (y.from + y.to)), "label", label);
    svg.text((0.5 * (x.from + x.to), y.from + 38.0), Anchor::Middle, "label", "velocity [m/s]");
}
