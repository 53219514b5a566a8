//! Text that `airloop optimize` prints: how it ended, what came out, where the files are.

use std::path::Path;

use crate::table::table;
use airloop_optim::Note;
use airloop_plan::cycle::Closure;
use airloop_plan::file::transcription_name;
use airloop_plan::recheck::{Kept, Recheck};
use airloop_plan::record::Summary;
use airloop_plan::solve::Progress;
use airloop_report::plot::run::short;

/// Error of the open-loop roll-out in words: every state with its unit.
fn gap(summary: &Summary, errors: &std::collections::BTreeMap<String, f64>) -> String {
    let states = summary.signals.iter().filter(|signal| signal.kind == "state");
    let one = |signal: &airloop_plan::record::SignalRecord| {
        let error = errors.get(&signal.name)?;
        let unit = signal
            .unit
            .as_deref()
            .filter(|unit| *unit != "1")
            .map_or(String::new(), |unit| format!(" {unit}"));
        Some(format!("{} {}{unit}", signal.name, short(*error)))
    };
    states.filter_map(one).collect::<Vec<_>>().join(", ")
}

/// Accuracy with which actuators deliver the forces, and the motion that follows, in words.
fn delivered(summary: &Summary) -> String {
    let mut text = String::new();
    for (force, fits) in summary.stage2.iter().flat_map(|stage| &stage.fit) {
        let one = |(kind, fit): (&String, &Option<f64>)| {
            fit.map_or_else(|| format!("{kind} constant"), |fit| format!("{kind} {fit:.2} %"))
        };
        let fits: Vec<String> = fits.iter().map(one).collect();
        text += &format!("fit of the delivered force {force}: {}\n", fits.join(", "));
    }
    for (kind, chain) in summary.closed_chain.iter().flatten() {
        text += &match &chain.problem {
            None => {
                format!(
                    "closed chain, {kind} command: completed, off by at most {}\n",
                    short(chain.max_final_error)
                )
            }
            Some(problem) => {
                format!("closed chain, {kind} command: ended at {} s: {problem}\n", short(chain.end))
            }
        };
    }
    text
}

/// How a motion that repeats itself closes, in words.
fn closed(closure: &Closure) -> String {
    let mut text = format!("cycle: the plan closes to {}", short(closure.plan));
    if let Some(rolled) = &closure.rollout {
        let worst = rolled.iter().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        text += &worst.map_or_else(String::new, |(name, off)| {
            format!(", its continuous roll-out to {} ({name})", short(off.abs()))
        });
    }
    let advance = closure.advance.iter().map(|(name, by)| format!("; {name} advances by {}", short(*by)));
    text + &advance.collect::<String>() + "\n"
}

/// Limits that the roll-out violates, and when the events happen that end phases, in words.
fn rechecked(recheck: &Recheck) -> String {
    let mut text = String::new();
    for end in &recheck.phase_ends {
        if let Some(late) = end.late {
            text +=
                &format!("roll-out: phase `{}` ends {} s after its planned time\n", end.phase, short(late));
        }
    }
    let violated: Vec<&Kept> =
        recheck.limits.iter().filter(|limit| limit.margin < -MAX_VIOLATION_OF_KEPT_LIMIT).collect();
    for limit in &violated {
        text += &format!(
            "roll-out: phase `{}` violates `{}` by {} {} at t = {} s\n",
            limit.phase,
            limit.limit,
            short(-limit.margin),
            limit.unit.as_deref().unwrap_or(""),
            short(limit.time)
        );
    }
    if violated.is_empty() && !recheck.limits.is_empty() {
        text += "roll-out: keeps all limits between the nodes as well\n";
    }
    if let Some(forces) = &recheck.forces {
        text += &format!(
            "forces from the energy by Lagrange's equations: differ by at most {} of {} ({})\n",
            short(forces.largest_difference),
            short(forces.largest_force),
            forces.force
        );
    }
    text
}

