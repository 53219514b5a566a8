//! A panel: axes, grid, labels; and panels side by side and below each other under one heading.

use crate::plot::axes::Axis;
use crate::plot::svg::{Anchor, Shape, Svg};

pub(in crate::plot) const WIDTH: f64 = 960.0;
const LEFT: f64 = 84.0;
const RIGHT: f64 = 20.0;
/// Room for the title above a panel.
const ABOVE: f64 = 30.0;
/// Room for ticks and label below a panel.
const BELOW: f64 = 50.0;
const ROW: f64 = 22.0;
/// Text widths are not known here; small letters are about this wide, those of a title a little more.
const LETTER: f64 = 7.0;
const TITLE_LETTER: f64 = 8.6;
/// Room for the line or marker of a legend entry.
const SWATCH: f64 = 46.0;

/// An entry of a legend.
pub(in crate::plot) struct Entry<'a> {
    pub class: &'a str,
    pub shape: Option<Shape>,
    pub text: &'a str,
}

/// Scale of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::plot) enum Scale {
    Linear,
    Logarithmic,
}

/// Panels under a heading.
pub(in crate::plot) struct Sheet {
    pub svg: Svg,
    columns: usize,
    top: f64,
    height: f64,
}

impl Sheet {
    /// Room for `count` panels whose plots are `height` pixels high, `columns` of them side by side.
    pub(in crate::plot) fn new(
        title: &str,
        note: &str,
        legend: &[Entry],
        count: usize,
        columns: usize,
        height: f64,
    ) -> Sheet {
        let heading = LEFT + TITLE_LETTER * letters(title) + 14.0 + LETTER * letters(note);
        let room = WIDTH - RIGHT;
        let one_row = heading + legend_width(legend) <= room;
        let rows: Vec<&[Entry]> = if one_row { vec![legend] } else { rows(legend, room - LEFT) };
        let top = if one_row { 36.0 } else { 36.0 + ROW * rows.len() as f64 };
        let total = top + (ABOVE + height + BELOW) * count.div_ceil(columns) as f64;
        let mut svg = Svg::new(WIDTH, total);
        svg.text((LEFT, 24.0), Anchor::Start, "title", title);
        let after = LEFT + TITLE_LETTER * letters(title) + 14.0;
        svg.text((after, 24.0), Anchor::Start, "note", note);
        let first = if one_row { 24.0 } else { 24.0 + ROW };
        for (index, row) in rows.iter().enumerate() {
            draw_legend(&mut svg, row, first + ROW * index as f64);
        }
        Sheet { svg, columns, top, height }
    }

    /// Left, right, upper and lower edge of a panel.
    fn edges(&self, index: usize) -> (f64, f64, f64, f64) {
        let (row, column) = (index / self.columns, index % self.columns);
        let width = WIDTH / self.columns as f64;
        let upper = self.top + ABOVE + (ABOVE + self.height + BELOW) * row as f64;
        let left = width * column as f64;
        (left + LEFT, left + width - RIGHT, upper, upper + self.height)
    }

    /// Draws the frame of panel `index` for ranges of values; logarithmic ranges are given as values, too.
    pub(in crate::plot) fn panel(
        &mut self,
        index: usize,
        title: &str,
        (x_range, x_scale, x_label): ((f64, f64), Scale, &str),
        (y_range, y_scale, y_label): ((f64, f64), Scale, &str),
    ) -> Panel {
        let (left, right, upper, lower) = self.edges(index);
        let x = Axis::new(scaled(x_range, x_scale), (left, right));
        let y = Axis::new(scaled(y_range, y_scale), (lower, upper));
        let panel = Panel { x, y, x_scale, y_scale };
        let ticks = |axis: &Axis, scale: Scale, count: usize| match scale {
            Scale::Linear => axis.ticks(count),
            Scale::Logarithmic => axis.log_ticks(count),
        };
        let svg = &mut self.svg;
        for (value, text) in ticks(&x, x_scale, if self.columns > 1 { 5 } else { 10 }) {
            let at = x.pixel(value);
            svg.line((at, lower), (at, upper), "grid");
            svg.line((at, lower), (at, lower + 4.0), "mark");
            svg.text((at, lower + 18.0), Anchor::Middle, "tick", &text);
        }
        for (value, text) in ticks(&y, y_scale, (self.height / 45.0) as usize + 1) {
            let at = y.pixel(value);
            svg.line((left, at), (right, at), "grid");
            svg.line((left - 4.0, at), (left, at), "mark");
            svg.text((left - 8.0, at + 4.0), Anchor::End, "tick", &text);
        }
        svg.frame(left, upper, right - left, lower - upper);
        svg.text((left, upper - 8.0), Anchor::Start, "legend", title);
        svg.text_upwards((left - 62.0, 0.5 * (upper + lower)), "label", y_label);
        svg.text((0.5 * (left + right), lower + 38.0), Anchor::Middle, "label", x_label);
        panel
    }
}

