//! Correlations as stems with their 99 % band.

use super::panel::{Entry, Scale, Sheet};
use airloop_ident::diagnostics::residuals::{Autocorrelation, CrossCorrelation};

/// Stems over lags with a band; those beyond it stand out.
fn panel(sheet: &mut Sheet, index: usize, title: &str, label: &str, lags: &[f64], values: &[f64], band: f64) {
    let largest = values.iter().fold(band, |largest, value| largest.max(value.abs())) * 1.12;
    let (first, last) = (lags.first().copied().unwrap_or(0.0), lags.last().copied().unwrap_or(1.0));
    let lowest = if values.iter().any(|value| *value < -band) {
        -largest
    } else {
        -f64::max(1.8 * band, 0.1 * largest)
    };
    let panel = sheet.panel(
        index,
        title,
        ((first - 0.7, last + 0.7), Scale::Linear, "lag [samples]"),
        ((lowest, largest), Scale::Linear, label),
    );
    let svg = &mut sheet.svg;
    panel.band(svg, &[first - 0.7, last + 0.7], &[-band; 2], &[band; 2]);
    panel.level(svg, 0.0, "zero");
    for (&lag, &value) in lags.iter().zip(values) {
        let beyond = value.abs() > band;
        svg.line(panel.at(lag, 0.0), panel.at(lag, value), if beyond { "beyond" } else { "stem" });
        let class = if beyond { "dot-beyond" } else { "dot" };
        svg.marker(crate::plot::svg::Shape::Circle, panel.at(lag, value), 2.6, class);
    }
}

fn sheet(title: &str, note: &str, count: usize, columns: usize, height: f64) -> Sheet {
    let legend = [
        Entry { class: "band", shape: None, text: "99 % band" },
        Entry { class: "beyond", shape: None, text: "outside" },
    ];
    Sheet::new(title, note, &legend, count, columns, height)
}

/// Stems of any sequence, such as an impulse response, with a band of its own at every lag.
pub fn stems(title: &str, note: &str, label: &str, values: &[f64], band: &[f64]) -> String {
    let mut sheet = sheet(title, note, 1, 1, 240.0);
    let all = values.iter().chain(band).copied();
    let (low, high) = crate::plot::axes::range(all.clone().chain(all.map(|value| -value)));
    let lags: Vec<f64> = (0..values.len()).map(|lag| lag as f64).collect();
    let last = lags.last().copied().unwrap_or(1.0);
    let panel = sheet.panel(
        0,
        "",
        ((-0.7, last + 0.7), Scale::Linear, "lag [samples]"),
        ((1.05 * low, 1.05 * high), Scale::Linear, label),
    );
    let negative: Vec<f64> = band.iter().map(|band| -band).collect();
    panel.band(&mut sheet.svg, &lags, &negative, band);
    panel.level(&mut sheet.svg, 0.0, "zero");
    for ((&lag, &value), band) in lags.iter().zip(values).zip(band) {
        let (stem, dot) = if value.abs() > *band { ("beyond", "dot-beyond") } else { ("stem", "dot") };
        sheet.svg.line(panel.at(lag, 0.0), panel.at(lag, value), stem);
        sheet.svg.marker(crate::plot::svg::Shape::Circle, panel.at(lag, value), 2.2, dot);
    }
    sheet.svg.finish(title)
}

/// Autocorrelation of every residual, lag 0 left out.
pub fn autocorrelations(found: &[Autocorrelation]) -> String {
    let mut sheet = sheet("Residual autocorrelation", "", found.len(), 1, 150.0);
    for (index, of) in found.iter().enumerate() {
        let lags: Vec<f64> = (1..of.values.len()).map(|lag| lag as f64).collect();
        let title = format!(
            "{}: Ljung-Box p = {}, its past explains {:.1} % of its variance",
            of.output,
            probability(of.p_value),
            100.0 * of.explained_by_past
        );
        let values = of.values.get(1..).unwrap_or(&[]);
        panel(&mut sheet, index, &title, "correlation", &lags, values, of.band_99);
    }
    sheet.svg.finish("Residual autocorrelation by output, with 99 % band")
}

/// Correlation of every residual with every input, two panels side by side.
pub fn cross_correlations(found: &[CrossCorrelation]) -> String {
    let columns = if found.len() > 3 { 2 } else { 1 };
    let mut sheet = sheet(
        "Residual and past inputs (lag > 0), and later inputs (lag < 0)",
        "input whitened",
        found.len(),
        columns,
        150.0,
    );
    for (index, of) in found.iter().enumerate() {
        let lags: Vec<f64> = of.lags.iter().map(|lag| *lag as f64).collect();
        let title = format!("{} to residual of {}", of.input, of.output);
        panel(&mut sheet, index, &title, "correlation", &lags, &of.values, of.band_99);
    }
    sheet.svg.finish("Cross-correlation of residuals and inputs, with 99 % band")
}

fn probability(p: f64) -> String {
    if p < 1e-4 { "below 0.0001".into() } else { format!("{p:.3}") }
}
