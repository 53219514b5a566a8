//! `report.html`: one page without outside files.

use std::fmt::Write;

use super::chart::short;
use super::{Report, figures, names, next, words};

/// Style sheet and script of the page.
const STYLE: &str = include_str!("style.css");
const SCRIPT: &str = include_str!("script.js");

fn escape(text: &str) -> String {
    crate::plot::svg::escape(text)
}

/// A table; columns in `numbers` are aligned to the right. Rows with `true` stand out.
fn table(out: &mut String, header: &[&str], numbers: &[usize], rows: &[(bool, Vec<String>)]) {
    let class = |index: usize| if numbers.contains(&index) { " class=\"n\"" } else { "" };
    out.push_str("<table><thead><tr>");
    for (index, cell) in header.iter().enumerate() {
        // Writing into a String cannot fail.
        let _ = write!(out, "<th{}>{}</th>", class(index), escape(cell));
    }
    out.push_str("</tr></thead><tbody>\n");
    for (marked, cells) in rows {
        out.push_str(if *marked { "<tr class=\"yes\">" } else { "<tr>" });
        for (index, cell) in cells.iter().enumerate() {
            let _ = write!(out, "<td{}>{}</td>", class(index), escape(cell));
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</tbody></table>\n");
}

fn plain(rows: impl IntoIterator<Item = Vec<String>>) -> Vec<(bool, Vec<String>)> {
    rows.into_iter().map(|row| (false, row)).collect()
}

fn figure(out: &mut String, svg: &str) {
    let _ = writeln!(out, "<figure>{svg}</figure>");
}

fn list(out: &mut String, items: &[String]) {
    out.push_str("<ul>\n");
    for item in items {
        let _ = writeln!(out, "<li>{}</li>", escape(item));
    }
    out.push_str("</ul>\n");
}

/// The report as a page.
pub fn text(report: &Report) -> String {
    let (answer, evidence) = (report.answer, report.evidence);
    let title = escape(report.case);
    let mut out = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\n<title>{title}: what the model lacks</title>\n<style>\n{STYLE}</style></head>\n<body><main>\n<h1>{title}: what the declared model lacks</h1>\n<p class=\"answer\">{}</p>\n",
        escape(&words::sentence(answer))
    );
    if let Some(sentence) = words::effect_on_error(answer) {
        let _ = writeln!(out, "<p>{}</p>", escape(&sentence));
    }
    for sentence in words::rivals(answer) {
        let _ = writeln!(out, "<p>{}</p>", escape(&sentence));
    }
    errors(&mut out, report);
    parameters(&mut out, report);
    stability(&mut out, report);
    place(&mut out, report);
    for record in &evidence.records {
        let _ = writeln!(
            out,
            "<h2>Residuals of {}</h2>\n<p class=\"how\">A validation record, simulated as for its error: over its whole length with a fitted initial state, or as the study says. Gray: two standard deviations of the sensor noise. Drag to zoom, double-click to see all, point for values.</p>",
            escape(&record.name)
        );
        figures::residuals(record, evidence).iter().for_each(|svg| figure(&mut out, svg));
    }
    dependence(&mut out, report);
    steps(&mut out, report);
    candidates(&mut out, report);
    out.push_str("<h2>What to measure next</h2>\n");
    list(&mut out, &next::advice(answer));
    remarks(&mut out, report);
    let _ = write!(out, "</main>\n<script>\n{SCRIPT}</script>\n</body></html>\n");
    out
}

fn errors(out: &mut String, report: &Report) {
    out.push_str("<h2>Error before and after, on validation records</h2>\n");
    let rows = words::errors(report.answer, &report.evidence.signals).into_iter().map(Vec::from);
    table(out, &words::ERROR_HEADER, &[1, 2, 3, 4, 5, 6], &plain(rows));
    if let Some(svg) = figures::errors(report.answer) {
        figure(out, &svg);
    }
    let _ = writeln!(out, "<p class=\"how\">{}</p>", escape(words::error_note(report.answer)));
}

fn parameters(out: &mut String, report: &Report) {
    let rows = words::parameter_rows(report.answer);
    if rows.is_empty() {
        return;
    }
    out.push_str("<h2>Parameters</h2>\n");
    table(out, &words::PARAMETER_HEADER, &[2, 3, 4], &plain(rows));
    if let Some(svg) = report.answer.law.as_ref().and_then(figures::law) {
        figure(out, &svg);
        out.push_str("<p class=\"how\">Dots: a smooth form of this variable, fitted in simulation on the estimation records, with its 95 % band; where the band is wide the records have hardly been. Line: the law.</p>\n");
    }
    for curve in &report.evidence.curves {
        figure(out, &figures::curve(curve));
    }
    if !report.evidence.curves.is_empty() {
        out.push_str("<p class=\"how\">The curve spans what the validation records moved through. The band combines the 95 % intervals of the parameters as if they were independent.</p>\n");
    }
}

fn stability(out: &mut String, report: &Report) {
    let rows = words::stability_rows(report.answer);
    if rows.is_empty() {
        return;
    }
    let _ = writeln!(
        out,
        "<h2>How it holds on parts of the records</h2>\n<p class=\"how\">{}</p>",
        escape(words::STABILITY_NOTE)
    );
    table(out, &words::STABILITY_HEADER, &[1], &plain(rows));
}

fn place(out: &mut String, report: &Report) {
    let Some(svg) = figures::ports(&report.evidence.ports, report.answer.limit) else { return };
    out.push_str("<h2>Where it sits</h2>\n");
    figure(out, &svg);
    out.push_str("<p class=\"how\">Each part is driven by what was measured in front of it and compared with what was measured behind it, on the estimation records. Noise stays below the limit.</p>\n");
}

fn dependence(out: &mut String, report: &Report) {
    let evidence = report.evidence;
    if !evidence.dependence.is_empty() {
        out.push_str("<h2>Residuals against the variables they depend on</h2>\n<p class=\"how\">All validation records, in bins of equal count; the two variables that explained most of the residual before. Gray: two standard deviations of the mean of a bin under sensor noise.</p>\n<div class=\"pair\">\n");
        evidence.dependence.iter().for_each(|d| figure(out, &figures::dependence(d)));
        out.push_str("</div>\n");
    }
    if !evidence.correlation.is_empty() {
        out.push_str("<h2>Autocorrelation of the residuals</h2>\n<p class=\"how\">White noise stays in the gray band with 99 %. A rounding sensor at rest repeats its error, which shows as correlation that is no missing effect.</p>\n<div class=\"pair\">\n");
        evidence.correlation.iter().for_each(|c| figure(out, &figures::correlation(c)));
        out.push_str("</div>\n");
    }
}

fn steps(out: &mut String, report: &Report) {
    let rows = words::step_rows(report.answer);
    if rows.is_empty() {
        return;
    }
    let _ = writeln!(
        out,
        "<h2>Steps of the search</h2>\n<p class=\"how\">{}</p>",
        escape(&words::step_note(report.answer))
    );
    let rows: Vec<(bool, Vec<String>)> = rows.into_iter().map(|row| (row[3].is_empty(), row)).collect();
    table(out, &words::STEP_HEADER, &[2], &rows);
}

fn candidates(out: &mut String, report: &Report) {
    if report.answer.effects.is_empty() {
        return;
    }
    let _ = writeln!(
        out,
        "<h2>Candidates</h2>\n<p class=\"how\">{}</p>",
        escape(words::candidate_note(report.answer))
    );
    let rows: Vec<(bool, Vec<String>)> = words::candidate_rows(report.answer)
        .into_iter()
        .zip(&report.answer.effects)
        .map(|(row, effect)| (effect.selected, row))
        .collect();
    table(out, &words::CANDIDATE_HEADER, &[2, 3], &rows);
}

fn remarks(out: &mut String, report: &Report) {
    let answer = report.answer;
    if let Some(system) = report.system {
        let _ = writeln!(
            out,
            "<h2>The amended system</h2>\n<p>The declared system with what it lacks, as FMUs: <code>{0}/system.ssd</code>, <code>{0}/system.ssp</code>. In the folder of this report:</p>\n<pre>{1}</pre>",
            escape(system),
            escape(&super::command(report, system))
        );
    }
    if !answer.corrections.is_empty() {
        out.push_str("<h2>Corrections of declared parameters</h2>\n");
        table(out, &words::CORRECTION_HEADER, &[1, 2, 3, 4], &plain(words::correction_rows(answer)));
    }
    let tested: Vec<String> =
        answer.not_testable.iter().map(|(id, why)| format!("{} ({id}): {why}.", names::named(id))).collect();
    if !tested.is_empty() {
        out.push_str("<h2>Not testable with these records</h2>\n");
        list(out, &tested);
    }
    if !answer.notes.is_empty() {
        out.push_str("<h2>Notes</h2>\n");
        list(out, &answer.notes);
    }
    let _ = writeln!(
        out,
        "<p class=\"how\">airloop {}, limit of what counts as noise: {} standard deviations.</p>",
        env!("CARGO_PKG_VERSION"),
        short(answer.limit)
    );
}
