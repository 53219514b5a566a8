//! `airloop trials`: how many perturbed systems a controller keeps on the plan, compared with the plan alone.

#![allow(
    rustdoc::broken_intra_doc_links,
    reason = "these texts are the help of the program, brackets are tables of the settings"
)]

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::time::Instant;

use super::args::MasterChoice;
use super::table::table;
use super::{folder, output, progress, run};
use airloop::Error;
use airloop_plan::Error as PlanError;
use airloop_plan::stabilize::record::{self, CriterionRecord, SCHEMA_VERSION, TrialsSummary};
use airloop_plan::stabilize::settings;
use airloop_plan::trials::{self, Ready, Request, Trial};
use airloop_report::plot;
use airloop_report::plot::stabilize::{TRAJECTORIES, share};
use airloop_series::names::counted;
use airloop_series::{TimeSeries, csv};

/// A row per trial.
const TRIALS: &str = "trials.csv";
/// Trials whose trajectories are drawn, as in Fig. 10 of the paper.
const MAX_DRAWN_TRIALS: usize = 10;

/// `airloop trials`
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: airloop trials out/stabilized --count 200 --scale 2 -o out/trials")]
pub struct Args {
    /// Folder of `airloop stabilize`, or a closed loop that it wrote (.ssd, .ssp; give --settings).
    pub system: PathBuf,
    /// Settings (TOML) with [sensors] and [trials]. Default: those in the folder.
    #[arg(long, value_name = "FILE")]
    pub settings: Option<PathBuf>,
    /// Number of trials, of the closed loop and of the plan alone each.
    #[arg(long, value_name = "NUMBER", default_value_t = 200, value_parser = parse_count, allow_hyphen_values = true)]
    pub count: u32,
    /// Seed of the first trial; each next one has the next seed. A seed gives the same trial on any number of threads.
    #[arg(long, value_name = "NUMBER", default_value_t = 0, value_parser = parse_seed, allow_hyphen_values = true)]
    pub seed: u64,
    /// Factor of all perturbations; the sensor noise stays as it is.
    #[arg(long, value_name = "NUMBER", default_value_t = 1.0, allow_hyphen_values = true)]
    pub scale: f64,
    /// Coupling of the components. monolithic has no coupling error.
    #[arg(long, value_enum, default_value_t = MasterChoice::GaussSeidel)]
    pub master: MasterChoice,
    /// Threads; default: one per processor, at most 8. Results do not depend on it.
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u32).range(1..=256))]
    pub threads: Option<u32>,
    /// Processes of FMUs.
    #[command(flatten)]
    pub isolate: super::isolate::IsolateArgs,
    /// Folder for the results; it is made if it is not there.
    #[arg(short, long, value_name = "DIR", default_value = "out/trials")]
    pub output: PathBuf,
    /// Draw no figures.
    #[arg(long)]
    pub no_plots: bool,
    /// Print nothing but errors.
    #[arg(short, long)]
    pub quiet: bool,
}

fn parse_count(text: &str) -> Result<u32, String> {
    let count = text.parse().ok().filter(|count| (1..=1_000_000).contains(count));
    count.ok_or_else(|| "write a whole number from 1 to 1000000".to_owned())
}

fn parse_seed(text: &str) -> Result<u64, String> {
    text.parse().map_err(|_| format!("write a whole number from 0 to {}", u64::MAX))
}

