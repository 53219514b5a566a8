//! `report.md`.

use std::fmt::Write;

use super::words;
use crate::refine::answer::Answer;

/// The answer as Markdown.
pub fn text(answer: &Answer, case: &str) -> String {
    let mut out = String::new();
    // Writing into a String cannot fail.
    let _ = writeln!(out, "# {case}\n\n{}\n", words::sentence(answer));
    let rivals = words::rivals(answer);
    if !rivals.is_empty() {
        let _ = writeln!(out, "These records cannot tell it from: {}.\n", rivals.join(", "));
    }
    let _ = writeln!(
        out,
        "| signal | noise rms | error before | error after | before, of the signal | in noise rms |\n|---|---|---|---|---|---|"
    );
    for row in words::errors(answer) {
        let _ = writeln!(out, "| {} |", row.join(" | "));
    }
    let _ = writeln!(
        out,
        "\nErrors are rms on validation records in the unit of the signal, simulated over the whole record.\n"
    );
    if !answer.effects.is_empty() {
        let _ = writeln!(
            out,
            "| candidate | channel | selected | improvement (BIC) | parameters | why |\n|---|---|---|---|---|---|"
        );
        for e in &answer.effects {
            let selected = if e.selected { "yes" } else { "no" };
            let _ = writeln!(
                out,
                "| {} | {} | {selected} | {:.0} | {} | {} |",
                words::name(e),
                e.channel,
                e.score,
                words::parameters(e),
                e.reason
            );
        }
        out.push('\n');
    }
    for (name, relative, deviation) in &answer.corrections {
        let _ =
            writeln!(out, "- declared {name}: {:+.2} % (+- {:.2} %)", 100.0 * relative, 196.0 * deviation);
    }
    for (id, why) in &answer.not_testable {
        let _ = writeln!(out, "- not testable: {id}: {why}");
    }
    for note in &answer.notes {
        let _ = writeln!(out, "- {note}");
    }
    out
}
