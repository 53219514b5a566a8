//! `airloop refine`: what a declared model lacks, from measured records.
//!
//! Exit codes: 0 effect found, 10 nothing missing, 11 unexplained, 12 effect found that the records cannot tell from
//! others, 13 a law found that no list holds; 1, 2 and 130 as everywhere.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use clap::{Args as ClapArgs, ValueEnum};

use super::refine_progress::{Interrupt, Progress};
use super::{folder, output};
use airloop::Error;
use airloop::relative_path::relative_path;
use airloop_fmi::template_folder::VARIABLE;
use airloop_refine::amend;
use airloop_refine::answer::{Answer, Settings, Verdict, WARNING};
use airloop_refine::case::{Case, Role};
use airloop_refine::engine::parallel;
use airloop_refine::engine::settings::ForwardSelection;
use airloop_refine::engine::stop;
use airloop_refine::evidence::{self, Evidence};
use airloop_refine::rig::answer::answer;
use airloop_refine::rig::open::{Rig, open};
use airloop_refine::sign;
use airloop_refine::study;
use airloop_refine::vocabulary::folder::Folder;
use airloop_refine::watch::Event;
use airloop_report::{Report, words};
use airloop_series::units::parse_duration;

/// Exit code when nothing is missing.
pub const NOTHING: u8 = 10;
/// Exit code when something is missing that no candidate explains.
pub const UNEXPLAINED: u8 = 11;
/// Exit code when effects cannot be told apart.
pub const GROUP: u8 = 12;
/// Exit code when the law of what is missing was found.
pub const LAW: u8 = 13;

/// File of a law beside the amended system, for `--effects`.
const LAW_FILE: &str = "law.toml";

/// `airloop refine`
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "Exit codes: 0 effect found, 10 nothing missing, 11 unexplained, 12 effect found that these records cannot tell from others (see its group in report.json), 13 a law found that no list holds (formula or curve, see law in report.json), 1 failure, 2 wrong usage, 130 interrupted.\n\nExample: airloop refine data/rig/v01 -o out/refine"
)]
pub struct Args {
    /// Folder with case.toml (declared parameters, sensors, files with their role), study.toml (any system) or
    /// dataset.toml (columns with units) and the records as CSV; or a study file.
    #[arg(required_unless_present = "schema")]
    pub case: Option<PathBuf>,
    /// Folder for report.json, report.md, report.html and system/ (the amended system); it is made if it is not there.
    #[arg(short, long, value_name = "DIR", default_value = "out/refine")]
    pub output: PathBuf,
    /// Seed of the simulated noise; one seed gives one report, on any number of processors.
    #[arg(long, value_name = "NUMBER", default_value_t = 1)]
    pub seed: u64,
    /// Most effects that are added to the declared model.
    #[arg(long, value_name = "NUMBER", default_value_t = 3, value_parser = clap::value_parser!(u8).range(1..=3))]
    pub max_effects: u8,
    /// A number that decides the answer, from the table of settings in report.json (settings.table); may be repeated.
    #[arg(long, value_name = "NAME=VALUE", value_parser = setting)]
    pub set: Vec<(String, f64)>,
    /// Folder with effects of one's own as .toml files (or one such file), which are looked for as well; see `airloop
    /// effects check --help`. Files that are no effects are named, and the others are used.
    #[arg(long, value_name = "DIR")]
    pub effects: Option<PathBuf>,
    /// Search records that are drawn again: the outputs of SYSTEM (`declared`, or the amended system of a report) plus
    /// blocks of what it leaves of the measured ones, which --seed chooses. Many draws, as a sweep, tell how often an
    /// effect is named where none is missing, or found again; for a study.
    #[arg(long, value_name = "SYSTEM")]
    pub redraw: Option<PathBuf>,
    /// Time for the search (`30 s`, `2 min`); the report then has the best answer so far and says that it is partial.
    #[arg(long, value_name = "TIME", value_parser = budget)]
    pub budget: Option<Duration>,
    /// Threads of the search [default: one per processor]; the report does not depend on it.
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print the JSON schema of report.json, or that of study.toml, and do nothing else.
    #[arg(long, value_enum, value_name = "FILE", num_args = 0..=1, default_missing_value = "report")]
    pub schema: Option<Schema>,
    /// Print the places where something may be missing, with the effects that would be looked for, and search nothing;
    /// for a study.
    #[arg(long)]
    pub plan: bool,
    /// Processes of FMUs.
    #[command(flatten)]
    pub isolate: super::isolate::IsolateArgs,
    /// Print nothing but errors.
    #[arg(short, long)]
    pub quiet: bool,
}

