//! Commands of this program, each in a process and with a folder of its own: `optimize`, `identify`, `refine`.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command as Process, ExitStatus, Stdio};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use super::limit::Limit;
use super::named;
use super::{Outcome, Place, Task, Work};
use crate::Error;
use crate::file::{PlanFile, Quantity};
use crate::table::{Cell, Column, Type};

/// Folder of the tasks in that of the sweep.
const TASKS: &str = "tasks";
/// Output of a command, in its folder.
const LOG: &str = "log.txt";
/// Time between two looks at a process.
const POLL_INTERVAL: Duration = Duration::from_millis(20);
/// Commands that may be tasks.
const COMMANDS: [&str; 6] = ["run", "identify", "optimize", "refine", "stabilize", "trials"];

/// Exit codes of `airloop refine` other than 0 that are no failure.
const VERDICTS: std::ops::RangeInclusive<i32> = 10..=13;

/// Commands of this program.
pub struct Command {
    base: PathBuf,
    words: Vec<String>,
    inputs: Vec<PathBuf>,
    quantities: Vec<Quantity>,
    limit: Limit,
}

impl Command {
    /// Checks the words of the command.
    ///
    /// # Errors
    /// A command that is none of those that may be tasks, or has no `{output}`; quantities without file.
    pub fn open(plan: &PlanFile, base: &Path) -> Result<Command, Error> {
        let wrong = |place: &str, problem: String| Error::Plan { place: place.into(), problem };
        let first = plan.command.first().map_or("", String::as_str);
        if !COMMANDS.contains(&first) {
            return Err(wrong(
                "command",
                format!("`{first}`; it begins with one of: {}", COMMANDS.join(", ")),
            ));
        }
        if !plan.command.iter().any(|word| word.contains("{output}")) {
            return Err(wrong(
                "command",
                "add \"-o\", \"{output}\": each task has a folder of its own".into(),
            ));
        }
        for quantity in &plan.quantities {
            if quantity.file.is_none() || quantity.pointer.is_none() || quantity.signal.is_some() {
                let problem = "a quantity of a command has `file`, a JSON file in its folder, and `pointer`";
                return Err(wrong(&format!("quantity `{}`", quantity.name), problem.into()));
            }
        }
        let given = plan.inputs.iter().map(|path| base.join(path));
        Ok(Command {
            base: base.into(),
            words: plan.command.clone(),
            inputs: named::files(plan, base).into_iter().chain(given).collect(),
            quantities: plan.quantities.clone(),
            limit: Limit::of(plan),
        })
    }

    fn words(&self, task: &Task, output: &Path) -> Vec<String> {
        let replace = |word: &String| {
            let word =
                word.replace("{task}", &task.number.to_string()).replace("{seed}", &task.seed.to_string());
            let word = word.replace("{output}", &output.to_string_lossy());
            task.values
                .iter()
                .fold(word, |word, (name, value)| word.replace(&format!("{{{name}}}"), &value.to_string()))
        };
        self.words.iter().map(replace).collect()
    }

    /// Starts the command and waits for it; the outcome if it has no results, none if all was interrupted.
    fn execute(&self, task: &Task, place: Place, output: &Path) -> Option<Result<(), Outcome>> {
        let failed = |cause: String| Some(Err(Outcome::failed("failed", self.columns().len(), cause)));
        let child = match self.start(task, output) {
            Ok(child) => child,
            Err(error) => return failed(format!("the command cannot be started: {error}")),
        };
        let mut child = Owned(child);
        let began = Instant::now();
        loop {
            match child.0.try_wait() {
                Err(error) => return failed(error.to_string()),
                Ok(Some(status)) if self.is_result(status) => return Some(Ok(())),
                Ok(Some(_)) if place.stop.load(Ordering::Relaxed) => return None,
                Ok(Some(status)) => {
                    let log = std::fs::read_to_string(output.join(LOG)).unwrap_or_default();
                    let last = log.lines().rev().find(|line| line.contains("error")).unwrap_or_default();
                    return failed(format!("{status}; {last}"));
                }
                Ok(None) if place.stop.load(Ordering::Relaxed) => return None,
                Ok(None) if self.limit.is_over(began) => {
                    return Some(Err(self.limit.timeout(self.columns().len())));
                }
                Ok(None) => std::thread::sleep(POLL_INTERVAL),
            }
        }
    }

