//! `airloop stabilize`: a controller that keeps a system on its plan, as an FMU, and the closed loop with it.

#![allow(
    rustdoc::broken_intra_doc_links,
    reason = "these texts are the help of the program, brackets are tables of the settings"
)]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use super::table::table;
use super::{folder, output};
use airloop::Error;
use airloop_cosim::master::Settings as MasterSettings;
use airloop_cosim::master::simulate::{self, End, Watch};
use airloop_cosim::system::SystemGraph;
use airloop_fmi::template_folder;
use airloop_plan::prepare::{Prepared, prepare};
use airloop_plan::record::StickRecord;
use airloop_plan::stabilize::predictive::{self, Predictive};
use airloop_plan::stabilize::record::{self, SCHEMA_VERSION, Summary};
use airloop_plan::stabilize::{Plan, Stabilized, settings, stabilize, wiring, write_fmu};
use airloop_plan::trials::{SETTINGS, SYSTEMS};
use airloop_plan::{Error as PlanError, record as plan_record};
use airloop_report::plot;
use airloop_report::plot::plan::TRAJECTORY;
use airloop_report::plot::run::short;
use airloop_report::plot::stabilize::{CLOSED_LOOP, GAINS};
use airloop_series::{Interpolation, TimeSeries, csv};
use airloop_system::{Recipe, TEMPLATE};

/// The FMU of the controller.
const CONTROLLER: &str = "controller.fmu";

/// `airloop stabilize`
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example: airloop stabilize out/swing_up examples/03_swing_up/stabilize.toml -o out/stabilized\n         airloop run out/stabilized/closed_loop.ssd -o out/run\n         airloop trials out/stabilized --count 200"
)]
pub struct Args {
    /// Folder of `airloop optimize`, or the CSV file of a trajectory (states and inputs by their names; give
    /// --problem).
    #[arg(required_unless_present = "schema")]
    pub plan: Option<PathBuf>,
    /// Settings (TOML): [sensors] with the noise of what is measured, and if wanted sample_time, [deviation], [drift],
    /// [initial], [limits], [nmpc], [trials], and for a plan with
    /// phases [phases]; its keys are those of --schema.
    #[arg(required_unless_present = "schema")]
    pub settings: Option<PathBuf>,
    /// Problem file of the plan. Default: that of the folder's summary.
    #[arg(long, value_name = "FILE")]
    pub problem: Option<PathBuf>,
    /// Write a model predictive controller instead of the regulator: it solves the rest of the plan again while it
    /// runs, with parameters that it learns; table [nmpc] of the settings.
    #[arg(long)]
    pub nmpc: bool,
    /// Hold the inputs of the trajectory between its rows. Default: what the folder's summary says, else straight
    /// lines.
    #[arg(long)]
    pub hold: bool,
    /// Folder for the results; it is made if it is not there.
    #[arg(short, long, value_name = "DIR", default_value = "out/stabilize")]
    pub output: PathBuf,
    /// Draw no figures.
    #[arg(long)]
    pub no_plots: bool,
    /// Print nothing but errors.
    #[arg(short, long)]
    pub quiet: bool,
    /// Print the JSON schema of the settings, for editors that check and complete TOML.
    #[arg(long)]
    pub schema: bool,
}