/// Runs the command.
///
/// # Errors
/// Fails if the trials cannot be prepared or begun, or the results cannot be written.
pub fn run(args: &Args) -> Result<ExitCode, Error> {
    let stop = run::stop_flag();
    args.isolate.choose()?;
    if !(args.scale.is_finite() && args.scale >= 0.0) {
        let problem = format!("{}; allowed: a finite number of at least 0", args.scale);
        return Err(PlanError::Place { place: "--scale".into(), problem }.into());
    }
    let (system, file) = trials::sources(&args.system, args.settings.as_deref())?;
    let settings = settings::read(&file)?;
    let names = [TRIALS, TRAJECTORIES, "index.html", "summary.json"].map(String::from);
    folder::check(&args.output, &[system.clone(), file.clone()], &names)?;
    let began = Instant::now();
    let ready = trials::prepare(&system, &settings, args.master.into())?;
    let processors = std::thread::available_parallelism().map_or(1, usize::from).min(8);
    let request = Request {
        count: args.count as usize,
        seed: args.seed,
        scale: args.scale,
        algorithm: args.master.into(),
        threads: args.threads.map_or(processors, |threads| threads as usize),
        keep: MAX_DRAWN_TRIALS,
    };
    let all = 2 * u64::from(args.count);
    let bar = progress::bar(args.quiet, Some(all), "trials {bar:40} {pos}/{len} {eta}");
    let done = trials::run(&ready, &request, &stop, &|done, _| bar.set_position(done as u64))?;
    bar.finish_and_clear();
    let interrupted = stop.load(Ordering::Relaxed);

    let results = folder::Results::open(&args.output, &[system.clone(), file.clone()], &names)?;
    write_trials(&ready, &done, &results.path().join(TRIALS))?;
    csv::write(&trajectories(&done)?, &results.path().join(TRAJECTORIES))?;
    let shown = ready.shown();
    let number = |closed: bool| done.iter().filter(|trial| trial.closed == closed).count();
    let kept = |name: &String, closed: bool| {
        let good = |trial: &&Trial| {
            trial.closed == closed && trial.judgment.iter().any(|(own, kept)| own == name && *kept)
        };
        done.iter().filter(good).count()
    };
    let early = done.iter().filter_map(|trial| {
        let kind = if trial.closed { "closed" } else { "open" };
        trial.problem.as_ref().map(|problem| format!("seed {}, {kind} loop: {problem}", trial.seed))
    });
    let criteria = ready.criteria_names().into_iter().map(|name| {
        let (closed_loop, open_loop) = (kept(&name, true), kept(&name, false));
        CriterionRecord { name, closed_loop, open_loop }
    });
    let summary = TrialsSummary {
        schema_version: SCHEMA_VERSION,
        airloop_version: env!("CARGO_PKG_VERSION").into(),
        command: "trials".into(),
        system_file: system,
        settings_file: file,
        status: if interrupted { "interrupted".into() } else { "completed".into() },
        count: request.count,
        closed_loop: number(true),
        open_loop: number(false),
        seed: args.seed,
        scale: args.scale,
        master: request.algorithm.to_string(),
        criteria: criteria.collect(),
        ended_early: early.collect(),
        drawn_again: drawn_again(&ready, &done),
        time: began.elapsed().as_secs_f64(),
        files: vec![TRIALS.into(), TRAJECTORIES.into()],
        figures: if args.no_plots { Vec::new() } else { plot::stabilize::trial_figures(&shown) },
    };
    record::write(&summary, &results.path().join("summary.json"))?;
    if !args.no_plots {
        plot::stabilize::draw_trials(results.path(), &summary, &shown)?;
    }
    results.commit()?;
    if !args.quiet {
        let early = [true, false].map(|closed| {
            done.iter().filter(|trial| trial.closed == closed && trial.problem.is_some()).count()
        });
        output::print(&report(&summary, early, &args.output))?;
    }
    if interrupted {
        output::to_stderr(&format!("interrupted; the trials so far are in {}", args.output.display()));
        return Ok(ExitCode::from(super::INTERRUPTED));
    }
    Ok(ExitCode::SUCCESS)
}

