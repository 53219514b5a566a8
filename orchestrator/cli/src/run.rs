//! `airloop run`: simulate, write, compare, draw.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use super::args::{InitialChoice, RunArgs};
use super::restart::{self, Partial};
use super::{coupling, folder, output, progress, report, run_study};
use airloop::Error;
use airloop::discrepancy::signals::{self, SignalTable};
use airloop::simulation::{self, Data, Request, Setup};
use airloop_cosim::master;
use airloop_cosim::master::simulate::{self, End, Run, Saving, Stimulus, Watch};
use airloop_cosim::master::{Algorithm, Effort};
use airloop_cosim::results::Keep;
use airloop_cosim::results::summary::{
    self, ConnectorRecord, CouplingRecord, EffortRecord, FmuRecord, Outcome, SCHEMA_VERSION, SignalRecord,
    Summary, Timings,
};
use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::graph::{DataType, Source};
use airloop_fmi::Causality;
use airloop_report::plot;
use airloop_series::{Interpolation, TimeSeries, csv};

/// Runs the command; the exit code says how the simulation ended.
///
/// # Errors
/// Fails if the run cannot start, or its results cannot be written.
pub fn run(args: &RunArgs) -> Result<ExitCode, Error> {
    args.isolate.choose()?;
    if let Some(study) = &args.study {
        return run_study::run(args, study);
    }
    // From here on: unpacked FMUs are to be removed, also if the program is asked to end.
    let stop = stop_flag();
    let graph = SystemGraph::open_for(&args.system, simulation::interface(args.master.into()))?;
    let mut notes = graph.notes.clone();
    let signals = match &args.signals {
        Some(file) => {
            let table = SignalTable::read(file)?;
            table.check(&graph, file)?;
            table
        }
        None => SignalTable::default(),
    };
    let input = args.input.as_ref().map(|file| record(file)).transpose()?;
    let measured = args.measured.as_ref().map(|file| record(file)).transpose()?;
    let setup = Setup::new(
        graph,
        Request {
            options: args.options(),
            input: data(&args.input, &input),
            measured: data(&args.measured, &measured),
            signals,
            start_at_measured: args.initial == InitialChoice::Measured,
            interpolation: args.interpolation.into(),
            set: &args.set,
            place: |name, value| format!("--set {name}={value}"),
        },
    )?;
    note(&setup, args, &mut notes);
    let (graph, settings) = (&setup.graph, &setup.settings);
    let goal = args.coupling_error.goal(graph, settings.algorithm)?;
    let inputs = [&args.input, &args.measured, &args.signals].into_iter().flatten().chain([&args.system]);
    let names = [restart::ROWS, restart::STATES, "summary.json", "index.html"].map(str::to_owned);
    let needed = measured.is_some() || goal.is_some() || !args.no_plots;
    check_output_step(&setup.grid, args)?;
    check_size(graph, &setup.grid, args, needed)?;
    let earlier = args.restart_from.as_ref().map(|from| restart::Earlier::open(from)).transpose()?;
    let mut results = folder::Results::open(&args.output, &inputs.cloned().collect::<Vec<_>>(), &names)?;
    let mut partial = Partial::new(&args.output, earlier.as_ref())?;
    let interval = args.save_states.map(Duration::from_secs_f64);
    let record = simulate::Record {
        keep: Keep { interval: args.output_step, only_in_file: !needed },
        file: Some(partial.file()?),
        saving: interval.map(|interval| Saving { interval, file: partial.states() }),
        from: earlier.as_ref().map(|earlier| earlier.states.clone()),
    };
    let mut run = simulate(&setup, args.quiet, &stop, record)?;
    notes.extend_from_slice(&run.notes);
    partial.take(&mut results, matches!(run.end, End::Interrupted | End::Failed(_)))?;
    if let Some(earlier) = &earlier {
        notes.push(earlier.note());
        if needed {
            run.result = restart::with_rows_before(&run.result, &results.path().join(restart::ROWS))?;
        }
    }
    let connectors = connectors(graph, &run);
    let fits = match setup.compare(&run) {
        _ if run.result.len() < 2 => Vec::new(),
        Ok(fits) => fits,
        Err(error) if matches!(run.end, End::Completed) => return Err(error.into()),
        // It ended before the first sample: what there is of the result is still worth a summary.
        Err(error) => {
            notes.push(format!("nothing is compared: {error}"));
            Vec::new()
        }
    };
    let coupling_error =
        goal.and_then(|goal| coupling::estimate(graph, settings, &run, &goal, &stop, &mut notes));
    let mut summary = summarize(args, graph, settings, &run, connectors, fits, notes);
    summary.coupling_error = coupling_error;
    if !args.no_plots {
        summary.figures = plot::run::figure_files(&summary);
    }
    summary::write(&summary, &results.path().join("summary.json"))?;
    if !args.no_plots {
        plot::run::draw(results.path())?;
    }
    results.commit()?;
    if !args.quiet {
        output::print(&report::report(&summary, args))?;
    }
    if matches!(run.end, End::Completed) && stop.load(Ordering::Relaxed) {
        eprintln!("interrupted after the run; its result is in {}", args.output.join("result.csv").display());
        return Ok(ExitCode::from(super::INTERRUPTED));
    }
    let code = exit(&run, args);
    // A call that Ctrl-C had to end is an interrupt.
    let interrupted = matches!(run.end, End::Failed(_)) && stop.load(Ordering::Relaxed);
    Ok(if interrupted { ExitCode::from(super::INTERRUPTED) } else { code })
}

