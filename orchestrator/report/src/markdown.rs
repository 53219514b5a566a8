//! `report.md`: what the page says, as text.

use std::fmt::Write;

use super::{Report, figures, names, next, words};
use crate::chart::short;

fn table(out: &mut String, header: &[&str], rows: impl IntoIterator<Item = Vec<String>>) {
    // Writing into a String cannot fail.
    let _ = writeln!(out, "| {} |\n|{}", header.join(" | "), "---|".repeat(header.len()));
    for row in rows {
        let _ = writeln!(
            out,
            "| {} |",
            row.iter().map(|cell| cell.replace('|', "/")).collect::<Vec<_>>().join(" | ")
        );
    }
    out.push('\n');
}

fn heading(out: &mut String, text: &str) {
    let _ = writeln!(out, "## {text}\n");
}

fn list(out: &mut String, items: impl IntoIterator<Item = String>) {
    for item in items {
        let _ = writeln!(out, "- {item}");
    }
    out.push('\n');
}

/// The report as Markdown.
pub fn text(report: &Report) -> String {
    let (answer, evidence) = (report.answer, report.evidence);
    let mut out =
        format!("# {}: what the declared model lacks\n\n**{}**\n\n", report.case, words::sentence(answer));
    if let Some(sentence) = words::effect_on_error(answer) {
        let _ = writeln!(out, "{sentence}\n");
    }
    for sentence in words::rivals(answer) {
        let _ = writeln!(out, "{sentence}\n");
    }
    heading(&mut out, "Error before and after, on validation records");
    table(
        &mut out,
        &words::ERROR_HEADER,
        words::errors(answer, &evidence.signals).into_iter().map(Vec::from),
    );
    let _ = writeln!(out, "{}\n", words::error_note(answer));
    let rows = words::parameter_rows(answer);
    if !rows.is_empty() {
        heading(&mut out, "Parameters");
        table(&mut out, &words::PARAMETER_HEADER, rows);
    }
    let rows = words::stability_rows(answer);
    if !rows.is_empty() {
        heading(&mut out, "How it holds on parts of the records");
        let _ = writeln!(out, "{}\n", words::STABILITY_NOTE);
        table(&mut out, &words::STABILITY_HEADER, rows);
    }
    if !evidence.ports.is_empty() {
        heading(&mut out, "Where it sits");
        let rows = evidence.ports.iter().map(|port| {
            vec![port.from.to_owned(), port.to.clone(), short(port.left[0]), short(port.left[1])]
        });
        table(&mut out, &["driven by", "compared with", "left before", "left after"], rows);
        let _ = writeln!(
            out,
            "In standard deviations above sensor noise, on estimation records; noise stays below {}.\n",
            short(answer.limit)
        );
    }
    if !evidence.dependence.is_empty() {
        heading(&mut out, "Residuals against the variables they depend on");
        let rows = evidence.dependence.iter().map(|d| figures::dependence_row(d).into());
        table(
            &mut out,
            &["signal", "variable", "explained variance", "largest mean before", "largest mean after"],
            rows,
        );
    }
    if !evidence.correlation.is_empty() {
        heading(&mut out, "Autocorrelation of the residuals");
        let rows = evidence.correlation.iter().map(|c| {
            let largest = |model: usize| c.values[model].iter().map(|r| r.abs()).fold(0.0, f64::max);
            vec![c.signal.clone(), short(largest(0)), short(largest(1)), format!("{:.3}", c.limit)]
        });
        table(&mut out, &["signal", "largest before", "largest after", "white noise (99 %)"], rows);
    }
    let rows = words::step_rows(answer);
    if !rows.is_empty() {
        heading(&mut out, "Steps of the search");
        let _ = writeln!(out, "{}\n", words::step_note(answer));
        table(&mut out, &words::STEP_HEADER, rows);
    }
    if !answer.effects.is_empty() {
        heading(&mut out, "Candidates");
        table(&mut out, &words::CANDIDATE_HEADER, words::candidate_rows(answer));
    }
    heading(&mut out, "What to measure next");
    list(&mut out, next::advice(answer));
    if let Some(system) = report.system {
        heading(&mut out, "The amended system");
        let _ = writeln!(
            out,
            "`{system}/system.ssd` and `{system}/system.ssp`: the declared system with what it lacks, as FMUs. In the folder of this report:\n\n    {}\n",
            super::command(report, system)
        );
    }
    if !answer.corrections.is_empty() {
        heading(&mut out, "Corrections of declared parameters");
        table(&mut out, &words::CORRECTION_HEADER, words::correction_rows(answer));
    }
    if !answer.not_testable.is_empty() {
        heading(&mut out, "Not testable with these records");
        list(
            &mut out,
            answer.not_testable.iter().map(|(id, why)| format!("{} ({id}): {why}.", names::named(id))),
        );
    }
    if !answer.notes.is_empty() {
        heading(&mut out, "Notes");
        list(&mut out, answer.notes.iter().cloned());
    }
    out
}
