//! `airloop run --estimate-coupling-error`: options and the table on the terminal.

use std::sync::atomic::AtomicBool;

use clap::Args;

use super::table::table;
use airloop::Error;
use airloop::discrepancy;
use airloop::discrepancy::coupling_error::{self, Goal};
use airloop_cosim::master::simulate::{End, Run};
use airloop_cosim::master::{self, Algorithm};
use airloop_cosim::results::coupling_error::{CouplingErrorRecord, Standing};
use airloop_cosim::system::SystemGraph;
use airloop_report::plot::run::short;

const HEADING: &str = "Coupling error";

/// Options of `--estimate-coupling-error`.
#[derive(Debug, Clone, Args)]
pub struct CouplingErrorArgs {
    /// Estimate what the communication step does to every signal: repeat the run with a half and a quarter of the
    /// step (inputs held as in the run), do the same for the other masters, and recommend the master and step that
    /// reach the goal with the fewest FMU steps. A master costs seven times its run. Also in summary.json, as
    /// coupling_error. For fixed steps only.
    #[arg(long, conflicts_with = "adaptive", help_heading = HEADING)]
    pub estimate_coupling_error: bool,
    /// Error that is good enough, in percent of the RMS of the signal. Default: 0.01.
    #[arg(long, value_name = "PERCENT", requires = "estimate_coupling_error", help_heading = HEADING)]
    pub coupling_goal: Option<f64>,
    /// Signal that has to reach the goal: an output of the system, or component.variable of a connection. May be
    /// repeated. Default: all Real outputs of the system.
    #[arg(long, value_name = "NAME", requires = "estimate_coupling_error", help_heading = HEADING)]
    pub coupling_signal: Vec<String>,
}

impl CouplingErrorArgs {
    /// Target of the estimate, if one is wanted.
    ///
    /// # Errors
    /// A goal out of range, a signal that is not there, or a master without coupling error.
    pub fn goal(&self, graph: &SystemGraph, algorithm: Algorithm) -> Result<Option<Goal>, Error> {
        if !self.estimate_coupling_error {
            return Ok(None);
        }
        if algorithm == Algorithm::Monolithic {
            return Err(discrepancy::Error::NoCoupling.into());
        }
        let percent = self.coupling_goal.unwrap_or(0.01);
        if !(percent > 0.0 && percent < 100.0) {
            let (name, allowed) = ("coupling-goal", "between 0 and 100 (percent)");
            return Err(master::Error::Setting { name, value: percent, allowed }.into());
        }
        Ok(Some(Goal::new(graph, percent / 100.0, &self.coupling_signal)?))
    }
}

/// The estimate; where there is none, a note says why.
pub fn estimate(
    graph: &SystemGraph,
    settings: &master::Settings,
    run: &Run,
    goal: &Goal,
    stop: &AtomicBool,
    notes: &mut Vec<String>,
) -> Option<CouplingErrorRecord> {
    let missing = match (&run.end, run.steps) {
        (End::Completed, 1..) => match coupling_error::investigate(graph, settings, run, goal, stop) {
            Ok(Some(record)) => return Some(record),
            Ok(None) => "interrupted".to_owned(),
            Err(error) => error.to_string(),
        },
        _ => "the run did not reach its stop time".to_owned(),
    };
    notes.push(format!("no estimate of the coupling error: {missing}"));
    None
}

fn percent(value: Option<f64>) -> String {
    value.map_or("signal is 0".into(), short)
}

/// Text that is printed.
pub fn report(record: &CouplingErrorRecord) -> String {
    let signals: Vec<Vec<String>> = record
        .signals
        .iter()
        .map(|signal| {
            let order = signal.order.map_or("none".into(), |order| format!("{order:.2}"));
            let (order, remark) = match signal.standing {
                Standing::Asymptotic => (order, ""),
                Standing::NotAsymptotic => (order, "not in the asymptotic range"),
                Standing::Negligible => ("-".into(), "negligible"),
            };
            vec![
                signal.name.clone(),
                signal.unit.clone().unwrap_or_default(),
                short(signal.rms_error),
                percent(signal.relative_percent),
                order,
                remark.into(),
            ]
        })
        .collect();
    let header = ["signal", "unit", "RMS error", "error [%]", "order", ""];
    let mut text =
        format!("coupling error at {} s, estimated from a half and a quarter of it\n", record.step_size);
    text += &table(&header, &signals, &[2, 3, 4]);
    let masters: Vec<Vec<String>> = record
        .masters
        .iter()
        .map(|master| match &master.problem {
            Some(problem) => {
                vec![master.options.clone(), String::new(), String::new(), String::new(), problem.clone()]
            }
            None => vec![
                master.options.clone(),
                master.fmu_steps.to_string(),
                percent(master.worst_percent),
                master.step_for_goal.map_or("not known".into(), |step| step.to_string()),
                match (&master.worst_signal, master.trusted) {
                    (Some(name), true) => format!("worst in {name}"),
                    (Some(name), false) => format!("worst in {name}; not in the asymptotic range"),
                    (None, _) => String::new(),
                },
            ],
        })
        .collect();
    let header = ["master", "FMU steps", "error [%]", "step for the goal [s]", ""];
    text += &format!(
        "\nmasters at the same step; goal {} % in {}\n{}",
        short(record.goal_percent),
        record.goal_signals.join(", "),
        table(&header, &masters, &[1, 2, 3])
    );
    text + &match &record.recommendation {
        Some(best) => format!(
            "recommended: {} --step {} (about {} FMU steps)\n",
            best.options, best.step_size, best.fmu_steps
        ),
        None => "recommended: a smaller --step and another estimate, as no master is known to reach the goal; or --master monolithic, where all FMUs have Model Exchange\n".into(),
    }
}
