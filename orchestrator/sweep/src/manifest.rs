//! The manifest of a sweep: the plan, its tasks as rules, and the content of everything that they read.
//!
//! Tasks are not listed: values and seed of a task follow from its number, so that a million of them are planned at
//! once and any machine can begin anywhere.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use airloop_series::random::Random;
use serde::{Deserialize, Serialize};

use crate::digest;
use crate::file::{Factor, Kind, Method, PlanFile, Sample, Scale};
use crate::follow;
use crate::sample::{Design, Range, Value};
use crate::table::{Cell, Column, Type};
use crate::task;
use crate::{Error, Task};

/// File of the manifest.
pub const MANIFEST: &str = "manifest.json";
/// Version of the manifest.
const SCHEMA_VERSION: u32 = 1;

/// Content of an input.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Input {
    /// Path, relative to the folder of the plan where it lies in it.
    pub path: PathBuf,
    /// SHA-256.
    pub sha256: String,
}

/// The program that made the plan.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Program {
    /// Version.
    pub version: String,
    /// SHA-256 of the executable file.
    pub sha256: String,
}

impl Program {
    /// This program.
    ///
    /// # Errors
    /// Its file cannot be read.
    pub fn this() -> Result<Program, Error> {
        // It is the program that runs, also where its file is replaced meanwhile.
        static THIS: OnceLock<Program> = OnceLock::new();
        if let Some(program) = THIS.get() {
            return Ok(program.clone());
        }
        let path = std::env::current_exe().map_err(Error::io(Path::new("this program")))?;
        let program = Program { version: env!("CARGO_PKG_VERSION").into(), sha256: digest::of_path(&path)? };
        Ok(THIS.get_or_init(|| program).clone())
    }
}

/// `manifest.json`
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Manifest {
    schema_version: u32,
    /// Content of all that decides the results; every shard carries it.
    pub digest: String,
    /// Program.
    pub program: Program,
    /// Folder of the plan, which relative paths begin at.
    pub base: PathBuf,
    /// Text of the plan.
    pub plan: String,
    /// Inputs.
    pub inputs: Vec<Input>,
    /// Number of tasks.
    pub tasks: u64,
    /// Columns of the results.
    pub columns: Vec<Column>,
    /// Columns of the signals that are kept of every task, time first; none if no signals are kept.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub signals: Vec<Column>,
    /// Number of shards, unless a run asks for another.
    pub shards: u64,
}

impl Manifest {
    /// Plans the tasks of a file and checks that the first could run.
    ///
    /// # Errors
    /// A plan that cannot be read, names that the system does not have, inputs that are not there.
    pub fn plan(file: &Path) -> Result<Manifest, Error> {
        let plan = airloop_series::file::read_to_string(file).map_err(Error::io(file))?;
        let base = std::path::absolute(file).map_err(Error::io(file))?;
        let base = base.parent().unwrap_or(Path::new("/")).to_owned();
        let parsed = PlanFile::parse(&plan, file)?;
        let design = design(&parsed, &base)?;
        let work = task::open(&parsed, &base)?;
        work.check(&first(&parsed, &design))?;
        let mut columns = vec![Column::new("task", Type::Integer), Column::new("seed", Type::Integer)];
        columns.extend(work.factor_columns(&factor_columns(&parsed, &design)));
        columns.extend(work.columns());
        columns.extend([Column::new("status", Type::Text), Column::new("cause", Type::Text)]);
        if let Some(twice) =
            columns.iter().enumerate().find(|(k, one)| columns[..*k].iter().any(|c| c.name == one.name))
        {
            let problem = "this name is taken twice; the table also has task, seed, status and cause".into();
            return Err(Error::Plan { place: format!("column `{}`", twice.1.name), problem });
        }
        let mut inputs = Vec::new();
        for path in follow::follow(work.inputs(), &base)? {
            let sha256 = digest::of_path(&path)?;
            inputs.push(Input { path: path.strip_prefix(&base).unwrap_or(&path).into(), sha256 });
        }
        inputs.sort_by(|a, b| a.path.cmp(&b.path));
        inputs.dedup();
        let tasks = match parsed.kind {
            Kind::Trials => work.count().unwrap_or(0),
            _ => design.count(),
        };
        let program = Program::this()?;
        let mut manifest = Manifest {
            schema_version: SCHEMA_VERSION,
            digest: String::new(),
            program,
            base,
            plan,
            inputs,
            tasks,
            columns,
            signals: work.signals(),
            shards: parsed.shards.unwrap_or(1).clamp(1, tasks.max(1)),
        };
        manifest.digest = manifest.content();
        Ok(manifest)
    }

