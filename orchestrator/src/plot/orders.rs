//! Figures about the order of a model: fit against order (Fig. 5), singular values, poles.

use super::axes::{Axis, range};
use super::svg::{Anchor, SERIES_CLASSES, Svg};

const WIDTH: f64 = 760.0;
const LEFT: f64 = 74.0;
const RIGHT: f64 = 24.0;
const TOP: f64 = 52.0;
const HEIGHT: f64 = 300.0;
const BOTTOM: f64 = 52.0;
/// Width of a letter of a legend, in pixels.
const LETTER: f64 = 7.2;
/// Most singular values drawn.
const MOST_VALUES: usize = 30;

/// Fits \[%\] of one family of models by order; `None`: unstable, or no model.
#[derive(Debug, Clone, PartialEq)]
pub struct OrderCurve {
    /// Name in the legend.
    pub name: String,
    /// Order and fit.
    pub fits: Vec<(usize, Option<f64>)>,
}

/// Fit against order, a curve for each family. Unstable models are a cross below the plot, without a number.
pub fn fits(title: &str, curves: &[OrderCurve]) -> String {
    let orders = curves.iter().flat_map(|curve| curve.fits.iter().map(|fit| fit.0 as f64));
    let (first, last) = range(orders);
    let x = Axis::new((first, last), (LEFT, WIDTH - RIGHT)).padded(0.04);
    // Fits far below zero would flatten all others.
    let shown = |fit: f64| fit.max(0.0);
    let values = curves.iter().flat_map(|curve| curve.fits.iter().filter_map(|fit| fit.1).map(shown));
    let y = Axis::new(range(values), (TOP + HEIGHT, TOP)).padded(0.1);
    let lost = curves.iter().any(|curve| curve.fits.iter().any(|fit| fit.1.is_none()));
    let room = if lost { 24.0 } else { 0.0 };
    let mut svg = Svg::new(WIDTH, TOP + HEIGHT + room + BOTTOM);
    svg.text((LEFT, 24.0), Anchor::Start, "title", title);
    let bottom = TOP + HEIGHT + room;
    for order in first as usize..=last as usize {
        let at = x.pixel(order as f64);
        svg.line((at, TOP), (at, bottom), "grid");
        svg.text((at, bottom + 18.0), Anchor::Middle, "tick", &order.to_string());
    }
    vertical_axis(&mut svg, &y, "simulated fit [%]");
    svg.text((0.5 * (x.from + x.to), bottom + 38.0), Anchor::Middle, "label", "order");
    let mut right = WIDTH - RIGHT;
    for (index, curve) in curves.iter().enumerate().rev() {
        let class = format!("s{}", index % SERIES_CLASSES);
        let points = |wanted: &[(usize, Option<f64>)]| -> Vec<(f64, f64)> {
            wanted.iter().filter_map(|fit| Some((x.pixel(fit.0 as f64), y.pixel(shown(fit.1?))))).collect()
        };
        // A gap where there is no fit.
        for stretch in curve.fits.split(|fit| fit.1.is_none()) {
            svg.polyline(&points(stretch), &class);
        }
        for at in points(&curve.fits) {
            marker(&mut svg, at, index, &class);
        }
        for (order, _) in curve.fits.iter().filter(|fit| fit.1.is_none()) {
            // Side by side when several families have none.
            let shift = 10.0 * (index as f64 - 0.5 * (curves.len() - 1) as f64);
            cross(&mut svg, (x.pixel(*order as f64) + shift, TOP + HEIGHT + 13.0), &class);
        }
        let width = LETTER * curve.name.chars().count() as f64;
        svg.text((right - width, 24.0), Anchor::Start, "legend", &curve.name);
        svg.line((right - width - 30.0, 20.0), (right - width - 6.0, 20.0), &class);
        marker(&mut svg, (right - width - 18.0, 20.0), index, &class);
        right -= width + 46.0;
    }
    if lost {
        svg.line((LEFT, TOP + HEIGHT), (WIDTH - RIGHT, TOP + HEIGHT), "zero");
        svg.text((LEFT - 8.0, TOP + HEIGHT + 17.0), Anchor::End, "tick", "unstable");
    }
    svg.finish(title)
}

