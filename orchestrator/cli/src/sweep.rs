//! `airloop sweep`: a plan of many tasks, its shards, and one table of their results.

#![allow(
    rustdoc::broken_intra_doc_links,
    reason = "these texts are the help of the program, brackets are tables of the plan"
)]

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

use airloop::Error;
use airloop_sweep::file::PlanFile;
use airloop_sweep::manifest::{Manifest, short};
use airloop_sweep::shard::{Done, Runner, Shard};
use airloop_sweep::{Error as SweepError, merge, report, slurm};
use clap::{Subcommand, ValueEnum};

use super::isolate::{IsolateArgs, IsolateChoice};
use super::{output, progress, run};

/// Shards of a plan at most: each is a file.
const MOST_SHARDS: u64 = 1_000_000;

/// The subcommands of `airloop sweep`.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Plan the tasks of a file (TOML): what each of them is, and the content of all that they read.
    ///
    /// Writes manifest.json. The first task is set up as a check, but not run.
    #[command(after_help = "Example: airloop sweep plan examples/07_sweep/sweep.toml -o out/sweep")]
    Plan(PlanArgs),
    /// Run all shards of a plan, or one.
    ///
    /// A finished shard is skipped. A task that fails is a row with its cause. A shard is written when all of its tasks
    /// have ended: a killed run loses the shard that it was at, and is continued by the same command.
    #[command(after_help = "Example: airloop sweep run out/sweep --shard 2/8 --threads 4")]
    Run(RunArgs),
    /// Write results.csv and results.parquet from finished shards, of any number and from any machine.
    Merge(FolderArgs),
    /// Draw what was merged: numbers of every quantity, causes of failures, influence of the factors (index.html).
    Report(FolderArgs),
    /// Tell how many tasks are done and have failed.
    Status(FolderArgs),
    /// Run a plan here, or hand its shards to a cluster as one job array.
    ///
    /// slurm: writes submit.sh with the options of the table [slurm], and submits it with sbatch; a shard whose node
    /// fails is queued again.
    #[command(after_help = "Example: airloop sweep submit out/sweep --engine slurm --shards 100")]
    Submit(SubmitArgs),
    /// End the job of a plan on a cluster; finished shards stay.
    Cancel(FolderArgs),
}

/// A folder of a plan.
#[derive(Debug, clap::Args)]
pub struct FolderArgs {
    /// Folder of `airloop sweep plan`.
    pub folder: PathBuf,
    /// Print nothing but errors.
    #[arg(short, long)]
    pub quiet: bool,
}

/// `airloop sweep plan`
#[derive(Debug, clap::Args)]
#[command(mut_arg("isolate", |isolate| isolate.default_value("third-party")))]
pub struct PlanArgs {
    /// Plan (TOML); paths in it begin at its folder; its keys are those of --schema.
    #[arg(required_unless_present = "schema")]
    pub plan: Option<PathBuf>,
    /// Number of shards. Default: `shards` of the plan, else 1.
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u64).range(1..=MOST_SHARDS))]
    pub shards: Option<u64>,
    /// As many shards as make each take this time on one thread, e.g. 10min: three tasks are run and timed.
    #[arg(long, value_name = "TIME", value_parser = super::export::parse_step, conflicts_with = "shards")]
    pub shard_time: Option<f64>,
    /// Folder of the sweep; it is made if it is not there.
    #[arg(short, long, value_name = "DIR", default_value = "out/sweep")]
    pub output: PathBuf,
    /// Print the JSON schema of plans, for editors that check and complete TOML.
    #[arg(long)]
    pub schema: bool,
    /// Processes of FMUs.
    #[command(flatten)]
    pub isolate: IsolateArgs,
    /// Print nothing but errors.
    #[arg(short, long)]
    pub quiet: bool,
}

/// `airloop sweep run`
#[derive(Debug, clap::Args)]
#[command(mut_arg("isolate", |isolate| isolate.default_value("third-party")))]
pub struct RunArgs {
    /// Folder of `airloop sweep plan`.
    pub folder: PathBuf,
    /// Part to run, as i/n, e.g. 2/8. n need not be that of the plan; results do not depend on it. Default: all shards
    /// of the plan, one after the other.
    #[arg(long, value_name = "I/N")]
    pub shard: Option<String>,
    /// Threads; default: one per processor. Results do not depend on it.
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u32).range(1..=256))]
    pub threads: Option<u32>,
    /// Processes of FMUs.
    #[command(flatten)]
    pub isolate: IsolateArgs,
    /// Print nothing but errors.
    #[arg(short, long)]
    pub quiet: bool,
}