    /// SHA-256 of plan, program, inputs and tasks; neither of the folder nor of the shards.
    fn content(&self) -> String {
        let inputs: Vec<String> =
            self.inputs.iter().map(|one| format!("{} {}", one.path.display(), one.sha256)).collect();
        let (version, program) = (self.schema_version, &self.program);
        digest::of_text(&format!(
            "{version}\n{} {}\n{}\n{}\n{}",
            program.version,
            program.sha256,
            self.tasks,
            inputs.join("\n"),
            self.plan
        ))
    }

    /// Reads the manifest of a folder.
    ///
    /// # Errors
    /// [`Error::NoManifest`]; [`Error::File`] if it is none, or was edited.
    pub fn read(folder: &Path) -> Result<Manifest, Error> {
        let file = folder.join(MANIFEST);
        let text = match airloop_series::file::read_to_string(&file) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                return Err(Error::NoManifest { folder: folder.into() });
            }
            read => read.map_err(Error::io(&file))?,
        };
        let wrong = |problem: String| Error::File { file: file.clone(), problem };
        let manifest: Manifest = serde_json::from_str(&text).map_err(|error| {
            wrong(format!("this is no manifest of `airloop sweep plan`: {error}; give another folder with -o, or plan again"))
        })?;
        if manifest.content() != manifest.digest {
            return Err(wrong("it was edited; plan again".into()));
        }
        Ok(manifest)
    }

    /// Writes the manifest into a folder, which is made; a folder with the same sweep stays as it is.
    ///
    /// # Errors
    /// [`Error::OtherSweep`], [`Error::Io`].
    pub fn write(&self, folder: &Path) -> Result<(), Error> {
        if folder.join(MANIFEST).exists() {
            let found = Manifest::read(folder)?;
            return match found.digest == self.digest {
                true => Ok(()),
                false => Err(Error::OtherSweep {
                    folder: folder.into(),
                    found: short(&found.digest),
                    wanted: short(&self.digest),
                }),
            };
        }
        std::fs::create_dir_all(folder).map_err(Error::io(folder))?;
        let file = folder.join(MANIFEST);
        airloop_series::file::write_json(&file, self).map_err(Error::io(&file))
    }

    /// Checks that inputs and program are those of the plan.
    ///
    /// # Errors
    /// [`Error::Changed`], [`Error::Program`], or [`Error::Io`] for an input that is gone.
    pub fn check(&self) -> Result<(), Error> {
        let name = |program: &Program| format!("{}, {}", program.version, short(&program.sha256));
        let this = Program::this()?;
        if this != self.program {
            return Err(Error::Program { planned: name(&self.program), found: name(&this) });
        }
        for input in &self.inputs {
            let path = self.base.join(&input.path);
            let found = digest::of_path(&path)?;
            if found != input.sha256 {
                return Err(Error::Changed { path, planned: short(&input.sha256), found: short(&found) });
            }
        }
        Ok(())
    }

    /// The plan as its author wrote it.
    ///
    /// # Errors
    /// Same as [`PlanFile::parse`].
    pub fn file(&self) -> Result<PlanFile, Error> {
        PlanFile::parse(&self.plan, Path::new(MANIFEST))
    }
}

/// The first digits of a SHA-256.
pub fn short(sha256: &str) -> String {
    sha256.chars().take(12).collect()
}

/// Rules that give a task from its number.
#[derive(Debug)]
pub struct Tasks {
    design: Design,
    names: Vec<String>,
    seed: u64,
    /// Number of consecutive seeds that tasks have in turn; trials only.
    counted: Option<u64>,
}