/// Singular values on a logarithmic axis, those of the order taken apart from the others.
pub fn singular_values(values: &[f64], order: usize) -> String {
    let title = "Singular values of the weighted projection";
    let values: Vec<f64> =
        values.iter().copied().take(MOST_VALUES.max(order + 1)).take_while(|value| *value > 0.0).collect();
    let logs: Vec<f64> = values.iter().map(|value| value.log10()).collect();
    let y = Axis::new(range(logs.iter().copied()), (TOP + HEIGHT, TOP)).padded(0.06);
    let x = Axis::new((0.4, values.len() as f64 + 0.6), (LEFT, WIDTH - RIGHT));
    let mut svg = Svg::new(WIDTH, TOP + HEIGHT + BOTTOM);
    svg.text((LEFT, 24.0), Anchor::Start, "title", title);
    let (lowest, highest) = (y.min.ceil() as i32, y.max.floor() as i32);
    let every = ((highest - lowest) / 8 + 1) as usize;
    for power in (lowest..=highest).step_by(every) {
        let at = y.pixel(f64::from(power));
        svg.line((LEFT, at), (WIDTH - RIGHT, at), "grid");
        svg.text((LEFT - 8.0, at + 4.0), Anchor::End, "tick", &format!("1e{power}"));
    }
    svg.frame(x.from, y.to, x.to - x.from, y.from - y.to);
    let step = if values.len() > 15 { 5 } else { 1 };
    for (index, log) in logs.iter().enumerate() {
        let at = x.pixel((index + 1) as f64);
        let class = if index < order { "s0" } else { "s1" };
        svg.line((at, y.from), (at, y.pixel(*log)), class);
        marker(&mut svg, (at, y.pixel(*log)), usize::from(index >= order), class);
        if (index + 1) % step == 0 || index == 0 {
            svg.text((at, y.from + 18.0), Anchor::Middle, "tick", &(index + 1).to_string());
        }
    }
    svg.text((0.5 * (x.from + x.to), y.from + 38.0), Anchor::Middle, "label", "number");
    svg.text_upwards((20.0, 0.5 * (y.from + y.to)), "label", "singular value");
    let note = format!("diamonds: order {order}; squares: left out");
    svg.text((WIDTH - RIGHT, 24.0), Anchor::End, "note", &note);
    svg.finish(title)
}

/// Poles (real and imaginary part) in the z plane with the unit circle.
pub fn poles(poles: &[(f64, f64)]) -> String {
    let title = "Poles";
    let side = 360.0;
    let far = poles.iter().flat_map(|pole| [pole.0.abs(), pole.1.abs()]).fold(1.0, f64::max).min(5.0) * 1.08;
    let x = Axis::new((-far, far), (LEFT, LEFT + side));
    let y = Axis::new((-far, far), (TOP + side, TOP));
    let mut svg = Svg::new(LEFT + side + RIGHT, TOP + side + BOTTOM);
    svg.text((LEFT, 24.0), Anchor::Start, "title", title);
    svg.text((LEFT + 60.0, 24.0), Anchor::Start, "note", "in the z plane, with the unit circle");
    for (value, text) in x.ticks(5) {
        let at = x.pixel(value);
        svg.line((at, y.from), (at, y.to), "grid");
        svg.text((at, y.from + 18.0), Anchor::Middle, "tick", &text);
    }
    vertical_axis_to(&mut svg, &y, "imaginary part", LEFT + side);
    svg.text((0.5 * (x.from + x.to), y.from + 38.0), Anchor::Middle, "label", "real part");
    let circle: Vec<(f64, f64)> = (0..=120)
        .map(|k| (std::f64::consts::TAU * f64::from(k) / 120.0).sin_cos())
        .map(|(s, c)| (x.pixel(c), y.pixel(s)))
        .collect();
    svg.polyline(&circle, "zero");
    for pole in poles {
        let class = if pole.0.hypot(pole.1) < 1.0 { "s0" } else { "s1" };
        cross(&mut svg, (x.pixel(pole.0.clamp(-far, far)), y.pixel(pole.1.clamp(-far, far))), class);
    }
    svg.finish(title)
}

fn vertical_axis(svg: &mut Svg, y: &Axis, label: &str) {
    vertical_axis_to(svg, y, label, WIDTH - RIGHT);
}

fn vertical_axis_to(svg: &mut Svg, y: &Axis, label: &str, right: f64) {
    for (value, text) in y.ticks(6) {
        let at = y.pixel(value);
        svg.line((LEFT, at), (right, at), "grid");
        svg.text((LEFT - 8.0, at + 4.0), Anchor::End, "tick", &text);
    }
    svg.frame(LEFT, y.to, right - LEFT, y.from - y.to);
    svg.text_upwards((20.0, 0.5 * (y.from + y.to)), "label", label);
}

/// A diamond or a square, so that curves differ without colour.
fn marker(svg: &mut Svg, (x, y): (f64, f64), index: usize, class: &str) {
    let r = 4.0;
    let corners = if index.is_multiple_of(2) {
        [(x, y - r), (x + r, y), (x, y + r), (x - r, y), (x, y - r)]
    } else {
        let r = 3.2;
        [(x - r, y - r), (x + r, y - r), (x + r, y + r), (x - r, y + r), (x - r, y - r)]
    };
    svg.polyline(&corners, class);
}

fn cross(svg: &mut Svg, (x, y): (f64, f64), class: &str) {
    let r = 4.5;
    svg.line((x - r, y - r), (x + r, y + r), class);
    svg.line((x - r, y + r), (x + r, y - r), class);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unstable_order_is_a_cross_and_no_number() {
        let curve =
            OrderCurve { name: "ARX".into(), fits: vec![(1, Some(87.0)), (2, None), (3, Some(88.0))] };
        let svg = fits("Fit", &[curve]);
        assert!(svg.contains("unstable") && !svg.contains("NaN"));
        let stable = OrderCurve { name: "ARX".into(), fits: vec![(1, Some(87.0)), (2, Some(88.0))] };
        assert!(!fits("Fit", &[stable]).contains("unstable"));
    }

    #[test]
    fn exact_data_end_the_singular_values_at_zero() {
        let svg = singular_values(&[3.0, 1.0, 1e-14, 0.0, 0.0], 2);
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }
}