/// Refuses rows between communication points: there are none.
fn check_output_step(grid: &master::Grid, args: &RunArgs) -> Result<(), Error> {
    match args.output_step {
        Some(value) if !args.adaptive.adaptive && value < grid.step() && grid.steps() > 0 => {
            let allowed = "not shorter than the communication step (--step), as rows stand at communication points; choose a shorter --step, or leave --output-step out";
            Err(master::Error::Setting { name: "output-step", value, allowed }.into())
        }
        _ => Ok(()),
    }
}

/// Refuses a result that does not fit into the memory, where it has to be there as a whole (`whole`).
fn check_size(graph: &SystemGraph, grid: &master::Grid, args: &RunArgs, whole: bool) -> Result<(), Error> {
    let variables = graph.components.iter().map(|component| &component.fmu.description.variables);
    let outputs = variables.flatten().filter(|variable| variable.causality == Causality::Output).count();
    let columns = (1 + graph.inputs.len() + graph.outputs.len() + outputs) as f64;
    let step = args.output_step.map_or(grid.step(), |step| step.max(grid.step()));
    let rows = if args.adaptive.adaptive { 0.0 } else { ((grid.stop() - grid.start()) / step).ceil() + 1.0 };
    // Once as recorded, once as a table, once as read for the figures.
    let bytes = 3.0 * 8.0 * rows * columns;
    let free = airloop_series::memory::free();
    if !whole || bytes <= free {
        return Ok(());
    }
    let gib = |bytes: f64| format!("{:.1} GiB", bytes / f64::from(1 << 30));
    Err(Error::OutputFolder {
        folder: args.output.clone(),
        problem: format!(
            "{rows} rows of {columns} columns need about {} of memory, and {} are free; give a longer --output-step or --step, or --no-plots and no measurement, with which rows only go to the file",
            gib(bytes),
            gib(free)
        ),
    })
}

fn data<'a>(file: &'a Option<PathBuf>, series: &'a Option<TimeSeries>) -> Option<Data<'a>> {
    Some(Data { label: file.as_ref()?, series: series.as_ref()? })
}

/// Notes on what the simulation begins with.
fn note(setup: &Setup, args: &RunArgs, notes: &mut Vec<String>) {
    let (graph, settings) = (&setup.graph, &setup.settings);
    if let Some(measured) = setup.measured.as_ref().filter(|measured| !measured.links.unused.is_empty()) {
        notes.push(format!("measured columns without a connector: {}", measured.links.unused.join(", ")));
    }
    if setup.grid.steps() == 0 {
        notes.push("start and stop time are the same: there is no step; give `--stop`".into());
    }
    if settings.step_size > settings.stop_time - settings.start_time && setup.grid.steps() > 0 {
        notes.push(format!(
            "the step of {} s is longer than the time span: there is one step of {} s",
            settings.step_size,
            setup.grid.last_step()
        ));
    }
    if !setup.started.is_empty() {
        notes.push(format!("start values from the measurement: {}", setup.started.join(", ")));
    }
    for (index, (name, _)) in args.set.iter().enumerate() {
        if args.set[..index].iter().any(|(earlier, _)| earlier == name) {
            notes.push(format!("`--set {name}` is given more than once: the last value holds"));
        }
    }
    if let Some(measured) = &setup.measured {
        note_states(graph, measured.data.series, settings, notes);
    }
    note_texts(graph, notes);
    note_inputs(graph, setup.stimulus().as_ref(), settings, notes);
}

