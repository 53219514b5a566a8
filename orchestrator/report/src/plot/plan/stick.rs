//! Rods from a point that moves: positions over time, and a figure with poses side by side as in Fig. 13 of
//! *Model-based Trajectory Control of Robots with Pneumatic Actuator Dynamics*.

use super::Plan;
use super::animation::{PLAYER, RATE};
use crate::plot::axes::range;
use crate::plot::identification::panel::{Entry, Scale, Sheet};
use crate::plot::svg::Shape;
use airloop_plan::file::Length;
use airloop_plan::record::StickRecord;
use airloop_series::resample::{locate, value_at};
use airloop_series::{Interpolation, TimeSeries};

/// Poses in the figure of a plan.
pub(in crate::plot) const POSES: usize = 15;
/// Points of each path.
const POINTS_PER_PATH: usize = 2000;
/// Height of the plot in pixels; its width is that of the sheet.
const HEIGHT: f64 = 620.0;
/// Width of the plot in pixels.
const WIDTH: f64 = 856.0;

/// Columns of a figure in a series.
pub(super) struct Figure<'a> {
    series: &'a TimeSeries,
    point: [&'a [f64]; 2],
    rods: Vec<Rod<'a>>,
}

/// Columns of the angles of a rod, and that of its length or its constant length \[m\].
type Rod<'a> = (Vec<&'a [f64]>, Result<&'a [f64], f64>);

/// A pose: the point, then the other end of each rod, `[m]`.
pub(super) type Pose = Vec<(f64, f64)>;