fn scaled((min, max): (f64, f64), scale: Scale) -> (f64, f64) {
    match scale {
        Scale::Linear => (min, max),
        Scale::Logarithmic => (min.log10(), max.log10()),
    }
}

/// Values to pixels.
#[derive(Debug, Clone, Copy)]
pub(in crate::plot) struct Panel {
    pub x: Axis,
    pub y: Axis,
    x_scale: Scale,
    y_scale: Scale,
}

impl Panel {
    /// Pixel of a point, drawn onto the edge if it lies outside.
    pub(in crate::plot) fn at(&self, x: f64, y: f64) -> (f64, f64) {
        let inside = |axis: &Axis, value: f64, scale: Scale| {
            let value = if scale == Scale::Logarithmic { value.log10() } else { value };
            let value = if value.is_nan() { axis.min } else { value.clamp(axis.min, axis.max) };
            axis.pixel(value)
        };
        (inside(&self.x, x, self.x_scale), inside(&self.y, y, self.y_scale))
    }

    /// A line through points.
    pub(in crate::plot) fn line(&self, svg: &mut Svg, x: &[f64], y: &[f64], class: &str) {
        let points: Vec<(f64, f64)> = x.iter().zip(y).map(|(x, y)| self.at(*x, *y)).collect();
        svg.polyline(&points, class);
    }

    /// The area between two lines.
    pub(in crate::plot) fn band(&self, svg: &mut Svg, x: &[f64], low: &[f64], high: &[f64]) {
        let upper = x.iter().zip(high).map(|(x, y)| self.at(*x, *y));
        let lower = x.iter().zip(low).rev().map(|(x, y)| self.at(*x, *y));
        svg.area(&upper.chain(lower).collect::<Vec<_>>(), "band");
    }

    /// A horizontal line over the whole panel.
    pub(in crate::plot) fn level(&self, svg: &mut Svg, y: f64, class: &str) {
        let at = self.at(f64::NAN, y).1;
        svg.line((self.x.from, at), (self.x.to, at), class);
    }
}

fn letters(text: &str) -> f64 {
    text.chars().count() as f64
}

fn legend_width(entries: &[Entry]) -> f64 {
    entries.iter().map(|entry| LETTER * letters(entry.text) + SWATCH).sum()
}

/// Entries in rows that fit into `width`.
fn rows<'a, 'b>(entries: &'b [Entry<'a>], width: f64) -> Vec<&'b [Entry<'a>]> {
    let mut found = Vec::new();
    let mut rest = entries;
    while !rest.is_empty() {
        let fitting =
            (1..=rest.len()).take_while(|&count| count == 1 || legend_width(&rest[..count]) <= width);
        let (row, later) = rest.split_at(fitting.last().unwrap_or(1));
        found.push(row);
        rest = later;
    }
    found
}

/// Entries right-aligned on a line.
fn draw_legend(svg: &mut Svg, entries: &[Entry], baseline: f64) {
    let mut right = WIDTH - RIGHT;
    for entry in entries.iter().rev() {
        let width = LETTER * letters(entry.text);
        svg.text((right - width, baseline), Anchor::Start, "legend", entry.text);
        let (from, to, middle) = (right - width - 32.0, right - width - 6.0, baseline - 4.0);
        match entry.shape {
            Some(shape) => {
                // Families of lines have dashes of their own; other markers stand alone.
                if entry.class.contains(" d") {
                    svg.line((from, middle), (to, middle), entry.class);
                }
                svg.marker(shape, (0.5 * (from + to), middle), 4.0, &format!("{} open", solid(entry.class)));
            }
            None if entry.class == "band" => {
                let corners =
                    [(from, middle - 5.0), (to, middle - 5.0), (to, middle + 5.0), (from, middle + 5.0)];
                svg.area(&corners, entry.class);
            }
            None => svg.line((from, middle), (to, middle), entry.class),
        }
        right -= width + SWATCH;
    }
}

/// The class without its dashes.
pub(in crate::plot) fn solid(class: &str) -> &str {
    class.split(' ').next().unwrap_or(class)
}