/// A file whose schema is printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Schema {
    /// report.json
    Report,
    /// study.toml
    Study,
}

/// Runs the command; the exit code is the verdict.
///
/// # Errors
/// A case that cannot be read or searched, a report that cannot be written.
pub fn run(args: &Args) -> Result<ExitCode, Error> {
    let (Some(path), None) = (args.case.as_deref(), args.schema) else {
        let schema = match args.schema {
            Some(Schema::Study) => study::declaration::schema(),
            _ => airloop_report::SCHEMA.to_owned(),
        };
        output::print(&schema)?;
        return Ok(ExitCode::SUCCESS);
    };
    if args.plan {
        return plan(path);
    }
    check_folder(path, &args.output)?;
    args.isolate.choose()?;
    parallel::use_threads(args.threads.map_or(0, usize::from));
    // Checked when the command line was read.
    let changed =
        |own: ForwardSelection, (name, value): &(String, f64)| own.with(name, *value).unwrap_or(own);
    let forward_selection = args.set.iter().fold(ForwardSelection::default(), changed);
    let settings = Settings {
        seed: args.seed,
        max_effects: args.max_effects.into(),
        forward_selection,
        ..Settings::default()
    };
    let mut question = Question::read(path)?;
    if let Some(folder) = &args.effects {
        question.take_effects(folder)?;
    }
    if let Some(system) = &args.redraw {
        question.redraw(system, args.seed)?;
    }
    let results = results_folder(path, &args.output)?;
    let interrupt = Interrupt::new(&args.output);
    if let Some(time) = args.budget {
        stop::within(time);
    }
    let (mut found, evidence) = question.answer(&settings, args.quiet)?;
    let interrupted = interrupt.begin_to_write();
    let system = write_system(&question, &mut found, results.path())?;
    let name = match &question {
        Question::Rig { case, .. } => case.declaration.id.clone(),
        Question::Study(file) => file.name(),
    };
    let study = match &question {
        // Errors on records that are drawn again are not those of its files.
        Question::Study(file) if args.redraw.is_none() => relative_path(&file.path, &args.output).ok(),
        Question::Study(_) | Question::Rig { .. } => None,
    };
    let written = Report {
        case: &name,
        answer: &found,
        evidence: &evidence,
        settings: &settings,
        system: system.then_some(amend::FOLDER),
        study: study.as_deref(),
        signals: results.path().join(amend::FOLDER).join(amend::SIGNALS).is_file(),
    };
    airloop_report::write(&written, results.path())?;
    results.commit()?;
    if !args.quiet {
        print(&found, &evidence, &args.output, system)?;
    }
    if interrupted || interrupt.came() {
        let kept = args.output.join("report.json");
        let when = if interrupted {
            "during the search; the best answer so far"
        } else {
            "after the search; its report"
        };
        output::to_stderr(&format!("interrupted {when} is in {}", kept.display()));
        return Ok(ExitCode::from(super::INTERRUPTED));
    }
    Ok(exit(&found))
}

/// A command has no position; it shows the state that it moves most.
const PLAN_HEADER: [&str; 4] = ["port", "velocity", "position or state", "effects"];

/// Prints what a search would look for.
fn plan(path: &Path) -> Result<ExitCode, Error> {
    let Some(file) = study::find(path)? else {
        let problem =
            "--plan lists the places of a study; those of a case are the channels of its rig".into();
        return Err(airloop_refine::Error::Case { path: path.into(), problem }.into());
    };
    let found = study::plan::plan(&file)?;
    let stated = |unit: &str| if unit == "1" { String::new() } else { format!(" [{unit}]") };
    let rows: Vec<Vec<String>> = found
        .places
        .iter()
        .map(|place| {
            let signal = |name: &Option<String>, unit: &str| {
                name.as_ref().map_or_else(|| "-".into(), |name| format!("{name}{}", stated(unit)))
            };
            vec![
                format!("{}{}", place.port, stated(&place.units[0])),
                signal(&place.velocity, &place.units[1]),
                signal(&place.position, &place.units[2]),
                place.kinds.join(", "),
            ]
        })
        .collect();
    let mut text = format!("{}\n", super::table::table(&PLAN_HEADER, &rows, &[]));
    let rows: Vec<Vec<String>> =
        found.sensors.iter().map(|(name, kinds)| vec![name.clone(), kinds.join(", ")]).collect();
    if !rows.is_empty() {
        text += &format!("\n{}\n", super::table::table(&["output", "effects"], &rows, &[]));
    }
    for (name, why) in &found.not_testable {
        text += &format!("\nnot testable: {name}: {why}");
    }
    for note in &found.notes {
        text += &format!("\nnote: {note}");
    }
    output::print(text.trim_end())?;
    output::print("\n")?;
    Ok(ExitCode::SUCCESS)
}