/// A run that begins inside of the record begins with states that nobody measured.
fn note_states(
    graph: &SystemGraph,
    measured: &TimeSeries,
    settings: &master::Settings,
    notes: &mut Vec<String>,
) {
    const SHOWN_STATES: usize = 8;
    let inside = measured.time().first().is_some_and(|first| settings.start_time > *first);
    let states = signals::states_at_default(graph);
    if inside && !states.is_empty() {
        let more = match states.len() {
            0..=SHOWN_STATES => String::new(),
            all => format!(" and {} more", all - SHOWN_STATES),
        };
        let some = states[..states.len().min(SHOWN_STATES)].join(", ");
        notes.push(format!(
            "the run begins inside of the record, but these states begin at the start values of their models: {some}{more}"
        ));
    }
}

fn note_texts(graph: &SystemGraph, notes: &mut Vec<String>) {
    let texts = graph.outputs.iter().filter(|output| output.data_type == DataType::String);
    let names: Vec<&str> = texts.map(|output| output.name.as_str()).collect();
    if !names.is_empty() {
        notes.push(format!("texts are not in result.csv: {}", names.join(", ")));
    }
}

fn note_inputs(
    graph: &SystemGraph,
    stimulus: Option<&Stimulus>,
    settings: &master::Settings,
    notes: &mut Vec<String>,
) {
    let given = |index: usize| {
        stimulus.is_some_and(|stimulus| stimulus.links.iter().any(|(connector, ..)| *connector == index))
    };
    for (index, input) in graph.inputs.iter().enumerate() {
        if !given(index) {
            notes.push(format!(
                "no data for the system input `{0}`: it keeps its start value; name a column `{0}`, map one with --signals, or state its value with --set {0}=VALUE",
                input.name
            ));
        }
    }
    if let Some(stimulus) = stimulus.filter(|stimulus| !stimulus.links.is_empty()) {
        let time = stimulus.series.time();
        if let Some(end) = time.last().filter(|end| **end < settings.stop_time) {
            notes
                .push(format!("the input data end at {end} s: the last values are held until the stop time"));
        }
        if let Some(begin) = time.first().filter(|begin| **begin > settings.start_time) {
            notes.push(format!("the input data begin at {begin} s: the first values hold before"));
        }
    }
}

/// Largest size of a value of a record: errors are squared, and squares beyond all numbers say nothing.
const MAX_VALUE: f64 = 1e100;

/// Reads a record.
fn record(path: &Path) -> Result<TimeSeries, Error> {
    let series = csv::read(path)?;
    let is_huge = |value: f64| value.abs() > MAX_VALUE;
    for (column, channel) in series.channels().iter().enumerate() {
        let allowed = format!("a size up to {MAX_VALUE:e}");
        let huge = channel.values.iter().any(|value| is_huge(*value));
        let refused = || csv::refuse(path, column, &channel.name, &allowed, |value, _| is_huge(value));
        if let Some(error) = huge.then(refused).flatten() {
            return Err(error.into());
        }
    }
    Ok(series)
}

/// Set by Ctrl-C, SIGTERM or SIGHUP; a second signal ends the program at once.
pub(super) fn stop_flag() -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stop);
    super::interrupt::act(move || {
        airloop_fmi::isolate::interrupt();
        if flag.swap(true, Ordering::Relaxed) {
            super::interrupt::end("interrupted twice: ended at once");
        }
    });
    stop
}

/// Runs with a progress bar until `stop` is set.
fn simulate(setup: &Setup, quiet: bool, stop: &AtomicBool, record: simulate::Record) -> Result<Run, Error> {
    let bar = progress::bar(quiet, Some(0), "{bar:40} {percent:>3} %  {pos}/{len} steps  {eta} left");
    let mut progress = |done: u64, all: u64| {
        bar.set_length(all);
        bar.set_position(done);
    };
    let run = setup.run(Watch { stop, progress: &mut progress }, record);
    bar.finish_and_clear();
    run
}

fn connectors(graph: &SystemGraph, run: &Run) -> Vec<ConnectorRecord> {
    let record = |name: &str, kind: &str, unit: &Option<String>, held: bool| ConnectorRecord {
        name: name.into(),
        kind: kind.into(),
        unit: unit.clone(),
        held,
    };
    let inputs = graph
        .inputs
        .iter()
        .enumerate()
        .map(|(index, input)| record(&input.name, "input", &input.unit, graph.input_is_held(index)));
    let outputs = graph.outputs.iter().map(|output| {
        let held = match output.source {
            Source::Input(input) => graph.input_is_held(input),
            Source::Output { component, variable } => graph.is_held(component, variable),
        };
        record(&output.name, "output", &output.unit, held)
    });
    let recorded: HashSet<&str> = run.result.channels().iter().map(|channel| channel.name.as_str()).collect();
    inputs.chain(outputs).filter(|connector| recorded.contains(connector.name.as_str())).collect()
}