/// Violations of less than this, in their own units, are those of the discretization.
const MAX_VIOLATION_OF_KEPT_LIMIT: f64 = 1e-6;

/// A row of the iteration table; the first of every solve comes with the heading.
pub fn iteration(progress: &Progress) -> String {
    let row = progress.iteration;
    let heading = match row.number {
        0 => format!(
            "{} with {} intervals\n  iter       objective  violation optimality    barrier       step  length\n",
            transcription_name(progress.pass.transcription),
            progress.pass.intervals.iter().sum::<usize>()
        ),
        _ => String::new(),
    };
    let note = match row.note {
        Note::None => "",
        Note::SecondOrderCorrection => "  corrected",
        Note::Restoration => "  restoration",
        Note::QuadraticProgram => "  quadratic program",
    };
    format!(
        "{heading}{:6} {:15.8e} {:10.2e} {:10.2e} {:10.2e} {:10.2e} {:7.4}{note}",
        row.number,
        row.objective,
        row.violation,
        row.dual_infeasibility,
        row.barrier,
        row.step,
        row.step_length
    )
}

/// Text that is printed at the end; `refused`: how the search ended goes to the standard error.
pub fn report(summary: &Summary, folder: &Path, plots: bool, refused: bool) -> String {
    let intervals: Vec<String> = summary.intervals.iter().map(usize::to_string).collect();
    let mut text = format!(
        "{}: {} with {} intervals from guess {}\n",
        summary.problem,
        summary.transcription,
        intervals.join(" + "),
        summary.guess
    );
    let ended = [Some(&summary.message), summary.worst.as_ref()].map(|line| line.filter(|_| !refused));
    for line in ended.into_iter().chain([summary.blocking.as_ref()]).flatten() {
        text += &format!("{line}\n");
    }
    if let Some(objective) = summary.objective {
        text += &format!("objective {objective:.8}");
    }
    let durations: Vec<String> = summary.durations.iter().map(|time| format!("{} s", short(*time))).collect();
    text += &format!(
        ", duration {}, {} iterations, largest defect {}, largest violation at the nodes {}\n",
        durations.join(" + "),
        summary.iterations,
        short(summary.max_defect),
        short(summary.max_bound_violation)
    );
    if summary.passes.len() > 1 {
        let rows: Vec<Vec<String>> = summary
            .passes
            .iter()
            .map(|pass| {
                vec![
                    pass.transcription.clone(),
                    pass.intervals.iter().map(usize::to_string).collect::<Vec<_>>().join(" + "),
                    pass.status.clone(),
                    pass.objective.map_or(String::new(), |objective| format!("{objective:.6}")),
                    pass.iterations.to_string(),
                    format!("{:.3}", pass.time),
                ]
            })
            .collect();
        let header = ["transcription", "intervals", "status", "objective", "iterations", "time [s]"];
        text += &format!("\n{}\n", table(&header, &rows, &[1, 3, 4, 5]));
    }
    if let Some(errors) = &summary.open_loop_final_state_error {
        for (name, errors) in [("continuous", &errors.continuous), ("sampled", &errors.sampled)] {
            if let Some(errors) = errors {
                text += &format!("roll-out, {name}: ends off by {}\n", gap(summary, errors));
            }
        }
    }
    text += &summary.cycle.as_ref().map_or_else(String::new, closed);
    text += &summary.recheck.as_ref().map_or_else(String::new, rechecked);
    text += &delivered(summary);
    let time = &summary.time;
    text += &format!(
        "time: {:.3} s: load {:.3}, build {:.3}, solve {:.3}, roll-outs {:.3}\n",
        time.total, time.load, time.build, time.solve, time.verify
    );
    for note in &summary.notes {
        text += &format!("note: {note}\n");
    }
    text += &format!("command: {}\n", folder.join("command.csv").display());
    if plots {
        text += &format!("figures: {}\n", folder.join("index.html").display());
    }
    text
}