/// Longest time of a search \[s\].
const MAX_BUDGET: f64 = 1e9;

/// A time limit of the command line.
fn budget(text: &str) -> Result<Duration, String> {
    let seconds = parse_duration(text).map_err(|error| error.to_string())?;
    if !(seconds > 0.0 && seconds <= MAX_BUDGET) {
        return Err(format!("allowed are more than 0 s, at most {MAX_BUDGET:e} s"));
    }
    Ok(Duration::from_secs_f64(seconds))
}

/// A setting of the command line.
fn setting(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("write NAME=VALUE")?;
    let value =
        value.trim().parse::<f64>().map_err(|_| format!("`{value}` is no number; write NAME=VALUE"))?;
    ForwardSelection::default().with(name.trim(), value)?;
    Ok((name.trim().to_owned(), value))
}

/// Kind of search: a rig of the vocabulary, or a study of any system.
enum Question {
    Rig { case: Box<Case>, rig: Box<Rig> },
    Study(Box<study::declaration::File>),
}

impl Question {
    fn read(path: &Path) -> Result<Question, Error> {
        if let Some(file) = study::find(path)? {
            return Ok(Question::Study(Box::new(file)));
        }
        let case = Case::read(path)?;
        let rig = open(&case)?;
        Ok(Question::Rig { case: Box::new(case), rig: Box::new(rig) })
    }

    /// Adds effects of one's own; those that are none become notes.
    fn take_effects(&mut self, path: &Path) -> Result<(), Error> {
        let folder = Folder::read(path)?;
        folder.problems().iter().for_each(|problem| output::to_stderr(&format!("warning: {problem}")));
        match self {
            Question::Study(file) => {
                file.effects.extend(folder.effects.iter().map(|(_, own)| Arc::clone(own)));
                let none = |problem: String| format!("Not an effect, left out: {problem}.");
                file.notes.extend(folder.problems().into_iter().map(none));
            }
            Question::Rig { .. } => {
                return Err(airloop_refine::Error::Case {
                    path: path.to_owned(),
                    problem: "effects of one's own are looked for in a study.toml, not in a case.toml; describe the system as a study".into(),
                }
                .into());
            }
        }
        Ok(())
    }

    /// Draws the records again.
    fn redraw(&mut self, system: &Path, seed: u64) -> Result<(), Error> {
        match self {
            Question::Study(file) => Ok(file.redraw(Some(system).filter(|own| *own != Path::new("declared")), seed)?),
            Question::Rig { .. } => Err(airloop_refine::Error::Case {
                path: system.to_owned(),
                problem: "--redraw draws the records of a study.toml again, not those of a case.toml; describe the system as a study".into(),
            }
            .into()),
        }
    }

    fn answer(&self, settings: &Settings, quiet: bool) -> Result<(Answer, Evidence), Error> {
        match self {
            Question::Study(file) => {
                let progress = Progress::new(quiet, 0);
                let found =
                    study::answer::answer(file, settings, &|stage| progress.tell(Event::Stage(stage)));
                progress.finish();
                Ok(found?)
            }
            Question::Rig { case, rig } => {
                sign::check(case)?;
                let files = &case.declaration.files;
                let groups: Vec<String> = files.iter().map(|file| file.group.clone()).collect();
                let records = files.iter().filter(|file| file.role == Role::Estimation);
                let progress = Progress::new(quiet, (settings.draws * records.count()) as u64);
                let mut found = answer(rig, &groups, settings, &|event| progress.tell(event));
                found.notes.extend(case.notes.iter().cloned());
                let evidence = evidence::gather(case, rig, &found);
                progress.finish();
                Ok((found, evidence))
            }
        }
    }
}

/// Only an earlier report may be replaced.
fn check_folder(case: &Path, folder: &Path) -> Result<(), Error> {
    folder::check_where(folder, &[case.into()], &names(folder), earlier)
}

/// The folder of the report, taken for this command.
fn results_folder(case: &Path, folder: &Path) -> Result<folder::Results, Error> {
    folder::Results::open_where(folder, &[case.into()], &names(folder), earlier)
}

