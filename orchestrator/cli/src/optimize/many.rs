//! Many solves in one command: starts around a guess, and values of a parameter.

use std::sync::atomic::AtomicBool;

use indicatif::ProgressBar;

use super::args::Sweep;
use super::write::status_name;
use crate::table::table;
use airloop::Error;
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
        "{solved} of {} starts converged, to {} distinct minima\n{}\n",
        found.outcomes.len(),
        found.minima.len(),
        table(&["minimum", "objective", "starts"], &rows, &[0, 1, 2])
    );
    Table { name: MULTISTART, csv, text }
}

/// The table of a sweep.
pub fn sweep_table(sweep: &Sweep, steps: &[Step]) -> Table {
    let mut csv = format!("{},status,objective,iterations,max_defect,max_bound_violation\n", sweep.name);
    let mut rows = Vec::new();
    for step in steps {
        let value = step.value;
        let (status, objective, iterations) = match &step.solved {
            Ok((_, _, solved)) => {
                let objective = solved.last().solution.objective;
                csv += &format!(
                    "{value},{},{objective},{},{:e},{:e}\n",
                    status_name(solved.status()),
                    solved.iterations(),
                    solved.max_defect,
                    solved.max_bound_violation
                );
                (
                    status_name(solved.status()).to_owned(),
                    format!("{objective:.6}"),
                    solved.iterations().to_string(),
                )
            }
            Err(error) => {
                csv += &format!("{value},failed,,,,\n");
                (error.to_string(), String::new(), String::new())
            }
        };
        rows.push(vec![format!("{value}"), status, objective, iterations]);
    }
    let text = table(&[&sweep.name, "status", "objective", "iterations"], &rows, &[0, 2, 3]) + "\n";
    Table { name: SWEEP, csv, text }
}

/// Values of a sweep, first and last included.
pub fn values(sweep: &Sweep) -> Vec<f64> {
    airloop_plan::sweep::values(sweep.from, sweep.to, sweep.count)
}

/// The last plan of a sweep that was solved, or the last of all.
///
/// # Errors
/// Fails if there is none.
pub fn last(steps: Vec<Step>) -> Result<(Prepared, Rough, Solved), Error> {
    let mut kept: Option<(Prepared, Rough, Solved)> = None;
    let mut failure = None;
    for step in steps {
        match step.solved {
            Ok(found) if kept.is_none() || super::finished(&found.2) => kept = Some(found),
            Ok(_) => {}
            Err(error) => failure = Some(error),
        }
    }
    match (kept, failure) {
        (Some(kept), _) => Ok(kept),
        (None, Some(error)) => Err(error.into()),
        (None, None) => {
            let problem = "it has no value".to_owned();
            Err(airloop_plan::Error::Place { place: "--sweep".into(), problem }.into())
        }
    }
}