/// `airloop sweep submit`
#[derive(Debug, clap::Args)]
#[command(mut_arg("isolate", |isolate| isolate.default_value("third-party")))]
pub struct SubmitArgs {
    /// Folder of `airloop sweep plan`; on a cluster, one that all nodes see.
    pub folder: PathBuf,
    /// Where the shards run.
    #[arg(long, value_enum, default_value_t = Engine::Local)]
    pub engine: Engine,
    /// Number of shards. Default: that of the plan.
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u64).range(1..=MOST_SHARDS))]
    pub shards: Option<u64>,
    /// Threads of each shard. Default: 1 on a cluster, here one per processor.
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u32).range(1..=256))]
    pub threads: Option<u32>,
    /// Submit even if an earlier submission of the folder still waits or runs.
    #[arg(long)]
    pub again: bool,
    /// Processes of FMUs.
    #[command(flatten)]
    pub isolate: IsolateArgs,
    /// Print nothing but errors.
    #[arg(short, long)]
    pub quiet: bool,
}

/// `--engine`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Engine {
    /// This computer, at once.
    Local,
    /// A Slurm cluster.
    Slurm,
}

/// Runs the command.
///
/// # Errors
/// A plan or system that cannot be used; other troubles of a sweep are printed here and are the exit code.
pub fn run(command: &Command) -> Result<ExitCode, Error> {
    let outcome = match command {
        Command::Plan(args) => plan(args),
        Command::Run(args) => {
            args.isolate.choose()?;
            run_shards(args)
        }
        Command::Merge(args) => merge(args),
        Command::Report(args) => report(args),
        Command::Status(args) => status(args),
        Command::Submit(args) => {
            args.isolate.choose()?;
            submit(args)
        }
        Command::Cancel(args) => cancel(args),
    };
    match outcome {
        Ok(code) => Ok(code),
        Err(SweepError::Airloop(error)) => Err(error),
        Err(error @ SweepError::Interrupted) => {
            output::to_stderr(&error.to_string());
            Ok(ExitCode::from(super::INTERRUPTED))
        }
        Err(error) => {
            output::to_stderr(&format!("error: {error}"));
            let usage = matches!(error, SweepError::Shard { .. });
            Ok(if usage { ExitCode::from(super::USAGE) } else { ExitCode::FAILURE })
        }
    }
}

