//! Text that `airloop run` prints: the run in one line, the fits, the notes, where the files are.

use super::args::RunArgs;
use super::coupling;
use super::table::table;
use airloop_cosim::results::summary::Summary;
use airloop_report::plot::run::short;

/// Text that is printed after a run.
pub fn report(summary: &Summary, args: &RunArgs) -> String {
    let (start, end) = (summary.settings.start_time, summary.outcome.end_time);
    let steps = match summary.outcome.steps {
        1 => format!("1 step of {} s", summary.settings.step_size.min(end - start)),
        steps if summary.adaptive.is_some() => format!("{steps} steps"),
        steps => format!("{steps} steps of {} s", summary.settings.step_size),
    };
    let mut text = format!(
        "{}: {start} s to {end} s, {steps} ({}), {} s, {} steps/s\n",
        summary.system,
        summary.settings.master,
        short(summary.timings.simulation_s),
        summary.timings.steps_per_second.round(),
    );
    if let Some(work) = &summary.integration {
        text += &format!(
            "integrator: {} steps, {} rejected, {} evaluations, {} events\n",
            work.steps,
            work.rejected_steps,
            work.evaluations,
            work.time_events + work.state_events + work.input_events,
        );
    }
    if let Some(adaptive) = &summary.adaptive {
        text += &format!(
            "adaptive: {} steps, {} rejected, {} FMU steps, communication steps of {} s to {} s\n",
            adaptive.accepted,
            adaptive.rejected,
            summary.effort.fmu_steps,
            short(adaptive.smallest_step.unwrap_or_default()),
            short(adaptive.largest_step.unwrap_or_default()),
        );
    }
    if summary.outcome.status == "terminated" {
        text += &format!("{}\n", summary.outcome.message.as_deref().unwrap_or_default());
    }
    if !summary.signals.is_empty() {
        let rows: Vec<Vec<String>> = summary
            .signals
            .iter()
            .map(|signal| {
                vec![
                    signal.name.clone(),
                    signal.unit.clone().unwrap_or_default(),
                    fit_text(signal.fit_percent),
                    short(signal.rms_error),
                ]
            })
            .collect();
        text += &format!("\n{}\n", table(&["signal", "unit", "fit [%]", "RMS error"], &rows, &[2, 3]));
    }
    if let Some(record) = &summary.coupling_error {
        if summary.signals.is_empty() {
            text.push('\n');
        }
        text += &format!("{}\n", coupling::report(record));
    }
    for note in &summary.fallbacks {
        text += &format!("note: {note}\n");
    }
    text += &format!("result:  {}\n", args.output.join("result.csv").display());
    if !args.no_plots {
        text += &format!("figures: {}\n", args.output.join("index.html").display());
    }
    text
}

/// A fit with two digits; far below zero the digits say nothing.
fn fit_text(fit: Option<f64>) -> String {
    match fit {
        None => "constant".into(),
        Some(fit) if fit < -1e6 => "< -1e6".into(),
        Some(fit) => format!("{fit:.2}"),
    }
}