/// Perturbations that were drawn again; both loops of a seed have the same.
fn drawn_again(ready: &Ready, trials: &[Trial]) -> Vec<String> {
    let of = |number: usize| -> Vec<usize> {
        let closed = trials.iter().filter(|trial| trial.closed);
        closed.map(|trial| trial.drawn_again[number]).filter(|&again| again > 0).collect()
    };
    let named = ready.perturbations.iter().enumerate().map(|(number, one)| (&one.name, of(number)));
    let text = |(name, again): (&String, Vec<usize>)| {
        let draws: usize = again.iter().sum();
        format!("{name}: {} in {}", counted(draws, "draw"), counted(again.len(), "trial"))
    };
    named.filter(|(_, again)| !again.is_empty()).map(text).collect()
}

/// One row per trial: seed, loop, every criterion as 0 or 1, and whether it ended early.
fn write_trials(ready: &Ready, trials: &[Trial], file: &Path) -> Result<(), Error> {
    let mut text = format!("seed,loop,{},ended_early\n", ready.criteria_names().join(","));
    for trial in trials {
        let kept: Vec<&str> = trial.judgment.iter().map(|(_, kept)| if *kept { "1" } else { "0" }).collect();
        let kind = if trial.closed { "closed" } else { "open" };
        let early = u8::from(trial.problem.is_some());
        text += &format!("{},{kind},{},{early}\n", trial.seed, kept.join(","));
    }
    airloop_series::file::write_whole(file, |out| out.write_all(text.as_bytes()))
        .map_err(|source| PlanError::Io { file: file.into(), source }.into())
}

/// Trajectories that were kept, side by side; one that ended early is left out.
fn trajectories(trials: &[Trial]) -> Result<TimeSeries, Error> {
    let kept: Vec<(&Trial, &TimeSeries)> =
        trials.iter().filter_map(|trial| Some((trial, trial.trajectory.as_ref()?))).collect();
    let longest = kept.iter().map(|(_, trajectory)| trajectory).max_by_key(|trajectory| trajectory.len());
    let mut all = TimeSeries::new(longest.map_or_else(Vec::new, |trajectory| trajectory.time().to_vec()))?;
    for (trial, trajectory) in
        kept.into_iter().filter(|(_, trajectory)| trajectory.len() == all.len()).collect::<Vec<_>>()
    {
        for channel in trajectory.channels() {
            let kind = if trial.closed { "closed" } else { "open" };
            let name = format!("{}, {kind} loop, seed {}", channel.name, trial.seed);
            all.push(name, channel.unit.clone(), channel.values.clone())?;
        }
    }
    Ok(all)
}

/// Text that is printed at the end; `early`: trials of the closed and of the open loop that ended early.
fn report(summary: &TrialsSummary, early: [usize; 2], folder: &Path) -> String {
    let rows: Vec<Vec<String>> = summary
        .criteria
        .iter()
        .map(|criterion| {
            vec![
                criterion.name.clone(),
                share(criterion.closed_loop, summary.closed_loop),
                share(criterion.open_loop, summary.open_loop),
            ]
        })
        .collect();
    let mut text = format!(
        "trials: seeds {} to {}, perturbation times {}, {} master, {:.1} s\n\n",
        summary.seed,
        summary.seed + summary.count as u64 - 1,
        summary.scale,
        summary.master,
        summary.time
    );
    text += &table(&["criterion", "closed loop", "open loop"], &rows, &[1, 2]);
    text.push('\n');
    let loops = [("closed", summary.closed_loop), ("open", summary.open_loop)];
    for ((kind, count), early) in loops.into_iter().zip(early).filter(|(_, early)| *early > 0) {
        text += &format!(
            "note: {early} of {} in {kind} loop ended early and keep no criterion\n",
            counted(count, "trial")
        );
    }
    for drawn in &summary.drawn_again {
        text += &format!(
            "note: drawn again, since it would have left the range that its FMU declares: {drawn}\n"
        );
    }
    text += &format!("table:   {}\n", folder.join(TRIALS).display());
    if !summary.figures.is_empty() {
        text += &format!("figures: {}\n", folder.join("index.html").display());
    }
    text
}