impl Tasks {
    /// Rules of a plan.
    ///
    /// # Errors
    /// Factors that make no design.
    pub fn new(plan: &PlanFile, base: &Path) -> Result<Tasks, Error> {
        Ok(Tasks {
            design: design(plan, base)?,
            names: plan.factors.iter().map(|factor| factor.name.clone()).collect(),
            seed: plan.seed,
            counted: plan
                .trials
                .as_ref()
                .filter(|_| plan.kind == Kind::Trials)
                .map(|trials| trials.count.max(1)),
        })
    }

    /// A task.
    pub fn task(&self, number: u64) -> Task {
        let seed = match self.counted {
            Some(count) => self.seed.wrapping_add(number % count),
            None => Random::numbered(self.seed, number).bits(),
        };
        let values = if self.counted.is_some() { Vec::new() } else { self.design.point(number) };
        Task { number, seed, values: self.names.iter().cloned().zip(values).collect() }
    }
}

/// Cells of a row before the results.
pub fn leading_cells(task: &Task) -> Vec<Cell> {
    let value = |(_, value): &(String, Value)| match value {
        Value::Number(number) => Cell::Number(*number),
        Value::Text(text) => Cell::Text(text.clone()),
    };
    [Cell::Integer(task.number), Cell::Integer(task.seed)]
        .into_iter()
        .chain(task.values.iter().map(value))
        .collect()
}

fn first(plan: &PlanFile, design: &Design) -> Task {
    let names = plan.factors.iter().map(|factor| factor.name.clone());
    Task { number: 0, seed: plan.seed, values: names.zip(design.point(0)).collect() }
}

fn factor_columns(plan: &PlanFile, design: &Design) -> Vec<Column> {
    let kind = |factor: usize| match design.is_text(factor) {
        true => Type::Text,
        false => Type::Number,
    };
    plan.factors.iter().enumerate().map(|(k, factor)| Column::new(&factor.name, kind(k))).collect()
}

fn design(plan: &PlanFile, base: &Path) -> Result<Design, Error> {
    let ranges = plan.factors.iter().map(|factor| range(factor, base)).collect::<Result<Vec<_>, _>>()?;
    let sample = plan.sample.clone().unwrap_or(Sample { method: Method::Grid, count: 1 });
    Design::new(ranges, sample.method, sample.count, plan.seed)
}

fn range(factor: &Factor, base: &Path) -> Result<Range, Error> {
    let wrong = |problem: &str| {
        Err(Error::Plan { place: format!("factor `{}`", factor.name), problem: problem.into() })
    };
    match (&factor.values, (factor.from, factor.to), &factor.entries_of) {
        (Some(values), (None, None), None) => {
            let listed: Vec<Value> = values.iter().map(value).collect();
            let numbers = listed.iter().filter(|value| matches!(value, Value::Number(_))).count();
            match numbers {
                _ if listed.is_empty() => wrong("`values` is empty"),
                0 => Ok(Range::Listed(listed)),
                _ if numbers == listed.len() => Ok(Range::Listed(listed)),
                _ => wrong("`values` has numbers and texts; write all of them as texts"),
            }
        }
        (None, (Some(from), Some(to)), None) => match factor.scale {
            _ if !(from.is_finite() && to.is_finite()) => wrong("the limits are not finite"),
            Scale::Log if !(from > 0.0 && to > 0.0) => wrong("with scale = \"log\" both limits are positive"),
            scale => {
                let levels = factor.levels.unwrap_or(2);
                match levels {
                    0 => wrong("`levels` is 0"),
                    _ => Ok(Range::Between { limits: (from, to), scale, levels }),
                }
            }
        },
        (None, (None, None), Some(folder)) => {
            let entries = digest::entries(&base.join(folder))?;
            let name = |path: &PathBuf| {
                Value::Text(path.strip_prefix(base).unwrap_or(path).to_string_lossy().into_owned())
            };
            match entries.is_empty() {
                true => wrong("the folder of `entries_of` is empty"),
                false => Ok(Range::Listed(entries.iter().map(name).collect())),
            }
        }
        _ => wrong("give either `values`, or `from` and `to`, or `entries_of`"),
    }
}

fn value(value: &toml::Value) -> Value {
    match value {
        toml::Value::Integer(number) => Value::Number(*number as f64),
        toml::Value::Float(number) => Value::Number(*number),
        toml::Value::String(text) => Value::Text(text.clone()),
        other => Value::Text(other.to_string()),
    }
}