fn summarize(
    args: &RunArgs,
    graph: &SystemGraph,
    settings: &master::Settings,
    run: &Run,
    connectors: Vec<ConnectorRecord>,
    signals: Vec<SignalRecord>,
    fallbacks: Vec<String>,
) -> Summary {
    let end_time = run.result.time().last().copied().unwrap_or(settings.start_time);
    let (status, message) = match &run.end {
        End::Completed => ("completed", None),
        End::Terminated { component, time } => {
            let own = time.unwrap_or(end_time);
            let rest = match own > end_time {
                true => {
                    format!("; the result ends at {end_time} s, the last point that all components reached")
                }
                false => String::new(),
            };
            ("terminated", Some(format!("component {component} ended the simulation at t = {own} s{rest}")))
        }
        End::Interrupted => ("interrupted", Some(format!("interrupted at t = {end_time} s"))),
        End::Failed(error) => ("failed", Some(error.to_string())),
    };
    let fmu = |index: &usize| {
        let component = &graph.components[*index];
        let description = &component.fmu.description;
        FmuRecord {
            component: component.name.clone(),
            model_name: description.model_name.clone(),
            guid: description.guid.clone(),
            path: component.fmu.shown.clone(),
            version: text(&description.version),
            generation_tool: text(&description.generation_tool),
        }
    };
    Summary {
        schema_version: SCHEMA_VERSION,
        airloop_version: env!("CARGO_PKG_VERSION").into(),
        system: graph.name.clone(),
        system_file: args.system.clone(),
        settings: summary::Settings {
            start_time: settings.start_time,
            stop_time: settings.stop_time,
            step_size: settings.step_size,
            master: settings.algorithm.to_string(),
            interpolation: match args.interpolation.into() {
                Interpolation::Linear => "linear".into(),
                Interpolation::Hold => "hold".into(),
            },
            extrapolation: settings.extrapolation,
            coupling: (settings.algorithm == Algorithm::InterfaceJacobian).then_some(CouplingRecord {
                corrections: settings.coupling.corrections,
                iterate: settings.coupling.tolerance,
                inputs: if settings.coupling.ramped { "ramped".into() } else { "held".into() },
            }),
            tolerance: settings.tolerance,
            input: args.input.clone(),
            measured: args.measured.clone(),
            initial: args.measured.as_ref().map(|_| match args.initial {
                InitialChoice::Measured => "measured".into(),
                InitialChoice::Zero => "zero".into(),
            }),
            set: args.set.iter().map(|(name, value)| format!("{name}={value}")).collect(),
        },
        outcome: Outcome { status: status.into(), message, end_time, steps: run.steps },
        integration: run.integration.clone(),
        adaptive: run.adaptive.clone(),
        timings: Timings::new(run.initialization, run.stepping, run.steps, settings.start_time, end_time),
        effort: effort(graph, &run.effort),
        fmus: graph.order.iter().map(fmu).collect(),
        connectors,
        signals,
        figures: Vec::new(),
        coupling_error: None,
        fallbacks,
    }
}

fn effort(graph: &SystemGraph, effort: &Effort) -> EffortRecord {
    let names = graph.order.iter().map(|&index| graph.components[index].name.clone());
    EffortRecord {
        fmu_steps: effort.fmu_steps.iter().sum(),
        steps_of: names.zip(effort.fmu_steps.iter().copied()).collect(),
        static_evaluations: effort.static_evaluations,
        newton_rounds: effort.newton_rounds,
        coupled_passes: effort.coupled_passes,
    }
}

fn text(text: &str) -> Option<String> {
    Some(text.to_owned()).filter(|text| !text.is_empty())
}

fn exit(run: &Run, args: &RunArgs) -> ExitCode {
    let kept = args.output.join("result.csv");
    match &run.end {
        End::Completed | End::Terminated { .. } => ExitCode::SUCCESS,
        End::Interrupted => {
            output::to_stderr(&format!("interrupted; the result so far is in {}", kept.display()));
            ExitCode::from(super::INTERRUPTED)
        }
        End::Failed(error) => {
            output::to_stderr(&format!("error: {error}\nthe result so far is in {}", kept.display()));
            ExitCode::FAILURE
        }
    }
}
