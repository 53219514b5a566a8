//! Poles and zeros in the z plane.

use super::panel::{Entry, Scale, Sheet, WIDTH};
use crate::plot::svg::Shape;
use airloop_ident::diagnostics::{ChannelZeros, Root};

/// Poles (crosses) and zeros of every channel (circles, squares, triangles) with the unit circle; next to the whole,
/// the part around the slow poles, where sampled models crowd.
pub fn pole_zero_map(poles: &[Root], channels: &[ChannelZeros]) -> String {
    let names: Vec<String> =
        channels.iter().map(|of| format!("zeros {} to {}", of.input, of.output)).collect();
    let style = |index: usize| {
        let shape = [Shape::Circle, Shape::Square, Shape::Triangle][index % 3];
        (shape, format!("s{}", [0, 2, 3, 4, 5][index % 5]))
    };
    let classes: Vec<String> = (0..channels.len()).map(|index| style(index).1).collect();
    let mut legend = vec![Entry { class: "residual", shape: Some(Shape::Cross), text: "poles" }];
    for (index, name) in names.iter().enumerate() {
        legend.push(Entry { class: &classes[index], shape: Some(style(index).0), text: name });
    }
    let height = 0.5 * WIDTH - 104.0;
    let mut sheet = Sheet::new("Poles and zeros", "", &legend, 2, 2, height);
    // A zero far out would make everything else a dot; it is drawn on the edge.
    let reach = poles.iter().map(|pole| pole.modulus).fold(1.0, f64::max).min(2.0) * 1.15;
    let slow = close_up(poles);
    let views =
        [("whole (outer zeros on the edge)", (0.0, 0.0), reach), ("around the slow poles", slow.0, slow.1)];
    for (index, (title, (re, im), half)) in views.into_iter().enumerate() {
        let panel = sheet.panel(
            index,
            title,
            ((re - half, re + half), Scale::Linear, "real part"),
            ((im - half, im + half), Scale::Linear, "imaginary part"),
        );
        let svg = &mut sheet.svg;
        panel.level(svg, 0.0, "zero");
        // The part of the circle that the panel shows.
        let step = std::f64::consts::TAU / 1440.0;
        let mut arc: Vec<(f64, f64)> = Vec::new();
        for k in 0..=1440 {
            let (y, x) = (step * f64::from(k)).sin_cos();
            if (x - re).abs() <= half && (y - im).abs() <= half {
                arc.push(panel.at(x, y));
            } else if !arc.is_empty() {
                svg.polyline(&std::mem::take(&mut arc), "ring");
            }
        }
        svg.polyline(&arc, "ring");
        let shown =
            |root: &Root| index == 0 || ((root.re - re).abs() <= half && (root.im - im).abs() <= half);
        for (channel, of) in channels.iter().enumerate() {
            for zero in of.zeros.iter().filter(|zero| shown(zero)) {
                svg.marker(style(channel).0, panel.at(zero.re, zero.im), 5.5, &classes[channel]);
            }
        }
        for pole in poles.iter().filter(|pole| shown(pole)) {
            svg.marker(Shape::Cross, panel.at(pole.re, pole.im), 5.0, "beyond");
        }
    }
    sheet.svg.finish("Poles and zeros in the z plane with the unit circle")
}

/// Center and half width of a square around the poles whose modulus is above 0.7, the point 1 included.
fn close_up(poles: &[Root]) -> ((f64, f64), f64) {
    let slow: Vec<&Root> = poles.iter().filter(|pole| pole.modulus > 0.7 && pole.re > 0.0).collect();
    let left = slow.iter().map(|pole| pole.re).fold(1.0, f64::min);
    let high = slow.iter().map(|pole| pole.im.abs()).fold(0.0, f64::max);
    let right = slow.iter().map(|pole| pole.re).fold(1.0, f64::max);
    let half = f64::max(0.5 * (right - left), high).max(0.004) * 1.35;
    ((0.5 * (left + right), 0.0), half)
}