impl<'a> Figure<'a> {
    /// None where the series lacks a column.
    pub(super) fn new(series: &'a TimeSeries, record: &StickRecord) -> Option<Figure<'a>> {
        let column = |name: &String| series.channel(name).map(|channel| channel.values.as_slice());
        let rods = record.rods.iter().map(|rod| {
            let angles = rod.angles.iter().map(column).collect::<Option<Vec<_>>>()?;
            let length = match &rod.length {
                Length::Number(length) => Err(*length),
                Length::Variable(name) => Ok(column(name)?),
            };
            Some((angles, length))
        });
        Some(Figure {
            series,
            point: [column(&record.x)?, column(&record.y)?],
            rods: rods.collect::<Option<_>>()?,
        })
    }

    /// First and last time \[s\].
    pub(super) fn span(&self) -> (f64, f64) {
        range(self.series.time().iter().copied())
    }

    /// The pose at a time \[s\].
    pub(super) fn pose(&self, time: f64) -> Pose {
        let position = locate(self.series.time(), time, 0);
        let at = |values: &[f64]| value_at(values, position, Interpolation::Linear);
        let (x, y) = (at(self.point[0]), at(self.point[1]));
        let rods = self.rods.iter().map(|(angles, length)| {
            let angle = angles.iter().map(|angle| at(angle)).sum::<f64>() / angles.len() as f64;
            let length = length.map_or_else(|length| length, at);
            (x + length * angle.sin(), y - length * angle.cos())
        });
        [(x, y)].into_iter().chain(rods).collect()
    }
}

/// Poses at equal distances in time, with the paths of all ends.
pub(super) fn stick_figure(plan: &Plan) -> String {
    plan.summary
        .stick_figure
        .as_ref()
        .map_or_else(String::new, |record| poses(&plan.trajectory, record, POSES))
}

/// As many poses of a motion at equal distances in time, with the paths of all ends.
pub(in crate::plot) fn poses(series: &TimeSeries, record: &StickRecord, count: usize) -> String {
    let classes = ["s0", "s1", "s2", "s3"];
    let names: Vec<String> =
        record.rods.iter().map(|rod| rod.name.clone().unwrap_or_else(|| rod.angles.join(" and "))).collect();
    let entry = |(name, class)| Entry { class, shape: None, text: name };
    let entries: Vec<Entry> = names.iter().map(String::as_str).zip(classes).map(entry).collect();
    let mut sheet =
        Sheet::new("Motion", "equal times between poses, circles: begin and end", &entries, 1, 1, HEIGHT);
    if let Some(figure) = Figure::new(series, record) {
        let (first, last) = figure.span();
        let poses = |count: usize| -> Vec<Pose> {
            (0..count).map(|k| figure.pose(first + (last - first) * k as f64 / (count - 1) as f64)).collect()
        };
        let fine = poses(POINTS_PER_PATH);
        let ends = fine.iter().flatten();
        let (left, right) = range(ends.clone().map(|end| end.0));
        let (low, high) = range(ends.map(|end| end.1).chain([0.0]));
        // One scale for both axes.
        let scale = (1.1 * (right - left) / WIDTH).max(1.1 * (high - low) / HEIGHT);
        let around =
            |middle: f64, pixels: f64| (middle - 0.5 * scale * pixels, middle + 0.5 * scale * pixels);
        let panel = sheet.panel(
            0,
            "",
            (around(0.5 * (left + right), WIDTH), Scale::Linear, "x [m]"),
            (around(0.5 * (low + high), HEIGHT), Scale::Linear, "y [m]"),
        );
        panel.level(&mut sheet.svg, 0.0, "limit");
        for (k, pose) in poses(count).iter().enumerate() {
            let from = panel.at(pose[0].0, pose[0].1);
            for (rod, end) in pose[1..].iter().enumerate() {
                sheet.svg.line(from, panel.at(end.0, end.1), classes[rod.min(classes.len() - 1)]);
            }
            if k == 0 || k + 1 == count {
                sheet.svg.marker(Shape::Circle, from, 5.0, "s0 open");
            }
        }
        for end in 0..fine[0].len() {
            let path: Vec<(f64, f64)> = fine.iter().map(|pose| panel.at(pose[end].0, pose[end].1)).collect();
            sheet.svg.polyline(&path, "mark");
        }
    }
    sheet.svg.finish("Stick figure of the motion")
}

/// The figure of a plan in motion: the element with its script; empty where the plan has none.
pub(super) fn moving(plan: &Plan) -> String {
    let sources = [("plan", Some(&plan.trajectory)), ("roll-out", plan.continuous.as_ref())];
    plan.summary.stick_figure.as_ref().map_or_else(String::new, |record| in_motion(record, &sources))
}

/// Motions by name, the first one in front, as an element with its script.
pub(in crate::plot) fn in_motion(record: &StickRecord, sources: &[(&str, Option<&TimeSeries>)]) -> String {
    let mut data = Vec::new();
    for (name, series) in sources {
        let Some(figure) = series.and_then(|series| Figure::new(series, record)) else { continue };
        let (first, last) = figure.span();
        let pictures = ((last - first) * RATE).ceil().max(1.0) as usize;
        let pose = |k: usize| {
            let pose = figure.pose((first + k as f64 / RATE).min(last));
            let numbers: Vec<String> = pose.iter().map(|(x, y)| format!("{x:.4},{y:.4}")).collect();
            format!("[{}]", numbers.join(","))
        };
        let poses: Vec<String> = (0..=pictures).map(pose).collect();
        data.push(format!("{{name:\"{name}\",p:[{}]}}", poses.join(",")));
    }
    format!(
        "<section class=\"animation\"><canvas id=\"sticks\" width=\"952\" height=\"520\" aria-label=\"stick figure in motion\"></canvas>\n\
         <p><button id=\"stick-play\" type=\"button\">Pause</button> <input id=\"stick-time\" type=\"range\" min=\"0\" value=\"0\" aria-label=\"time\"> \
         <output id=\"stick-clock\"></output></p></section>\n\
         <script>\n(() => {{\nconst data=[{}],rate={RATE};\n{SCRIPT}{PLAYER}}})();\n</script>\n",
        data.join(",")
    )
}

const SCRIPT: &str = r##"  const scene = document.getElementById("sticks"), pen = scene.getContext("2d");
  const play = document.getElementById("stick-play"), slider = document.getElementById("stick-time");
  const clock = document.getElementById("stick-clock");
  const last = data[0].p.length - 1, colors = ["#0072b2", "#d55e00", "#009e73", "#cc79a7"];
  const all = data.flatMap(d => d.p), xs = all.flatMap(p => p.filter((_, i) => i % 2 === 0));
  const ys = all.flatMap(p => p.filter((_, i) => i % 2 === 1)).concat([0]);
  const left = Math.min(...xs), right = Math.max(...xs), low = Math.min(...ys), high = Math.max(...ys);
  const scale = Math.min(scene.width / (1.2 * (right - left) + 0.2), scene.height / (1.15 * (high - low)));
  const px = x => scene.width / 2 + (x - (left + right) / 2) * scale;
  const py = y => scene.height / 2 - (y - (low + high) / 2) * scale;
  slider.max = last;
  const line = (a, b, c, d, width, color) => {
    pen.lineWidth = width; pen.strokeStyle = color; pen.beginPath(); pen.moveTo(a, b); pen.lineTo(c, d); pen.stroke();
  };
  const draw = k => {
    pen.clearRect(0, 0, scene.width, scene.height);
    line(0, py(0), scene.width, py(0), 2, "#888");
    data.slice().reverse().forEach((d, r) => {
      const main = r === data.length - 1, p = d.p[Math.min(k, d.p.length - 1)];
      pen.globalAlpha = main ? 1 : 0.35; pen.lineCap = "round";
      for (let i = 2; i < p.length; i += 2) {
        line(px(p[0]), py(p[1]), px(p[i]), py(p[i + 1]), main ? 5 : 9, main ? colors[(i / 2 - 1) % 4] : "#999");
      }
      pen.fillStyle = main ? "#222" : "#999"; pen.beginPath(); pen.arc(px(p[0]), py(p[1]), 8, 0, 7); pen.fill();
      pen.globalAlpha = 1; pen.font = "14px Helvetica, Arial, sans-serif";
      pen.fillText(d.name, 12, 22 + 20 * (data.length - 1 - r));
    });
    slider.value = k; clock.textContent = (k / rate).toFixed(2) + " s";
  };
"##;
