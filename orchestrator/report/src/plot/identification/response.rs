//! Step and frequency responses with 95 % bands.

use super::panel::{Entry, Scale, Sheet};
use crate::plot::axes::range;
use crate::plot::run::short;
use airloop_ident::diagnostics::response::{FrequencyResponse, StepResponse};
use airloop_ident::parameters::TWO_SIDED_95;

fn legend(with_band: bool) -> Vec<Entry<'static>> {
    let line = Entry { class: "s0", shape: None, text: "model" };
    let band = Entry { class: "band", shape: None, text: "95 % band" };
    if with_band { vec![line, band] } else { vec![line] }
}

/// Values less and plus 1.96 standard deviations.
fn band(values: &[f64], deviation: &[f64]) -> [Vec<f64>; 2] {
    [-TWO_SIDED_95, TWO_SIDED_95].map(|z| values.iter().zip(deviation).map(|(v, d)| v + z * d).collect())
}

/// One panel per channel: the output after a unit step of the input.
pub fn step_responses(found: &[StepResponse]) -> String {
    let with_band = found.iter().any(|of| !of.standard_deviation.is_empty());
    let columns = if found.len() > 3 { 2 } else { 1 };
    let mut sheet = Sheet::new("Step responses", "", &legend(with_band), found.len(), columns, 190.0);
    for (index, of) in found.iter().enumerate() {
        let mut title = format!("{} to {}", of.input, of.output);
        if let Some(gain) = of.dc_gain {
            title += &format!(", gain {}", short(gain));
            if let Some(deviation) = of.dc_gain_deviation {
                title += &format!(" \u{b1} {}", short(TWO_SIDED_95 * deviation));
            }
        }
        if let Some(settling) = of.settling_time {
            title += &format!(", settles in {} s", short(settling));
        }
        let [low, high] = band(&of.values, &of.standard_deviation);
        let all = of.values.iter().chain(&low).chain(&high).copied().chain([0.0]);
        let (min, max) = range(all);
        let pad = 0.06 * (max - min);
        let end = of.time.last().copied().unwrap_or(1.0);
        let panel = sheet.panel(
            index,
            &title,
            ((0.0, end), Scale::Linear, "time [s]"),
            ((min - pad, max + pad), Scale::Linear, "output per unit of input"),
        );
        if !low.is_empty() {
            panel.band(&mut sheet.svg, &of.time, &low, &high);
        }
        panel.line(&mut sheet.svg, &of.time, &of.values, "s0");
    }
    sheet.svg.finish("Step responses by channel")
}

/// Two panels per channel: magnitude and phase over frequency.
pub fn frequency_responses(found: &[FrequencyResponse]) -> String {
    let with_band = found.iter().any(|of| !of.relative_deviation.is_empty());
    let mut sheet = Sheet::new("Frequency responses", "", &legend(with_band), 2 * found.len(), 2, 200.0);
    for (index, of) in found.iter().enumerate() {
        let title = format!("{} to {}", of.input, of.output);
        let frequency = (range(of.frequency.iter().copied()), Scale::Logarithmic, "frequency [Hz]");
        let edge = |z: f64| -> Vec<f64> {
            let pairs = of.magnitude.iter().zip(&of.relative_deviation);
            pairs.map(|(magnitude, deviation)| magnitude * (z * deviation).exp()).collect()
        };
        let (min, max) = range(of.magnitude.iter().copied().filter(|m| *m > 0.0));
        let (min, max) = if min.is_finite() { (min, max) } else { (0.1, 1.0) };
        // Four decades say enough; a notch may be deeper.
        let limits = (f64::max(min / 1.5, max * 1e-4), max * 1.5);
        let panel = sheet.panel(2 * index, &title, frequency, (limits, Scale::Logarithmic, "magnitude"));
        if !of.relative_deviation.is_empty() {
            panel.band(&mut sheet.svg, &of.frequency, &edge(-TWO_SIDED_95), &edge(TWO_SIDED_95));
        }
        panel.line(&mut sheet.svg, &of.frequency, &of.magnitude, "s0");
        let (min, max) = range(of.phase.iter().copied());
        let pad = f64::max(0.08 * (max - min), 5.0);
        let limits = ((min - pad, max + pad), Scale::Linear, "phase [\u{b0}]");
        let panel = sheet.panel(2 * index + 1, &title, frequency, limits);
        if !of.phase_deviation.is_empty() {
            let [low, high] = band(&of.phase, &of.phase_deviation);
            panel.band(&mut sheet.svg, &of.frequency, &low, &high);
        }
        panel.line(&mut sheet.svg, &of.frequency, &of.phase, "s0");
    }
    sheet.svg.finish("Magnitude and phase by channel")
}
