//! A minimal SVG writer: lines, polylines, areas, markers, text that stays text.

use std::fmt::Write;

/// Anchor of a text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// Begins at the point.
    Start,
    /// Centered on the point.
    Middle,
    /// Ends at the point.
    End,
}

/// Form of a marker.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// A circle.
    Circle,
    /// A square.
    Square,
    /// A triangle that stands on its base.
    Triangle,
    /// Two crossing lines.
    Cross,
}

/// An SVG drawing; lengths in pixels, y downwards.
#[derive(Debug, Clone)]
pub struct Svg {
    width: f64,
    height: f64,
    body: String,
}

impl Svg {
    /// An empty white drawing.
    pub fn new(width: f64, height: f64) -> Svg {
        Svg { width, height, body: String::new() }
    }

    /// A straight line.
    pub fn line(&mut self, (x1, y1): (f64, f64), (x2, y2): (f64, f64), class: &str) {
        self.push(format_args!(
            "<line class=\"{class}\" x1=\"{x1:.2}\" y1=\"{y1:.2}\" x2=\"{x2:.2}\" y2=\"{y2:.2}\"/>"
        ));
    }

    /// A frame without filling.
    pub fn frame(&mut self, x: f64, y: f64, width: f64, height: f64) {
        self.push(format_args!(
            "<rect class=\"frame\" x=\"{x:.2}\" y=\"{y:.2}\" width=\"{width:.2}\" height=\"{height:.2}\"/>"
        ));
    }

    /// A curve through points.
    pub fn polyline(&mut self, points: &[(f64, f64)], class: &str) {
        let mut text = String::with_capacity(points.len() * 12);
        for (x, y) in points {
            let separator = if text.is_empty() { "" } else { " " };
            // Writing into a String cannot fail.
            let _ = write!(text, "{separator}{x:.2},{y:.2}");
        }
        self.push(format_args!("<polyline class=\"{class}\" points=\"{text}\"/>"));
    }

    /// Separate points as dots.
    pub fn dots(&mut self, points: &[(f64, f64)], class: &str) {
        let mut text = String::with_capacity(points.len() * 16);
        for (x, y) in points {
            // Writing into a String cannot fail.
            let _ = write!(text, "M{x:.1} {y:.1}h0");
        }
        self.push(format_args!("<path class=\"{class}\" d=\"{text}\"/>"));
    }

    /// A filled area inside a closed line.
    pub fn area(&mut self, points: &[(f64, f64)], class: &str) {
        let corners: Vec<String> = points.iter().map(|(x, y)| format!("{x:.2},{y:.2}")).collect();
        self.push(format_args!("<polygon class=\"{class}\" points=\"{}\"/>", corners.join(" ")));
    }

    /// A marker centered on a point, some `size` pixels from the center to its edge.
    pub fn marker(&mut self, shape: Shape, (x, y): (f64, f64), size: f64, class: &str) {
        let (left, right, top, bottom) = (x - size, x + size, y - size, y + size);
        let path = match shape {
            Shape::Circle => {
                return self.push(format_args!(
                    "<circle class=\"{class}\" cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{size:.2}\"/>"
                ));
            }
            Shape::Square => format!("M{left:.2},{top:.2}H{right:.2}V{bottom:.2}H{left:.2}Z"),
            Shape::Triangle => format!("M{x:.2},{top:.2}L{right:.2},{bottom:.2}H{left:.2}Z"),
            Shape::Cross => {
                format!(
                    "M{left:.2},{top:.2}L{right:.2},{bottom:.2}M{left:.2},{bottom:.2}L{right:.2},{top:.2}"
                )
            }
        };
        self.push(format_args!("<path class=\"{class}\" d=\"{path}\"/>"));
    }

    /// A text on one line; `class` chooses size and color.
    pub fn text(&mut self, (x, y): (f64, f64), anchor: Anchor, class: &str, text: &str) {
        let anchor = anchor.name();
        let text = escape(text);
        self.push(format_args!(
            "<text class=\"{class}\" x=\"{x:.2}\" y=\"{y:.2}\" text-anchor=\"{anchor}\">{text}</text>"
        ));
    }

    /// A text that reads upwards, centered on the point.
    pub fn text_upwards(&mut self, (x, y): (f64, f64), class: &str, text: &str) {
        let text = escape(text);
        self.push(format_args!(
            "<text class=\"{class}\" transform=\"translate({x:.2},{y:.2}) rotate(-90)\" text-anchor=\"middle\">{text}</text>"
        ));
    }

    fn push(&mut self, element: std::fmt::Arguments) {
        // Writing into a String cannot fail.
        let _ = writeln!(self.body, "{element}");
    }

    /// The drawing as text, complete in itself; `title` is read out by screen readers.
    pub fn finish(&self, title: &str) -> String {
        let (width, height, body) = (self.width, self.height, &self.body);
        let title = escape(title);
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" role=\"img\">\n<title>{title}</title>\n<style>{STYLE}</style>\n<rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>\n{body}</svg>\n"
        )
    }
}

impl Anchor {
    fn name(self) -> &'static str {
        match self {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        }
    }
}

/// Colors: measurement neutral, simulation blue, residual red; a series palette that color-blind readers can tell
/// apart (Okabe and Ito).
const STYLE: &str = "\
text{font-family:Helvetica,Arial,'DejaVu Sans',sans-serif;fill:#222}\
.title{font-size:15px;font-weight:600}.note{font-size:13px;fill:#555}.tick{font-size:12px;fill:#444}\
.label{font-size:13px;fill:#222}.legend{font-size:13px}\
.frame{fill:none;stroke:#888;stroke-width:1}.grid{stroke:#e6e6e6;stroke-width:1}.zero{stroke:#aaa;stroke-width:1}\
.mark{stroke:#888;stroke-width:1}\
polyline{fill:none;stroke-width:1.5;stroke-linejoin:round;stroke-linecap:round}line{fill:none}\
.measured{stroke:#b0b0b0;stroke-width:4}.simulated{stroke:#0b62a8;stroke-width:1.5}\
.dots{stroke:#b0b0b0;stroke-width:2.5;stroke-linecap:round;fill:none}\
.residual{stroke:#b23a2e;stroke-width:1.1}\
.s0{stroke:#0072b2}.s1{stroke:#d55e00}.s2{stroke:#009e73}.s3{stroke:#cc79a7}.s4{stroke:#7a5c00}.s5{stroke:#56b4e9}\
.s0,.s1,.s2,.s3,.s4,.s5{stroke-width:1.6}\
.d1{stroke-dasharray:7 4}.d2{stroke-dasharray:2 3}.d3{stroke-dasharray:9 3 2 3}\
.band{fill:#0072b2;fill-opacity:.2;stroke:none}.limit{stroke:#b23a2e;stroke-width:1.2;stroke-dasharray:6 4}\
.stem{stroke:#0b62a8;stroke-width:1.6}.beyond{stroke:#b23a2e;stroke-width:2.2}\
.ring{fill:none;stroke:#888;stroke-width:1.2}circle,path{fill:none}\
.open{fill:#fff}.dot{fill:#0b62a8;stroke:none}.dot-beyond{fill:#b23a2e;stroke:none}\
.faint{fill:#888;fill-opacity:.35;stroke:none}";

/// Number of dashes `d1`, `d2` ...
pub const DASH_CLASSES: usize = 3;
/// Number of series classes `s0`, `s1` ...
pub const SERIES_CLASSES: usize = 6;

/// Text with the characters that XML reserves replaced.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
