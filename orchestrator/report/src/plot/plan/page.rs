//! The page of a plan: what came out, the motion, the figures, every solve.

use std::fmt::Write;

use super::Plan;
use super::animation::animation;
use super::stick::moving;
use crate::plot::page::{STYLE, with_code};
use crate::plot::run::short;
use crate::plot::svg::escape;

const MORE_STYLE: &str = ".animation{background:#fff;border:1px solid #e3e3e3;margin:0 0 20px;padding:8px 12px}\
canvas{width:100%;height:auto;display:block}.animation p{display:flex;gap:12px;align-items:center;margin:4px 0}\
.animation input{flex:1}.problem{background:#fff;border-left:4px solid #b23a2e;padding:10px 14px}";

/// The page; `figures` are SVG texts, shown in their order.
pub(super) fn page(plan: &Plan, figures: &[String]) -> String {
    let summary = &plan.summary;
    let title = escape(&summary.problem);
    let mut html = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\n\
         <title>{title}</title>\n<style>{STYLE}{MORE_STYLE}</style></head>\n<body><main>\n<h1>{title}</h1>\n"
    );
    // Writing into a String cannot fail.
    let _ = writeln!(
        html,
        "<p class=\"lead\">{}, {} intervals, from the guess <code>{}</code>, airloop {}: {}.</p>",
        escape(&summary.transcription),
        summary.intervals.iter().map(usize::to_string).collect::<Vec<_>>().join(" + "),
        escape(&summary.guess),
        escape(&summary.airloop_version),
        with_code(&summary.message),
    );
    for problem in [&summary.worst, &summary.blocking].into_iter().flatten() {
        let _ = writeln!(html, "<p class=\"problem\">{}</p>", with_code(problem));
    }
    html += &animation(plan);
    html += &moving(plan);
    numbers(&mut html, plan);
    for figure in figures {
        let _ = writeln!(html, "<figure>{figure}</figure>");
    }
    final_errors(&mut html, plan);
    passes(&mut html, plan);
    if !summary.notes.is_empty() {
        html.push_str("<h2>Notes</h2>\n<ul>\n");
        for note in &summary.notes {
            let _ = writeln!(html, "<li>{}</li>", with_code(note));
        }
        html.push_str("</ul>\n");
    }
    html.push_str("</main></body></html>\n");
    html
}

fn row(html: &mut String, name: &str, value: &str) {
    let _ = writeln!(html, "<tr><td>{name}</td><td class=\"n\">{}</td></tr>", escape(value));
}

fn numbers(html: &mut String, plan: &Plan) {
    let summary = &plan.summary;
    html.push_str("<table><tbody>\n");
    if let Some(objective) = summary.objective {
        row(html, "objective", &format!("{objective:.8}"));
    }
    let durations: Vec<String> = summary.durations.iter().map(|time| format!("{} s", short(*time))).collect();
    row(html, "duration", &durations.join(" + "));
    row(html, "iterations", &summary.iterations.to_string());
    row(html, "largest defect", &short(summary.max_defect));
    row(html, "largest violation of a bound at the nodes", &short(summary.max_bound_violation));
    if let Some(error) = &summary.open_loop_final_error {
        for (name, error) in [("continuous", error.continuous), ("sampled", error.sampled)] {
            if let Some(error) = error {
                row(html, &format!("final error of the roll-out, {name}"), &short(error));
            }
        }
    }
    let time = &summary.time;
    let parts = format!(
        "{} s (load {}, build {}, solve {}, roll-outs {})",
        short(time.total),
        short(time.load),
        short(time.build),
        short(time.solve),
        short(time.verify)
    );
    row(html, "time", &parts);
    html.push_str("</tbody></table>\n");
}

fn final_errors(html: &mut String, plan: &Plan) {
    let Some(errors) = &plan.summary.open_loop_final_state_error else { return };
    html.push_str(
        "<h2>Where the roll-outs end, less where the plan ends</h2>\n<table><thead><tr><th>state</th><th>unit</th>\
         <th class=\"n\">continuous</th><th class=\"n\">sampled</th></tr></thead><tbody>\n",
    );
    for signal in plan.summary.signals.iter().filter(|signal| signal.kind == "state") {
        let of = |errors: &Option<std::collections::BTreeMap<String, f64>>| {
            let error = errors.as_ref().and_then(|errors| errors.get(&signal.name));
            error.map_or(String::new(), |error| short(*error))
        };
        let _ = writeln!(
            html,
            "<tr><td>{}</td><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td></tr>",
            escape(&signal.name),
            escape(signal.unit.as_deref().unwrap_or("")),
            of(&errors.continuous),
            of(&errors.sampled)
        );
    }
    html.push_str("</tbody></table>\n");
}

fn passes(html: &mut String, plan: &Plan) {
    html.push_str(
        "<h2>Solves</h2>\n<table><thead><tr><th>transcription</th><th class=\"n\">intervals</th><th>status</th>\
         <th class=\"n\">objective</th><th class=\"n\">iterations</th><th class=\"n\">time [s]</th></tr></thead><tbody>\n",
    );
    for pass in &plan.summary.passes {
        let _ = writeln!(
            html,
            "<tr><td>{}</td><td class=\"n\">{}</td><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td></tr>",
            escape(&pass.transcription),
            pass.intervals.iter().map(usize::to_string).collect::<Vec<_>>().join(" + "),
            escape(&pass.status),
            pass.objective.map_or(String::new(), |objective| format!("{objective:.8}")),
            pass.iterations,
            short(pass.time)
        );
    }
    html.push_str("</tbody></table>\n<p>Every iteration is in iterations.csv.</p>\n");
}
