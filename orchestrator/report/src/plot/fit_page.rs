//! One self-contained page with the numbers, remarks and figures of an identification.

use std::fmt::Write;

use super::figures::{Comparison, Curve, comparison};
use super::page::{STYLE, with_code};
use super::svg::escape;
use airloop_ident::fit;
use airloop_series::TimeSeries;

/// Contents of the page, in the order they are shown.
#[derive(Debug, Clone, Default)]
pub struct Page {
    /// Title.
    pub title: String,
    /// Summary in a sentence.
    pub lead: String,
    /// Remarks under their headings, as `Verdict` and `Warnings`; empty lists are left out.
    pub remarks: Vec<(String, Vec<String>)>,
    /// Element of HTML with a motion; may be empty.
    pub motion: String,
    /// Tables.
    pub tables: Vec<Table>,
    /// Figures, as SVG texts.
    pub figures: Vec<String>,
}

/// A table with a heading.
#[derive(Debug, Clone, Default)]
pub struct Table {
    /// Heading; may be empty.
    pub heading: String,
    /// Texts of the header.
    pub header: Vec<String>,
    /// Rows of texts.
    pub rows: Vec<Vec<String>>,
    /// Whether columns hold sentences, which are read from the left; else all but the first hold numbers.
    pub sentences: bool,
}

/// The page as HTML.
pub fn html(page: &Page) -> String {
    let title = escape(&page.title);
    let mut html = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\n<title>{title}</title>\n<style>{STYLE}</style></head>\n<body><main>\n<h1>{title}</h1>\n<p class=\"lead\">{}</p>\n",
        with_code(&page.lead)
    );
    html.push_str(&page.motion);
    for (heading, texts) in page.remarks.iter().filter(|(_, texts)| !texts.is_empty()) {
        // Writing into a String cannot fail.
        let _ = writeln!(html, "<h2>{}</h2>\n<ul>", escape(heading));
        for text in texts {
            let _ = writeln!(html, "<li>{}</li>", with_code(text));
        }
        html.push_str("</ul>\n");
    }
    for table in &page.tables {
        if !table.heading.is_empty() {
            let _ = writeln!(html, "<h2>{}</h2>", escape(&table.heading));
        }
        html.push_str("<table><thead>");
        row(&mut html, "th", &table.header, table.sentences);
        html.push_str("</thead><tbody>\n");
        table.rows.iter().for_each(|cells| row(&mut html, "td", cells, table.sentences));
        html.push_str("</tbody></table>\n");
    }
    for figure in &page.figures {
        let _ = writeln!(html, "<figure>{figure}</figure>");
    }
    html + "</main></body></html>\n"
}

fn row(html: &mut String, tag: &str, cells: &[String], sentences: bool) {
    html.push_str("<tr>");
    for (index, cell) in cells.iter().enumerate() {
        let class = if sentences || index == 0 { "" } else { " class=\"n\"" };
        let _ = write!(html, "<{tag}{class}>{}</{tag}>", escape(cell));
    }
    html.push_str("</tr>\n");
}

/// Figures of measured and simulated outputs (predicted ones where there is no simulation), from a table with columns
/// `y`, `y_simulated`, `y_one_step`; the first `warm_up` rows are left out. Each is a name and an SVG.
pub fn comparisons(
    name: &str,
    table: &TimeSeries,
    outputs: &[String],
    warm_up: usize,
) -> Vec<(String, String)> {
    let mut figures = Vec::new();
    let time = &table.time()[warm_up..];
    for output in outputs {
        let simulated = table.channel(&format!("{output}_simulated"));
        let what = if simulated.is_some() { "simulated" } else { "predicted one step ahead" };
        let other = simulated.or_else(|| table.channel(&format!("{output}_one_step")));
        let (Some(measured), Some(other)) = (table.channel(output), other) else { continue };
        let (values, other) = (&measured.values[warm_up..], &other.values[warm_up..]);
        let residual: Vec<f64> = values.iter().zip(other).map(|(y, y_hat)| y - y_hat).collect();
        let fit = fit::nrmse(values, other).ok().and_then(|fit| fit.nrmse_percent);
        let note = match fit {
            Some(fit) => format!("{name}: {what}, fit {fit:.2} %"),
            None => format!("{name}: {what}"),
        };
        let curve = |values, name| Curve { time, values, held: false, name };
        let svg = comparison(&Comparison {
            name: output,
            unit: measured.unit.as_deref().unwrap_or(""),
            note: &note,
            measured: curve(values, "measured"),
            simulated: curve(other, what),
            residual: curve(&residual, "residual"),
        });
        figures.push((format!("{name}_{output}"), svg));
    }
    figures
}

/// A measured output and the response of a model.
#[derive(Debug, Clone, Copy)]
pub struct Compared<'a> {
    /// Record.
    pub record: &'a str,
    /// Output.
    pub output: &'a str,
    /// Unit; empty for none.
    pub unit: &'a str,
    /// Whether the response is a free simulation, or else a one-step prediction.
    pub simulated: bool,
    /// Fit \[%\].
    pub fit: Option<f64>,
    /// Times and values of measurement, response and residual.
    pub curves: &'a [(Vec<f64>, Vec<f64>)],
}

/// The figure of one output, as SVG.
pub fn compared(figure: &Compared) -> String {
    let what = if figure.simulated { "simulated" } else { "predicted one step ahead" };
    let note = match figure.fit {
        Some(fit) => format!("{}: {what}, fit {fit:.2} %", figure.record),
        None => format!("{}: {what}", figure.record),
    };
    let curve = |index: usize, name| {
        let (time, values) = &figure.curves[index];
        Curve { time, values, held: false, name }
    };
    comparison(&Comparison {
        name: figure.output,
        unit: figure.unit,
        note: &note,
        measured: curve(0, "measured"),
        simulated: curve(1, what),
        residual: curve(2, "residual"),
    })
}
