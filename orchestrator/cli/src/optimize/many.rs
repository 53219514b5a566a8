//! Many solves in one command: starts around a guess, and values of a parameter.

use std::sync::atomic::AtomicBool;

use indicatif::ProgressBar;

use super::args::Sweep;
use super::write::status_name;
use crate::table::table;
use airloop::Error;
use airloop_optim::Status;
use airloop_plan::guess::Rough;
use airloop_plan::multistart::{Multistart, multistart};
use airloop_plan::prepare::Prepared;
use airloop_plan::solve::{Settings, Solved};
use airloop_plan::sweep::Step;

/// A table of many solves: the file, and what is printed.
pub struct Table {
    /// File name.
    pub name: &'static str,
    /// Contents of the file.
    pub csv: String,
    /// Text for the terminal.
    pub text: String,
}

/// File of the table of starts.
pub const MULTISTART: &str = "multistart.csv";
/// File of the table of a sweep.
pub const SWEEP: &str = "sweep.csv";

/// Solves from many starts; the best plan and the table of all.
///
/// # Errors
/// Fails if the guess itself cannot be solved.
pub fn starts(
    prepared: &Prepared,
    settings: &Settings,
    guess: &Rough,
    (count, seed): (usize, u64),
    stop: &AtomicBool,
    bar: &ProgressBar,
) -> Result<(Solved, Table), Error> {
    let progress = |done: usize| bar.set_message(format!("{done} of {} starts", count + 1));
    let found = multistart(prepared, settings, guess, (count, seed), stop, &progress)?;
    let table = start_table(&found);
    let best = found.best();
    let mut outcomes = found.outcomes;
    Ok((outcomes.swap_remove(best).solved?, table))
}

fn start_table(found: &Multistart) -> Table {
    let mut csv = "start,status,objective,iterations,minimum\n".to_owned();
    for outcome in &found.outcomes {
        let minimum = outcome.minimum.map_or(String::new(), |minimum| minimum.to_string());
        csv += &match &outcome.solved {
            Ok(solved) => format!(
                "{},{},{},{},{minimum}\n",
                outcome.start,
                status_name(solved.status()),
                solved.last().solution.objective,
                solved.iterations()
            ),
            Err(_) => format!("{},failed,,,\n", outcome.start),
        };
    }
    let rows: Vec<Vec<String>> = found
        .minima
        .iter()
        .enumerate()
        .map(|(number, objective)| {
            let own = found.outcomes.iter().filter(|outcome| outcome.minimum == Some(number + 1));
            vec![(number + 1).to_string(), format!("{objective:.8}"), own.count().to_string()]
        })
        .collect();
    let solved = found.outcomes.iter().filter(|outcome| outcome.minimum.is_some()).count();
    let text = format!(
        "{solved} of {} starts converged, to {} distinct {}\n{}\n",
        found.outcomes.len(),
        found.minima.len(),
        if found.minima.len() == 1 { "minimum" } else { "minima" },
        table(&["minimum", "objective", "starts"], &rows, &[0, 1, 2])
    );
    Table { name: MULTISTART, csv, text }
}

/// Outcomes of a sweep.
pub struct Swept {
    name: String,
    rows: Vec<Row>,
    /// Row of the plan that goes into the files.
    kept: Option<usize>,
}

/// Outcome of one value of a sweep.
struct Row {
    value: f64,
    solved: Result<Figures, String>,
}

/// Figures of a solve.
struct Figures {
    status: &'static str,
    objective: f64,
    iterations: usize,
    max_defect: f64,
    max_bound_violation: f64,
}

impl Swept {
    /// Outcomes of the steps of a sweep.
    pub fn new(sweep: &Sweep, steps: &[Step]) -> Swept {
        let figures = |(_, _, solved): &(Prepared, Rough, Solved)| Figures {
            status: status_name(solved.status()),
            objective: solved.last().solution.objective,
            iterations: solved.iterations(),
            max_defect: solved.max_defect,
            max_bound_violation: solved.max_bound_violation,
        };
        let row = |step: &Step| Row {
            value: step.value,
            solved: step.solved.as_ref().map(figures).map_err(ToString::to_string),
        };
        Swept { name: sweep.name.clone(), rows: steps.iter().map(row).collect(), kept: kept(steps) }
    }

    /// The table; `infeasible`: a closer look at the plan that goes into the files found that no motion keeps the
    /// limits.
    pub fn table(&self, infeasible: bool) -> Table {
        let mut csv = format!("{},status,objective,iterations,max_defect,max_bound_violation\n", self.name);
        let mut rows = Vec::new();
        for (number, Row { value, solved }) in self.rows.iter().enumerate() {
            rows.push(match solved {
                Ok(own) => {
                    let Figures { objective, iterations, max_defect, max_bound_violation, .. } = own;
                    let looked_at = infeasible && self.kept == Some(number);
                    let status = if looked_at { status_name(&Status::Infeasible) } else { own.status };
                    csv += &format!(
                        "{value},{status},{objective},{iterations},{max_defect:e},{max_bound_violation:e}\n"
                    );
                    vec![
                        value.to_string(),
                        status.to_owned(),
                        format!("{objective:.6}"),
                        iterations.to_string(),
                    ]
                }
                Err(error) => {
                    csv += &format!("{value},failed,,,,\n");
                    vec![value.to_string(), error.clone(), String::new(), String::new()]
                }
            });
        }
        let text = table(&[&self.name, "status", "objective", "iterations"], &rows, &[0, 2, 3]) + "\n";
        Table { name: SWEEP, csv, text }
    }
}

/// Values of a sweep, first and last included.
pub fn values(sweep: &Sweep) -> Vec<f64> {
    airloop_plan::sweep::values(sweep.from, sweep.to, sweep.count)
}

/// Place of the last plan of a sweep that was solved, or of the first of all.
fn kept(steps: &[Step]) -> Option<usize> {
    let found = |step: &Step| step.solved.is_ok();
    let finished = |step: &Step| step.solved.as_ref().is_ok_and(|(.., solved)| super::finished(solved));
    steps.iter().rposition(finished).or_else(|| steps.iter().position(found))
}

/// The plan of a sweep that goes into the files.
///
/// # Errors
/// Fails if there is none.
pub fn last(mut steps: Vec<Step>) -> Result<(Prepared, Rough, Solved), Error> {
    let place = kept(&steps).or_else(|| steps.len().checked_sub(1));
    let Some(place) = place else {
        let problem = "it has no value".to_owned();
        return Err(airloop_plan::Error::Place { place: "--sweep".into(), problem }.into());
    };
    Ok(steps.swap_remove(place).solved?)
}
