//! Singular values of a subspace projection: which of them carry the model.

use super::axes::{Axis, range};
use super::svg::{Anchor, Svg};

const WIDTH: f64 = 760.0;
const LEFT: f64 = 74.0;
const RIGHT: f64 = 24.0;
const TOP: f64 = 52.0;
const HEIGHT: f64 = 300.0;
const BOTTOM: f64 = 52.0;
/// Most singular values drawn.
const MAX_VALUES_SHOWN: usize = 30;

/// Singular values on a logarithmic axis, those of the order (diamonds) apart from the others (squares).
pub fn singular_values(values: &[f64], order: usize) -> String {
    let title = "Singular values of the weighted projection";
    let values =
        values.iter().copied().take(MAX_VALUES_SHOWN.max(order + 1)).take_while(|value| *value > 0.0);
    let logs: Vec<f64> = values.map(f64::log10).collect();
    let y = Axis::new(range(logs.iter().copied()), (TOP + HEIGHT, TOP)).padded(0.06);
    let x = Axis::new((0.4, logs.len() as f64 + 0.6), (LEFT, WIDTH - RIGHT));
    let mut svg = Svg::new(WIDTH, TOP + HEIGHT + BOTTOM);
    svg.text((LEFT, 24.0), Anchor::Start, "title", title);
    let note = format!("diamonds: order {order}; squares: left out");
    svg.text((WIDTH - RIGHT, 24.0), Anchor::End, "note", &note);
    let (lowest, highest) = (y.min.ceil() as i32, y.max.floor() as i32);
    for power in (lowest..=highest).step_by(((highest - lowest) / 8 + 1).max(1) as usize) {
        let at = y.pixel(f64::from(power));
        svg.line((LEFT, at), (WIDTH - RIGHT, at), "grid");
        svg.text((LEFT - 8.0, at + 4.0), Anchor::End, "tick", &format!("1e{power}"));
    }
    svg.frame(x.from, y.to, x.to - x.from, y.from - y.to);
    let every = if logs.len() > 15 { 5 } else { 1 };
    for (index, log) in logs.iter().enumerate() {
        let at = (x.pixel((index + 1) as f64), y.pixel(*log));
        let taken = index < order;
        svg.line((at.0, y.from), at, if taken { "s0" } else { "s1" });
        marker(&mut svg, at, taken);
        if (index + 1) % every == 0 || index == 0 {
            svg.text((at.0, y.from + 18.0), Anchor::Middle, "tick", &(index + 1).to_string());
        }
    }
    svg.text((0.5 * (x.from + x.to), y.from + 38.0), Anchor::Middle, "label", "number");
    svg.text_upwards((20.0, 0.5 * (y.from + y.to)), "label", "singular value");
    svg.finish(title)
}

/// A diamond or a square, told apart without color.
fn marker(svg: &mut Svg, (x, y): (f64, f64), taken: bool) {
    let r = if taken { 4.5 } else { 3.2 };
    if taken {
        svg.polyline(&[(x, y - r), (x + r, y), (x, y + r), (x - r, y), (x, y - r)], "s0");
    } else {
        svg.polyline(&[(x - r, y - r), (x + r, y - r), (x + r, y + r), (x - r, y + r), (x - r, y - r)], "s1");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_data_end_the_singular_values_at_zero() {
        let svg = singular_values(&[3.0, 1.0, 1e-14, 0.0, 0.0], 2);
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
        assert!(singular_values(&[], 1).contains("</svg>"));
    }
}