/// Runs the command.
///
/// # Errors
/// Fails if the plan cannot be read or stabilized, or the results cannot be written.
pub fn run(args: &Args) -> Result<ExitCode, Error> {
    if args.schema {
        output::print(&settings::schema())?;
        return Ok(ExitCode::SUCCESS);
    }
    let (Some(plan), Some(settings_file)) = (&args.plan, &args.settings) else {
        return Ok(ExitCode::from(super::USAGE));
    };
    let (file, problem, held) = sources(plan, args)?;
    let settings = settings::read(settings_file)?;
    let trajectory = csv::read(&file)?;
    let inputs = [file.clone(), problem.clone(), settings_file.clone()];
    let fixed = [CONTROLLER, SETTINGS, GAINS, CLOSED_LOOP, "index.html", "summary.json"];
    let names: Vec<String> = fixed.iter().chain(&SYSTEMS).map(|name| (*name).to_owned()).collect();
    folder::check(&args.output, &inputs, &names)?;
    let began = Instant::now();
    let mut prepared = prepare(&problem)?;
    let interpolation = if held { Interpolation::Hold } else { Interpolation::Linear };
    let plan = Plan { trajectory: &trajectory, file: &file, interpolation };
    let stabilized = stabilize(&mut prepared, plan, &settings)?;
    let predictive =
        args.nmpc.then(|| predictive::predictive(&prepared, &stabilized, &settings)).transpose()?;
    let design_time = began.elapsed().as_secs_f64();

    let results = folder::Results::open_beside(&args.output, &inputs, &names)?;
    let (fmu, graph) = (results.path().join(CONTROLLER), &prepared.graph);
    let description = format!("Regulator with state estimator for a plan of {}", graph.name);
    match &predictive {
        None => write_fmu(&stabilized.controller, "controller", &description, &fmu)?,
        Some(predictive) => write_predictive(predictive, graph, &fmu)?,
    }
    let states = &prepared.task.signals.states;
    let closed = wiring::write_closed_loop(
        graph,
        &prepared.catalog,
        &stabilized,
        (states, &settings),
        &fmu,
        results.path(),
    )?;
    let copied = std::fs::copy(settings_file, results.path().join(SETTINGS));
    copied.map_err(|source| PlanError::Io { file: settings_file.clone(), source })?;
    csv::write(&record::gains(&stabilized, &prepared.catalog)?, &results.path().join(GAINS))?;
    let result = run_closed_loop(&closed, &stabilized)?;
    csv::write(&result, &results.path().join(CLOSED_LOOP))?;

    let closed_name = closed.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let files = [CONTROLLER, SETTINGS, GAINS, CLOSED_LOOP].map(String::from).into_iter().chain([closed_name]);
    let mut notes = prepared.notes.clone();
    notes.extend(stabilized.notes.iter().cloned());
    notes.extend(predictive.iter().flat_map(|own| own.notes.iter().cloned()));
    let mut summary = Summary {
        schema_version: SCHEMA_VERSION,
        airloop_version: env!("CARGO_PKG_VERSION").into(),
        command: "stabilize".into(),
        trajectory_file: file,
        problem_file: problem,
        settings_file: settings_file.clone(),
        sample_time: stabilized.controller.sample_time,
        samples: stabilized.nominal.samples(),
        rests: stabilized.nominal.rests,
        signals: record::signals(&stabilized, states, &prepared.catalog),
        cycle: record::cycle(&stabilized),
        stick_figure: StickRecord::of(&prepared),
        largest_error: largest_errors(&prepared, &stabilized, &result),
        design_time,
        files: files.collect(),
        figures: Vec::new(),
        notes,
    };
    if !args.no_plots {
        summary.figures = plot::stabilize::figure_files(&summary);
    }
    record::write(&summary, &results.path().join("summary.json"))?;
    if !args.no_plots {
        plot::stabilize::draw(results.path(), &summary)?;
    }
    results.commit()?;
    let closed = args.output.join(closed.file_name().unwrap_or_default());
    if !args.quiet {
        output::print(&report(&summary, &closed, &args.output))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The FMU of a model predictive controller, with the FMUs of the system inside.
fn write_predictive(own: &Predictive, graph: &SystemGraph, fmu: &Path) -> Result<(), Error> {
    let [states, inputs, outputs] = own.paths.clone();
    let parameter = |learned: &predictive::Learned| airloop_system::Parameter {
        variables: learned.variables.clone(),
        linear: learned.linear,
    };
    let nmpc = airloop_system::Nmpc {
        states,
        inputs,
        outputs,
        estimates: own.estimates.clone(),
        parameters: own.parameters.iter().map(parameter).collect(),
        plant: own.plant.clone(),
    };
    let step = own.plant.sample_time;
    let recipe = Recipe { name: "controller".into(), step, nmpc: Some(nmpc), ..Recipe::new(graph) };
    airloop_system::write(graph, &recipe, &template_folder::template(TEMPLATE, None)?, fmu)?;
    Ok(())
}

/// Trajectory, problem file, and whether inputs are held.
fn sources(plan: &Path, args: &Args) -> Result<(PathBuf, PathBuf, bool), Error> {
    let refuse =
        |problem: &str| PlanError::Place { place: plan.display().to_string(), problem: problem.into() };
    if !plan.exists() {
        return Err(refuse("there is no such file or folder").into());
    }
    if !plan.is_dir() {
        let missing = || refuse("a trajectory alone does not say what it belongs to; give --problem FILE");
        return Ok((plan.to_owned(), args.problem.clone().ok_or_else(missing)?, args.hold));
    }
    let file = plan.join("summary.json");
    if !file.exists() {
        let problem =
            "no plan is there: it has no summary.json; give the folder that `airloop optimize -o` wrote";
        return Err(refuse(problem).into());
    }
    let summary = plan_record::read(&file).map_err(plot::Error::from)?;
    if !matches!(&*summary.status, "solved" | "acceptable") {
        let problem = format!(
            "the search for this plan ended without one (`status` {}, largest defect {}): the system cannot follow it; go on with `airloop optimize --resume`, relax the problem, or give {TRAJECTORY} and --problem to stabilize it all the same",
            summary.status,
            short(summary.max_defect)
        );
        return Err(refuse(&problem).into());
    }
    let held = summary.signals.iter().any(|signal| signal.kind == "input" && signal.held);
    let problem = match &args.problem {
        Some(given) => given.clone(),
        None => problem_of(plan, &summary.problem_file).ok_or_else(|| {
            let file = summary.problem_file.display();
            refuse(&format!(
                "its problem {file} is neither in this folder nor in one that holds the plan; give --problem FILE"
            ))
        })?,
    };
    Ok((plan.join(TRAJECTORY), problem, args.hold || held))
}

/// The problem file of a plan, whose path is that from the folder where the plan was made: this one, or one that holds
/// the plan.
fn problem_of(plan: &Path, file: &Path) -> Option<PathBuf> {
    if file.exists() {
        return Some(file.to_owned());
    }
    let plan = plan.canonicalize().ok()?;
    plan.ancestors().map(|folder| folder.join(file)).find(|own| own.exists())
}

/// The closed loop without noise, from the start of the plan over twice its length.
fn run_closed_loop(file: &Path, stabilized: &Stabilized) -> Result<TimeSeries, Error> {
    let graph = SystemGraph::open(file)?;
    let settings = MasterSettings {
        start_time: stabilized.nominal.start,
        stop_time: graph.experiment.stop.unwrap_or_default(),
        step_size: stabilized.controller.sample_time,
        ..MasterSettings::default()
    };
    let watch = Watch { stop: &AtomicBool::new(false), progress: &mut |_, _| {} };
    let run = simulate::run(&graph, &settings, None, watch)?;
    match run.end {
        End::Failed(error) => Err(error.into()),
        _ => Ok(run.result),
    }
}

/// Largest distance from the plan of every state that can be seen.
fn largest_errors(
    prepared: &Prepared,
    stabilized: &Stabilized,
    result: &TimeSeries,
) -> BTreeMap<String, f64> {
    let nominal = &stabilized.nominal;
    let error = |(i, &index): (usize, &usize)| {
        let variable = &prepared.catalog.variables()[index];
        let channel = result.channel(&variable.name).or_else(|| result.channel(&variable.path))?;
        let pairs = channel.values.iter().zip(&nominal.states[..nominal.samples()]);
        let largest = pairs.map(|(value, planned)| (value - planned[i]).abs()).fold(0.0, f64::max);
        Some((variable.name.clone(), largest))
    };
    prepared.task.signals.states.iter().enumerate().filter_map(error).collect()
}

fn report(summary: &Summary, closed: &Path, folder: &Path) -> String {
    let mut text = format!(
        "controller: states with disturbances: {}, inputs: {}, measured signals: {}, every {} s, samples: {}{}\n\n",
        summary.signals.iter().filter(|signal| signal.kind == "state").count()
            + summary
                .signals
                .iter()
                .filter(|signal| signal.kind == "input" && signal.drift > Some(0.0))
                .count(),
        summary.signals.iter().filter(|signal| signal.kind == "input").count(),
        summary.signals.iter().filter(|signal| signal.kind == "measured").count(),
        summary.sample_time,
        summary.samples,
        if summary.rests { ", then hold" } else { "" }
    );
    if let Some(cycle) = &summary.cycle {
        let largest = |own: &record::MonodromyRecord| short(own.radius);
        text += &format!(
            "cycle of {} s, run for {} turns: largest Poincaré multiplier {} as planned, {} with the regulator\n\n",
            short(cycle.period),
            cycle.turns,
            largest(&cycle.open_loop),
            largest(&cycle.closed_loop)
        );
    }
    let unit = |name: &String| {
        let signal = summary.signals.iter().find(|signal| signal.name == *name);
        signal.and_then(|signal| signal.unit.clone()).unwrap_or_default()
    };
    let rows: Vec<Vec<String>> = summary
        .largest_error
        .iter()
        .map(|(name, error)| vec![name.clone(), short(*error), unit(name)])
        .collect();
    text += &table(&["state", "largest distance from the plan", "unit"], &rows, &[1]);
    text.push('\n');
    for note in &summary.notes {
        text += &format!("note: {note}\n");
    }
    text += &format!("controller:  {}\n", folder.join(CONTROLLER).display());
    text += &format!("closed loop: {}\n", closed.display());
    if !summary.figures.is_empty() {
        text += &format!("figures:     {}\n", folder.join("index.html").display());
    }
    text
}