/// Files and folders that a report replaces in a folder: its own, and a folder of the user with the name of that of the
/// amended system, whose parts would lie among other files there.
fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = airloop_report::FILES.map(str::to_owned).into();
    let begun = std::fs::read_dir(folder.join(amend::FOLDER)).is_ok_and(|mut files| files.next().is_some());
    if begun && !earlier(folder).iter().any(|name| name.starts_with(amend::FOLDER)) {
        names.push(amend::FOLDER.into());
    }
    names
}

/// Files of a report without a list of its files.
fn earlier(folder: &Path) -> BTreeSet<String> {
    let earlier = std::fs::read(folder.join("report.json")).unwrap_or_default();
    let earlier: serde_json::Value = serde_json::from_slice(&earlier).unwrap_or_default();
    let mut ours = BTreeSet::new();
    if earlier["score_kind"].is_string() {
        ours.extend(airloop_report::FILES.map(str::to_owned));
    }
    if earlier["amended_system"].is_string() {
        let files = std::fs::read_dir(folder.join(amend::FOLDER)).into_iter().flatten().flatten();
        let files = files.map(|file| file.file_name().to_string_lossy().into_owned());
        let text = std::fs::read_to_string(folder.join(amend::FOLDER).join("system.ssd")).unwrap_or_default();
        let system = |name: &String| {
            ["system.ssd", "system.ssp", amend::SIGNALS, LAW_FILE].contains(&name.as_str())
                || text.contains(&format!("source=\"{name}\""))
        };
        ours.extend(files.filter(system).map(|name| format!("{}/{name}", amend::FOLDER)));
    }
    ours
}

/// Writes the amended system if there is anything to amend; where it cannot be, a note says why.
fn write_system(question: &Question, found: &mut Answer, folder: &Path) -> Result<bool, Error> {
    let selected = found.effects.iter().any(|effect| effect.selected);
    let amended = selected || found.law.is_some() || found.cylinder || !found.corrections.is_empty();
    if !amended {
        amend::remove(folder)?;
        return Ok(false);
    }
    let network = match question {
        Question::Rig { case, .. } => Ok(amend::rig::network(&case.declaration, found)),
        Question::Study(file) => amend::study::network(file, found, folder),
    };
    let problem = match network.and_then(|network| amend::write(&network, folder, None)) {
        Ok(()) => {
            if let Some(law) = &found.law {
                let path = folder.join(amend::FOLDER).join(LAW_FILE);
                let problem = |source: std::io::Error| airloop_refine::Error::Case {
                    path: path.clone(),
                    problem: format!("the law cannot be written: {source}"),
                };
                std::fs::write(&path, &law.toml).map_err(problem)?;
            }
            return Ok(true);
        }
        Err(amend::Error::Template(missing)) => format!(
            "the FMU {}.fmu was not found; run `make fmu`, or name the folder that holds it in the environment variable {}",
            missing.name, VARIABLE
        ),
        Err(amend::Error::System(error)) => error.to_string(),
        Err(error) => return Err(error.into()),
    };
    amend::remove(folder)?;
    found.notes.push(format!("The amended system was not written: {problem}."));
    Ok(false)
}

fn print(found: &Answer, evidence: &Evidence, folder: &Path, system: bool) -> Result<(), Error> {
    let rows: Vec<Vec<String>> = words::errors(found, &evidence.signals).into_iter().map(Vec::from).collect();
    let rows = super::table::table(&words::ERROR_HEADER, &rows, &[1, 2, 3, 4, 5, 6]);
    let mut text = format!("{}\n", words::sentence(found));
    for sentence in words::rivals(found) {
        text += &format!("{sentence}\n");
    }
    for note in found.notes.iter().filter(|note| note.starts_with(WARNING)) {
        text += &format!("{note}\n");
    }
    text += &format!("\nError on validation records\n{rows}\n");
    text += &format!("report  {}\n", folder.join("report.html").display());
    if system {
        text += &format!("system  {}\n", folder.join(amend::FOLDER).join("system.ssd").display());
    }
    output::print(&text)
}

fn exit(found: &Answer) -> ExitCode {
    let group = found.effects.iter().any(|effect| effect.selected && effect.group.is_some());
    match found.verdict {
        Verdict::Nothing => ExitCode::from(NOTHING),
        Verdict::Unexplained => ExitCode::from(UNEXPLAINED),
        Verdict::Law => ExitCode::from(LAW),
        Verdict::Effect if group => ExitCode::from(GROUP),
        Verdict::Effect => ExitCode::SUCCESS,
    }
}
