//! Fit against order, one line per family of models.

use super::panel::{Entry, Scale, Sheet, solid};
use crate::plot::axes::range;
use crate::plot::svg::{Anchor, Shape};

/// Fit of the model of one order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OrderFit {
    /// Order.
    pub order: usize,
    /// NRMSE fit \[%\]; `None` for an unstable model or where there is none.
    pub fit: Option<f64>,
    /// Whether the model is stable.
    pub stable: bool,
}

/// Models of one kind and rising order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Family<'a> {
    /// Text of the legend.
    pub name: &'a str,
    /// Fits, one per order.
    pub fits: &'a [OrderFit],
}

/// Fit against order. Unstable models are marked at the lower edge and break the line; they have no fit. Fits below the
/// range that the better half of all models spans are drawn on the lower edge.
pub fn fit_against_order(title: &str, note: &str, families: &[Family]) -> String {
    let shapes = [Shape::Circle, Shape::Square, Shape::Triangle];
    let classes: Vec<String> =
        (0..families.len()).map(|index| format!("s{} d{}", index % 6, index % 4)).collect();
    let mut legend: Vec<Entry> = families
        .iter()
        .zip(&classes)
        .enumerate()
        .map(|(index, (family, class))| Entry { class, shape: Some(shapes[index % 3]), text: family.name })
        .collect();
    let all = || families.iter().flat_map(|family| family.fits);
    let unstable = all().any(|of| !of.stable);
    if unstable {
        legend.push(Entry { class: "beyond", shape: Some(Shape::Cross), text: "unstable, no fit" });
    }
    let mut sheet = Sheet::new(title, note, &legend, 1, 1, 340.0);
    let mut fits: Vec<f64> = all().filter(|of| of.stable).filter_map(|of| of.fit).collect();
    fits.sort_by(f64::total_cmp);
    let (min, max) = range(fits.iter().copied());
    let (min, max) = if min.is_finite() { (min, max) } else { (0.0, 100.0) };
    let middle = fits.get(fits.len() / 2).copied().unwrap_or(min);
    let low = f64::max(min, middle - 4.0 * f64::max(max - middle, 2.0));
    let pad = f64::max(0.08 * (max - low), 0.2);
    let orders = range(all().map(|of| of.order as f64));
    let orders = if orders.0.is_finite() { orders } else { (1.0, 2.0) };
    let panel = sheet.panel(
        0,
        "",
        ((orders.0 - 0.4, orders.1 + 0.4), Scale::Linear, "order"),
        ((low - 2.0 * pad, max + pad), Scale::Linear, "fit [%]"),
    );
    let svg = &mut sheet.svg;
    // Families side by side where they have the same fit, or none.
    let aside = |index: usize| 0.06 * (index as f64 - 0.5 * (families.len() as f64 - 1.0));
    for (index, (family, class)) in families.iter().zip(&classes).enumerate() {
        let mut line: Vec<(f64, f64)> = Vec::new();
        let mut marks = Vec::new();
        for of in family.fits {
            let x = of.order as f64 + aside(index);
            match of.fit.filter(|_| of.stable) {
                Some(fit) => {
                    let at = panel.at(x, fit);
                    line.push(at);
                    marks.push(at);
                    if fit < low - 2.0 * pad {
                        svg.text((at.0 + 7.0, at.1 - 6.0), Anchor::Start, "tick", &format!("{fit:.0}"));
                    }
                }
                None => {
                    svg.polyline(&std::mem::take(&mut line), class);
                    if !of.stable {
                        let (x, y) = panel.at(x, f64::NEG_INFINITY);
                        svg.marker(Shape::Cross, (x, y - 9.0), 5.0, "beyond");
                        // The shape of the family tells whose cross it is.
                        svg.marker(shapes[index % 3], (x, y - 9.0), 8.0, solid(class));
                    }
                }
            }
        }
        svg.polyline(&line, class);
        for at in marks {
            svg.marker(shapes[index % 3], at, 4.0, &format!("{} open", solid(class)));
        }
    }
    sheet.svg.finish(title)
}
