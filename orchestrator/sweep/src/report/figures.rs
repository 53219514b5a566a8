//! Figures of a sweep.

use airloop_report::plot::axes::{Axis, range};
use airloop_report::plot::svg::{Anchor, Svg};

const WIDTH: f64 = 760.0;
const LEFT: f64 = 220.0;
const RIGHT: f64 = 40.0;
const TOP: f64 = 46.0;
const BOTTOM: f64 = 50.0;
/// Height of a bar with its gap \[px\].
const BAR: f64 = 26.0;
/// Height of the bar of a task with its gap \[px\].
const TASK_BAR: f64 = 14.0;
/// Height of a scatter figure \[px\].
const HEIGHT: f64 = 300.0;

/// Rank correlation of a quantity with every factor, the strongest on top.
pub fn tornado(quantity: &str, bars: &[(&str, f64)]) -> String {
    let bottom = TOP + BAR * bars.len() as f64;
    let mut svg = Svg::new(WIDTH, bottom + BOTTOM);
    let x = Axis::new((-1.0, 1.0), (LEFT, WIDTH - RIGHT));
    for (value, text) in x.ticks(5) {
        svg.line((x.pixel(value), TOP), (x.pixel(value), bottom), "grid");
        svg.text((x.pixel(value), bottom + 18.0), Anchor::Middle, "tick", &text);
    }
    for (index, (factor, value)) in bars.iter().enumerate() {
        bar(&mut svg, (index, BAR), factor, (x.pixel(0.0), x.pixel(*value)));
    }
    svg.line((x.pixel(0.0), TOP), (x.pixel(0.0), bottom), "zero");
    let title = format!("{quantity}: influence of the factors");
    svg.text((14.0, 24.0), Anchor::Start, "title", &title);
    svg.text((0.5 * (x.from + x.to), bottom + 38.0), Anchor::Middle, "label", "rank correlation (Spearman)");
    svg.finish(&title)
}

/// A quantity over the factor that moves it most.
pub fn scatter(points: &[(f64, f64)], (factor, quantity): (&str, &str)) -> String {
    let mut svg = Svg::new(WIDTH, TOP + HEIGHT + BOTTOM);
    let x = Axis::new(range(points.iter().map(|p| p.0)), (84.0, WIDTH - RIGHT)).padded(0.02);
    let y = Axis::new(range(points.iter().map(|p| p.1)), (TOP + HEIGHT, TOP)).padded(0.05);
    for (value, text) in x.ticks(9) {
        svg.line((x.pixel(value), y.from), (x.pixel(value), y.to), "grid");
        svg.text((x.pixel(value), y.from + 18.0), Anchor::Middle, "tick", &text);
    }
    for (value, text) in y.ticks(6) {
        svg.line((x.from, y.pixel(value)), (x.to, y.pixel(value)), "grid");
        svg.text((x.from - 8.0, y.pixel(value) + 4.0), Anchor::End, "tick", &text);
    }
    svg.frame(x.from, y.to, x.to - x.from, y.from - y.to);
    let dots: Vec<(f64, f64)> = points.iter().map(|(a, b)| (x.pixel(*a), y.pixel(*b))).collect();
    svg.dots(&dots, "dots s0");
    let title = format!("{quantity} over {factor}");
    svg.text((14.0, 24.0), Anchor::Start, "title", &title);
    svg.text((0.5 * (x.from + x.to), y.from + 38.0), Anchor::Middle, "label", factor);
    svg.text_upwards((20.0, 0.5 * (y.from + y.to)), "label", quantity);
    svg.finish(&title)
}

/// Number of tasks of each kind, as bars with their numbers.
pub fn counts(name: &str, bars: &[(&str, usize)]) -> String {
    let bottom = TOP + BAR * bars.len() as f64;
    let mut svg = Svg::new(WIDTH, bottom + BOTTOM);
    let most = bars.iter().map(|(_, count)| *count).max().unwrap_or(1);
    // Room for the number at the end of the longest bar.
    let x = Axis::new((0.0, 1.08 * most as f64), (LEFT, WIDTH - RIGHT));
    for (index, (text, count)) in bars.iter().enumerate() {
        let end = bar(&mut svg, (index, BAR), text, (x.pixel(0.0), x.pixel(*count as f64)));
        svg.text((end.0 + 6.0, end.1), Anchor::Start, "tick", &count.to_string());
    }
    svg.line((x.pixel(0.0), TOP), (x.pixel(0.0), bottom), "zero");
    let title = format!("{name}: number of tasks");
    svg.text((14.0, 24.0), Anchor::Start, "title", &title);
    svg.finish(&title)
}

/// A quantity of every task, the largest on top, as bars with the names of the tasks.
pub fn per_task(quantity: &str, bars: &[(String, f64)]) -> String {
    let bottom = TOP + TASK_BAR * bars.len() as f64;
    let mut svg = Svg::new(WIDTH, bottom + BOTTOM);
    let (low, high) = range(bars.iter().map(|(_, value)| *value).chain([0.0]));
    let x = Axis::new((low, high), (LEFT, WIDTH - RIGHT));
    for (value, text) in x.ticks(6) {
        svg.line((x.pixel(value), TOP), (x.pixel(value), bottom), "grid");
        svg.text((x.pixel(value), bottom + 18.0), Anchor::Middle, "tick", &text);
    }
    for (index, (name, value)) in bars.iter().enumerate() {
        bar(&mut svg, (index, TASK_BAR), name, (x.pixel(0.0), x.pixel(*value)));
    }
    svg.line((x.pixel(0.0), TOP), (x.pixel(0.0), bottom), "zero");
    let title = format!("{quantity} of every task");
    svg.text((14.0, 24.0), Anchor::Start, "title", &title);
    svg.text((0.5 * (x.from + x.to), bottom + 38.0), Anchor::Middle, "label", quantity);
    svg.finish(&title)
}

/// A bar with its name on the left, by its place and height \[px\]; the point at its end where a text may begin.
fn bar(svg: &mut Svg, (index, height): (usize, f64), name: &str, (zero, end): (f64, f64)) -> (f64, f64) {
    let gap = 0.2 * height;
    let (top, low) = (TOP + height * index as f64 + gap, TOP + height * (index as f64 + 1.0) - gap);
    svg.area(&[(zero, top), (end, top), (end, low), (zero, low)], "dot");
    let line = 0.5 * (top + low) + 4.0;
    svg.text((LEFT - 10.0, line), Anchor::End, "tick", name);
    (end, line)
}
