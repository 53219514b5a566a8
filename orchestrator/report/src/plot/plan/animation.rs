//! The cart-pole in motion: data and a small script inside the page, nothing from outside.

use std::fmt::Write;

use super::Plan;
use airloop_series::Interpolation;
use airloop_series::resample::{locate, value_at};

/// Pictures per second of the embedded data.
pub(super) const RATE: f64 = 60.0;

/// The element with its script; empty where the plan is none of a cart-pole.
pub(super) fn animation(plan: &Plan) -> String {
    let Some(what) = &plan.summary.animation else { return String::new() };
    let (mut data, mut sources) = (String::new(), Vec::new());
    sources.push(("plan", &plan.trajectory));
    sources.extend(plan.sampled.as_ref().or(plan.continuous.as_ref()).map(|rolled| ("roll-out", rolled)));
    for (name, series) in sources {
        let (Some(cart), Some(angle)) = (plan.values(series, &what.cart), plan.values(series, &what.angle))
        else {
            continue;
        };
        let (first, last) = (series.time()[0], series.time()[series.len() - 1]);
        let pictures = ((last - first) * RATE).ceil().max(1.0) as usize;
        let row = |values: &[f64]| {
            let mut guess = 0;
            let mut text = String::new();
            for k in 0..=pictures {
                let position = locate(series.time(), (first + k as f64 / RATE).min(last), guess);
                guess = position.index;
                let separator = if k == 0 { "" } else { "," };
                // Writing into a String cannot fail.
                let _ = write!(text, "{separator}{:.4}", value_at(values, position, Interpolation::Linear));
            }
            text
        };
        let separator = if data.is_empty() { "" } else { "," };
        let _ = write!(data, "{separator}{{name:\"{name}\",x:[{}],a:[{}]}}", row(cart), row(angle));
    }
    if data.is_empty() {
        return String::new();
    }
    let limit = plan.summary.signals.iter().find(|signal| signal.name == what.cart);
    let stroke = limit.and_then(|signal| signal.min.zip(signal.max));
    let stroke = stroke.map_or("null".into(), |(min, max)| format!("[{min},{max}]"));
    let length = what.length;
    format!(
        "<section class=\"animation\"><canvas id=\"scene\" width=\"952\" height=\"420\" aria-label=\"cart and pole in motion\"></canvas>\n\
         <p><button id=\"play\" type=\"button\">Pause</button> <input id=\"time\" type=\"range\" min=\"0\" value=\"0\" aria-label=\"time\"> \
         <output id=\"clock\"></output></p></section>\n\
         <script>\n(() => {{\nconst data=[{data}],rate={RATE},stroke={stroke},length={length};\n{SCRIPT}{PLAYER}}})();\n</script>\n"
    )
}

const SCRIPT: &str = r##"  const scene = document.getElementById("scene"), pen = scene.getContext("2d");
  const play = document.getElementById("play"), slider = document.getElementById("time");
  const clock = document.getElementById("clock");
  const last = data[0].x.length - 1, colors = ["#0072b2", "#d55e00"];
  const xs = data.flatMap(d => d.x).concat(stroke || []);
  const left = Math.min(...xs) - 1.25 * length, right = Math.max(...xs) + 1.25 * length;
  const scale = Math.min(scene.width / (right - left), scene.height / (2.7 * length));
  const px = x => scene.width / 2 + (x - (left + right) / 2) * scale, py = y => scene.height / 2 - y * scale;
  slider.max = last;
  const line = (a, b, c, d, width, color) => {
    pen.lineWidth = width; pen.strokeStyle = color; pen.beginPath(); pen.moveTo(a, b); pen.lineTo(c, d); pen.stroke();
  };
  const draw = k => {
    pen.clearRect(0, 0, scene.width, scene.height);
    line(0, py(0), scene.width, py(0), 1, "#bbb");
    if (stroke) for (const end of stroke) line(px(end), py(0) - 22, px(end), py(0) + 22, 3, "#b23a2e");
    data.slice().reverse().forEach((d, r) => {
      const i = data.length - 1 - r, at = Math.min(k, d.x.length - 1), color = colors[i];
      const tip = j => [px(d.x[j] + length * Math.sin(d.a[j])), py(-length * Math.cos(d.a[j]))];
      pen.globalAlpha = i === 0 ? 1 : 0.45;
      pen.lineWidth = 1.5; pen.strokeStyle = color; pen.setLineDash(i === 0 ? [] : [5, 5]); pen.beginPath();
      for (let j = Math.max(0, at - 40); j <= at; j++) pen.lineTo(...tip(j));
      pen.stroke(); pen.setLineDash([]);
      const width = Math.max(26, 0.28 * length * scale), x = px(d.x[at]), y = py(0);
      if (i === 0) { pen.fillStyle = "#444"; pen.fillRect(x - width / 2, y - width / 4, width, width / 2); }
      const [tx, ty] = tip(at);
      line(x, y, tx, ty, 5, color);
      pen.fillStyle = color; pen.beginPath(); pen.arc(tx, ty, 9, 0, 7); pen.fill();
      pen.globalAlpha = 1;
      pen.font = "14px Helvetica, Arial, sans-serif"; pen.fillText(d.name, 12, 22 + 20 * i);
    });
    slider.value = k; clock.textContent = (k / rate).toFixed(2) + " s";
  };
"##;

/// Plays `draw(k)` for pictures 0 .. `last` at `rate` per second, with the button `play` and the slider `slider`.
pub(super) const PLAYER: &str = r##"  let running = !matchMedia("(prefers-reduced-motion: reduce)").matches, at = 0, before = null;
  const label = () => { play.textContent = running ? "Pause" : "Play"; };
  const tick = now => {
    if (running) {
      if (before !== null) at += (now - before) / 1000 * rate;
      if (at > last + rate) at = 0;
      draw(Math.min(last, Math.floor(at)));
    }
    before = now;
    requestAnimationFrame(tick);
  };
  play.onclick = () => { running = !running; if (at >= last) at = 0; label(); };
  slider.oninput = () => { running = false; at = Number(slider.value); draw(at); label(); };
  label(); draw(0); requestAnimationFrame(tick);
"##;
