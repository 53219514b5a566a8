//! Measured points with a curve and its band, such as friction force against velocity.

use super::panel::{Entry, Scale, Sheet};
use crate::plot::axes::range;
use crate::plot::svg::Shape;

/// Points and a curve.
#[derive(Debug, Clone, Copy)]
pub struct Scatter<'a> {
    /// Heading.
    pub title: &'a str,
    /// Note next to the heading.
    pub note: &'a str,
    /// Label of the horizontal axis with its unit.
    pub x_label: &'a str,
    /// Label of the vertical axis with its unit.
    pub y_label: &'a str,
    /// Measured points, shape \[n\] each.
    pub points: (&'a [f64], &'a [f64]),
    /// Curve, shape \[m\] each.
    pub curve: (&'a [f64], &'a [f64]),
    /// Half width of the 95 % band around the curve, shape \[m\]; empty for none.
    pub band: &'a [f64],
}

/// Cells of the raster on which points that fall together are drawn once.
const CELL: f64 = 2.0;

/// The figure; many points become at most one per cell of two pixels, so that a long record stays a small file.
pub fn scatter(figure: &Scatter) -> String {
    let mut legend = vec![
        Entry { class: "faint", shape: Some(Shape::Circle), text: "measured" },
        Entry { class: "s0", shape: None, text: "model" },
    ];
    if !figure.band.is_empty() {
        legend.push(Entry { class: "band", shape: None, text: "95 % band" });
    }
    let mut sheet = Sheet::new(figure.title, figure.note, &legend, 1, 1, 380.0);
    let limits = |points: &[f64], curve: &[f64]| {
        let (min, max) = range(points.iter().chain(curve).copied());
        let pad = 0.05 * (max - min);
        (min - pad, max + pad)
    };
    let panel = sheet.panel(
        0,
        "",
        (limits(figure.points.0, figure.curve.0), Scale::Linear, figure.x_label),
        (limits(figure.points.1, figure.curve.1), Scale::Linear, figure.y_label),
    );
    let finite = figure.points.0.iter().zip(figure.points.1).filter(|(x, y)| x.is_finite() && y.is_finite());
    let cells: std::collections::BTreeSet<(i64, i64)> = finite
        .map(|(x, y)| panel.at(*x, *y))
        .map(|(x, y)| ((x / CELL).round() as i64, (y / CELL).round() as i64))
        .collect();
    for (x, y) in cells {
        sheet.svg.marker(Shape::Circle, (CELL * x as f64, CELL * y as f64), 2.0, "faint");
    }
    let (x, y) = figure.curve;
    if !figure.band.is_empty() {
        let edge =
            |sign: f64| -> Vec<f64> { y.iter().zip(figure.band).map(|(y, half)| y + sign * half).collect() };
        panel.band(&mut sheet.svg, x, &edge(-1.0), &edge(1.0));
    }
    panel.line(&mut sheet.svg, x, y, "s0");
    sheet.svg.finish(figure.title)
}
