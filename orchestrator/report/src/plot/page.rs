//! One self-contained page with the figures and numbers of a run.

use std::fmt::Write;

use super::svg::escape;
use airloop_cosim::results::summary::Summary;

/// The page; `figures` are SVG texts, shown in their order.
pub fn page(summary: &Summary, figures: &[String]) -> String {
    let mut html = String::new();
    let title = escape(&summary.system);
    // Writing into a String cannot fail.
    let _ = write!(
        html,
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\n<title>{title}</title>\n<style>{STYLE}</style></head>\n<body><main>\n<h1>{title}</h1>\n"
    );
    let settings = &summary.settings;
    let _ = writeln!(
        html,
        "<p class=\"lead\">{} s to {} s in steps of {} s, master {}, airloop {}: {}.</p>",
        settings.start_time,
        summary.outcome.end_time,
        settings.step_size,
        escape(&settings.master),
        escape(&summary.airloop_version),
        with_code(summary.outcome.message.as_deref().unwrap_or(&summary.outcome.status)),
    );
    if !summary.signals.is_empty() {
        fits(&mut html, summary);
    }
    for figure in figures {
        let _ = writeln!(html, "<figure>{figure}</figure>");
    }
    details(&mut html, summary);
    html.push_str("</main></body></html>\n");
    html
}

/// A text with what stands between backticks as code.
pub(super) fn with_code(text: &str) -> String {
    // The last of an odd number of backticks opens nothing.
    if text.matches('`').count() % 2 == 1 {
        return escape(text);
    }
    let part = |(index, part): (usize, &str)| match index % 2 {
        1 => format!("<code>{}</code>", escape(part)),
        _ => escape(part),
    };
    text.split('`').enumerate().map(part).collect()
}

pub(super) const STYLE: &str = "body{margin:0;background:#f4f4f2;color:#222;font:16px/1.5 Helvetica,Arial,sans-serif}\
main{max-width:1000px;margin:0 auto;padding:24px}h1{font-size:24px;margin:0 0 4px}h2{font-size:18px;margin:28px 0 8px}\
.lead{color:#555;margin:0 0 20px}table{border-collapse:collapse;background:#fff;margin:0 0 20px}\
th,td{padding:6px 14px;border-bottom:1px solid #e3e3e3;text-align:left}td.n,th.n{text-align:right;font-variant-numeric:tabular-nums}\
figure{margin:0 0 20px;background:#fff;border:1px solid #e3e3e3}svg{display:block;width:100%;height:auto}\
@media(max-width:760px){table{display:block;overflow-x:auto}}";

fn fits(html: &mut String, summary: &Summary) {
    html.push_str(
        "<table><thead><tr><th>signal</th><th>unit</th><th class=\"n\">NRMSE fit [%]</th><th class=\"n\">RMS error</th><th class=\"n\">samples</th></tr></thead><tbody>\n",
    );
    for signal in &summary.signals {
        let fit = signal.fit_percent.map_or("constant".into(), |fit| format!("{fit:.2}"));
        let _ = writeln!(
            html,
            "<tr><td>{}</td><td>{}</td><td class=\"n\">{fit}</td><td class=\"n\">{}</td><td class=\"n\">{}</td></tr>",
            escape(&signal.name),
            escape(signal.unit.as_deref().unwrap_or("")),
            super::run::short(signal.rms_error),
            signal.samples
        );
    }
    html.push_str("</tbody></table>\n");
}

fn details(html: &mut String, summary: &Summary) {
    html.push_str("<h2>Components in evaluation order</h2>\n<table><thead><tr><th>component</th><th>model</th><th>GUID</th></tr></thead><tbody>\n");
    for fmu in &summary.fmus {
        let _ = writeln!(
            html,
            "<tr><td>{}</td><td>{}</td><td>{}</td></tr>",
            escape(&fmu.component),
            escape(&fmu.model_name),
            escape(&fmu.guid)
        );
    }
    html.push_str("</tbody></table>\n");
    if !summary.fallbacks.is_empty() {
        html.push_str("<h2>Notes</h2>\n<ul>\n");
        for note in &summary.fallbacks {
            let _ = writeln!(html, "<li>{}</li>", with_code(note));
        }
        html.push_str("</ul>\n");
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn backticks_become_code_where_they_are_pairs() {
        assert_eq!(super::with_code("`a<b` is 1"), "<code>a&lt;b</code> is 1");
        assert_eq!(super::with_code("a ` alone"), "a ` alone");
    }
}
