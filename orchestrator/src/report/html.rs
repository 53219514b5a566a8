//! `report.html`: one page without outside files.

use std::fmt::Write;

use super::words;
use crate::refine::answer::Answer;

const STYLE: &str = "body{margin:0;background:#f4f4f2;color:#222;font:16px/1.5 Helvetica,Arial,sans-serif}\
main{max-width:1000px;margin:0 auto;padding:24px}h1{font-size:24px;margin:0 0 4px}h2{font-size:18px;margin:28px 0 8px}\
.answer{font-size:19px;background:#fff;border-left:4px solid #0b62a8;padding:12px 16px}\
table{border-collapse:collapse;background:#fff;margin:0 0 20px}\
th,td{padding:6px 12px;border-bottom:1px solid #e3e3e3;text-align:left;vertical-align:top}td.n{text-align:right;font-variant-numeric:tabular-nums}";

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// The answer as a page.
pub fn text(answer: &Answer, case: &str) -> String {
    let mut out = String::new();
    let title = escape(case);
    // Writing into a String cannot fail.
    let _ = write!(
        out,
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\n<title>{title}</title>\n<style>{STYLE}</style></head>\n<body><main>\n<h1>{title}</h1>\n<p class=\"answer\">{}</p>\n",
        escape(&words::sentence(answer))
    );
    let rivals = words::rivals(answer);
    if !rivals.is_empty() {
        let _ = writeln!(out, "<p>These records cannot tell it from: {}.</p>", escape(&rivals.join(", ")));
    }
    out.push_str("<h2>Error on validation records</h2>\n<table><thead><tr><th>signal</th><th>noise rms</th><th>before</th><th>after</th><th>before, of the signal</th><th>in noise rms</th></tr></thead><tbody>\n");
    for row in words::errors(answer) {
        let cells: String = row.iter().map(|cell| format!("<td class=\"n\">{}</td>", escape(cell))).collect();
        let _ = writeln!(out, "<tr>{cells}</tr>");
    }
    out.push_str("</tbody></table>\n");
    if !answer.effects.is_empty() {
        out.push_str("<h2>Candidates</h2>\n<table><thead><tr><th>effect</th><th>channel</th><th>selected</th><th>improvement (BIC)</th><th>parameters</th><th>why</th></tr></thead><tbody>\n");
        for e in &answer.effects {
            let selected = if e.selected { "yes" } else { "" };
            let _ = writeln!(
                out,
                "<tr><td>{}</td><td>{}</td><td>{selected}</td><td class=\"n\">{:.0}</td><td>{}</td><td>{}</td></tr>",
                escape(&words::name(e)),
                escape(&e.channel),
                e.score,
                escape(&words::parameters(e)),
                escape(&e.reason)
            );
        }
        out.push_str("</tbody></table>\n");
    }
    out.push_str("<h2>Notes</h2>\n<ul>\n");
    for (name, relative, deviation) in &answer.corrections {
        let _ = writeln!(
            out,
            "<li>declared {}: {:+.2} % (&plusmn; {:.2} %)</li>",
            escape(name),
            100.0 * relative,
            196.0 * deviation
        );
    }
    for (id, why) in &answer.not_testable {
        let _ = writeln!(out, "<li>not testable: {}: {}</li>", escape(id), escape(why));
    }
    for note in &answer.notes {
        let _ = writeln!(out, "<li>{}</li>", escape(note));
    }
    out.push_str("</ul>\n</main></body></html>\n");
    out
}