fn plan(args: &PlanArgs) -> Result<ExitCode, SweepError> {
    let Some(file) = args.plan.as_deref().filter(|_| !args.schema) else {
        output::print(&PlanFile::schema())?;
        return Ok(ExitCode::SUCCESS);
    };
    args.isolate.choose()?;
    let mut manifest = Manifest::plan(file).map_err(|error| error.in_file(file))?;
    if let Some(shards) = args.shards {
        manifest.shards = shards.min(manifest.tasks.max(1));
    }
    if let Some(time) = args.shard_time {
        manifest.shards = shards_of(&manifest, time)?;
    }
    manifest.write(&args.output)?;
    if !args.quiet {
        output::print(&format!(
            "{} tasks in {} shards, {} inputs, plan {}\nrun: airloop sweep run {}\n",
            manifest.tasks,
            manifest.shards,
            manifest.inputs.len(),
            short(&manifest.digest),
            args.output.display()
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Shards that take about `time` \[s\] each, by the time of some tasks.
fn shards_of(manifest: &Manifest, time: f64) -> Result<u64, SweepError> {
    let folder = airloop_series::scratch::folder();
    let folder = folder.map_err(|source| SweepError::Io { path: std::env::temp_dir(), source })?;
    let runner = Runner::new(folder.path(), manifest.clone(), 1)?;
    let each = runner.time_of_a_task(&run::stop_flag()).ok_or(SweepError::Interrupted)?;
    let shards = (each * manifest.tasks as f64 / time).ceil();
    Ok((shards as u64).clamp(1, manifest.tasks.clamp(1, MOST_SHARDS)))
}

fn run_shards(args: &RunArgs) -> Result<ExitCode, SweepError> {
    let threads = args.threads.map_or_else(processors, |threads| threads as usize);
    let runner = Runner::open(&args.folder, threads)?;
    let shards = match &args.shard {
        Some(shard) => vec![shard.parse()?],
        None => all(runner.manifest.shards),
    };
    run_all(&runner, &shards, args.quiet)
}

fn all(of: u64) -> Vec<Shard> {
    (1..=of).map(|index| Shard { index, of }).collect()
}

fn processors() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Runs shards one after the other; one that another process runs is left to it.
fn run_all(runner: &Runner, shards: &[Shard], quiet: bool) -> Result<ExitCode, SweepError> {
    let stop = run::stop_flag();
    let (mut ran, mut skipped, mut failed, mut busy) = (0, 0, 0, 0);
    for &shard in shards {
        match one(runner, shard, &stop, quiet) {
            Ok(Done::Ran(foot)) => (ran, failed) = (ran + foot.rows, failed + foot.failed),
            Ok(Done::Skipped(foot)) => (skipped, failed) = (skipped + foot.rows, failed + foot.failed),
            Ok(Done::Nothing) => {}
            Err(error @ SweepError::Busy { .. }) => {
                output::to_stderr(&format!("note: {error}"));
                busy += 1;
            }
            Err(error) => return Err(error),
        }
    }
    if !quiet {
        output::print(&format!("{ran} tasks run, {skipped} were there, {failed} of them failed\n"))?;
    }
    Ok(if busy > 0 { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

fn one(runner: &Runner, shard: Shard, stop: &AtomicBool, quiet: bool) -> Result<Done, SweepError> {
    let tasks = shard.tasks(runner.manifest.tasks);
    let template = format!("shard {}/{} {{bar:40}} {{pos}}/{{len}} {{eta}}", shard.index, shard.of);
    let bar = progress::bar(quiet, Some(tasks.end - tasks.start), &template);
    let done = runner.run(shard, stop, &|done| bar.set_position(done));
    bar.finish_and_clear();
    done
}

fn merge(args: &FolderArgs) -> Result<ExitCode, SweepError> {
    let summary = merge::merge(&args.folder)?;
    if !args.quiet {
        let (csv, parquet) = (args.folder.join(merge::RESULTS), args.folder.join(merge::PARQUET));
        let (tasks, failed) = (summary.tasks, summary.failed);
        output::print(&format!(
            "{tasks} tasks, {failed} of them failed\ntable: {}\n       {}\n",
            csv.display(),
            parquet.display()
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn report(args: &FolderArgs) -> Result<ExitCode, SweepError> {
    let page = report::write(&args.folder)?;
    if !args.quiet {
        output::print(&format!("report: {}\n", page.display()))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn status(args: &FolderArgs) -> Result<ExitCode, SweepError> {
    let status = merge::status(&args.folder)?;
    let mut text =
        format!("{} of {} tasks done, {} of them failed\n", status.done, status.tasks, status.failed);
    if let Some(first) = status.first_missing {
        text += &format!("first task without a row: {first}\n");
    }
    if status.done > 0 {
        let each = 1e3 * status.busy / status.done as f64;
        text +=
            &format!("time of the finished shards: {:.1} s of threads, {each:.3} ms per task\n", status.busy);
    }
    for problem in &status.damaged {
        output::to_stderr(&format!("damaged: {problem}"));
    }
    if let Some(submission) = slurm::read(&args.folder)? {
        let (job, shards) = (submission.job, submission.shards);
        text += &format!("submitted: Slurm job {job} with {shards} shards; {}\n", queued(job));
    }
    if !args.quiet {
        output::print(&text)?;
    }
    let whole = status.first_missing.is_none() && status.damaged.is_empty();
    Ok(if whole { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Counts of the shards of a job by their state in the cluster.
fn queued(job: u64) -> String {
    match slurm::states(job) {
        Ok(states) if states.is_empty() => "none of them waits or runs".into(),
        Ok(states) => {
            let count = |(state, count): (&String, &u64)| format!("{count} {}", state.to_lowercase());
            states.iter().map(count).collect::<Vec<_>>().join(", ")
        }
        Err(error) => error.to_string(),
    }
}

fn submit(args: &SubmitArgs) -> Result<ExitCode, SweepError> {
    if args.engine == Engine::Local {
        let threads = args.threads.map_or_else(processors, |threads| threads as usize);
        let runner = Runner::open(&args.folder, threads)?;
        let shards = args.shards.unwrap_or(runner.manifest.shards);
        return run_all(&runner, &all(shards), args.quiet);
    }
    let threads = args.threads.map_or(1, |threads| threads as usize);
    let submission =
        slurm::submit(&args.folder, (args.shards, threads), &isolation(&args.isolate), args.again)?;
    if !args.quiet {
        output::print(&format!(
            "Slurm job {} with {} shards\nsee: airloop sweep status {folder}\nend: airloop sweep cancel {folder}\n",
            submission.job,
            submission.shards,
            folder = args.folder.display()
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The words for a shard on another machine.
fn isolation(args: &IsolateArgs) -> Vec<String> {
    let which = match args.isolate {
        IsolateChoice::None => "none",
        IsolateChoice::All => "all",
        IsolateChoice::ThirdParty => "third-party",
    };
    let limits =
        [format!("--call-limit={}", args.call_limit), format!("--memory-limit={}", args.memory_limit)];
    std::iter::once(format!("--isolate={which}")).chain(limits).collect()
}

fn cancel(args: &FolderArgs) -> Result<ExitCode, SweepError> {
    let text = match slurm::cancel(&args.folder)? {
        Some(job) => format!("Slurm job {job} is ended; finished shards are kept\n"),
        None => format!("{} was not submitted\n", args.folder.display()),
    };
    if !args.quiet {
        output::print(&text)?;
    }
    Ok(ExitCode::SUCCESS)
}