    /// Whether a command ended with a result; the verdicts of `refine` are exit codes.
    fn is_result(&self, status: ExitStatus) -> bool {
        let verdict = self.words[0] == "refine" && status.code().is_some_and(|code| VERDICTS.contains(&code));
        status.success() || verdict
    }

    fn start(&self, task: &Task, output: &Path) -> std::io::Result<Child> {
        std::fs::create_dir_all(output)?;
        let log = File::create(output.join(LOG))?;
        Process::new(std::env::current_exe()?)
            .args(self.words(task, &output.join("result")))
            .current_dir(&self.base)
            .stdin(Stdio::null())
            .stdout(log.try_clone()?)
            .stderr(log)
            .spawn()
    }

    fn cells(&self, task: &Task, output: &Path) -> Result<Vec<Cell>, String> {
        let mut cells = vec![Cell::Text(format!("{TASKS}/{:06}/result", task.number))];
        for quantity in &self.quantities {
            let file = quantity.file.as_deref().unwrap_or_default();
            let path = output.join("result").join(file);
            let text = std::fs::read_to_string(&path).map_err(|error| format!("{file}: {error}"))?;
            let value: serde_json::Value =
                serde_json::from_str(&text).map_err(|error| format!("{file}: {error}"))?;
            let found = value.pointer(quantity.pointer.as_deref().unwrap_or_default());
            cells.push(match (found, quantity.text) {
                (None | Some(serde_json::Value::Null), _) => Cell::Empty,
                (Some(serde_json::Value::String(text)), true) if text.is_empty() => Cell::Empty,
                (Some(serde_json::Value::String(text)), true) => Cell::Text(text.clone()),
                (Some(other), true) => Cell::Text(other.to_string()),
                (Some(other), false) => Cell::Number(other.as_f64().ok_or_else(|| {
                    format!("quantity `{}`: {other} is no number; add `text = true`", quantity.name)
                })?),
            });
        }
        Ok(cells)
    }
}

/// A process that ends with its owner.
struct Owned(Child);

impl Drop for Owned {
    fn drop(&mut self) {
        // Both fail only where it has ended and was waited for.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Work for Command {
    fn columns(&self) -> Vec<Column> {
        let kind = |one: &Quantity| if one.text { Type::Text } else { Type::Number };
        let quantities = self.quantities.iter().map(|one| Column::new(&one.name, kind(one)));
        std::iter::once(Column::new("folder", Type::Text)).chain(quantities).collect()
    }

    fn inputs(&self) -> Vec<PathBuf> {
        self.inputs.clone()
    }

    fn check(&self, task: &Task) -> Result<(), Error> {
        let words = self.words(task, Path::new("out"));
        match words.iter().find(|word| word.contains('{') && word.contains('}')) {
            None => Ok(()),
            Some(word) => Err(Error::Plan {
                place: "command".into(),
                problem: format!(
                    "`{word}`: the name in braces is none of task, seed, output and the factors"
                ),
            }),
        }
    }

    fn run(&self, task: &Task, place: Place) -> Option<Outcome> {
        let output = place.folder.join(TASKS).join(format!("{:06}", task.number));
        // Relative paths in the words begin at the plan, the folder of the sweep at the caller.
        let output = std::path::absolute(&output).unwrap_or(output);
        match self.execute(task, place, &output)? {
            Err(outcome) => Some(outcome),
            Ok(()) => match self.cells(task, &output) {
                Ok(cells) => Some(Outcome::ok(cells)),
                Err(cause) => Some(Outcome::failed("failed", self.columns().len(), cause)),
            },
        }
    }
}
