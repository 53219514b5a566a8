//! Definition of the command line.

#![allow(
    rustdoc::broken_intra_doc_links,
    reason = "these texts are the help of the program, brackets are units"
)]

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

use airloop::simulation::Options;
use airloop_cosim::master::{Adaptive, Algorithm};
use airloop_series::Interpolation;
use airloop_series::units::{parse_duration, parse_time};

/// Couple FMI 2.0 and 3.0 units and simulate them, identify models from measurements, optimize and stabilize motions,
/// and find the physical effects that a model lacks.
#[derive(Debug, Parser)]
#[command(
    name = "airloop",
    version,
    propagate_version = true,
    after_help = "Exit codes: 0 success, 1 failure, 2 wrong usage, 130 interrupted (Ctrl-C, SIGTERM, SIGHUP; the result so far is kept)."
)]
pub struct Cli {
    /// Action to perform.
    #[command(subcommand)]
    pub command: Command,
}

/// The subcommands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Simulate a system and compare it with a measurement.
    ///
    /// Writes result.csv (first column time [s], then the connectors of the system by their plain name, then all
    /// outputs as component.variable), summary.json (settings, FMUs, timings, fits), figures as SVG, and index.html
    /// with all of them. What an earlier run left in the folder is removed.
    ///
    /// Inputs are set at the start of each step and held within it, unless the master lets them follow a line
    /// (--extrapolation, --master interface-jacobian or monolithic). Outputs are read after the step and stand at its
    /// end; those with direct feed-through then still belong to the inputs of the step. A discrete output that depends
    /// directly on an input stands at the start of the step over which it is held: a sampled output y(k) is in the row
    /// of k Ts. A discrete output that only changes by events or time stands where it is read.
    Run(Box<RunArgs>),
    /// Show what an FMU or a system consists of.
    Inspect(super::inspect::Args),
    /// Write a system, with changed start values if wanted, as an SSP file for other tools.
    ///
    /// The written system gives the same results, bit for bit. Geometry, annotations, connectors that are not
    /// connected, and the step size and tolerance of a single FMU are not kept.
    Export(super::export::Args),
    /// Write a whole system as one FMU: its FMUs, its parameters and a master inside.
    ///
    /// Co-Simulation steps the components as `airloop run` does, with the same numbers; Model Exchange is the system as
    /// one differential equation, without coupling error. Inputs and outputs of the system are those of the FMU;
    /// parameters, outputs and states of the components are its variables component.variable. The FMU runs on the
    /// platforms that all components have, and can be a component itself.
    ExportFmu(super::export_fmu::Args),
    /// Write one of our FMUs with start values, name and GUID of its own, for any FMI tool.
    Derive(super::derive::Args),
    /// Write a command for an experiment: chirp, random stairs, multisine or pseudo-random binary sequence.
    Excite(super::excite::Args),
    /// Put records on a uniform grid, by their own time stamps and without aliasing.
    ///
    /// On a coarser grid continuous signals pass a zero-phase low-pass first; columns of --held (commands, discrete
    /// signals) keep their last sample. Units stay. What was done is printed.
    Resample(super::resample::Args),
    /// A virtual rig: records as an experimenter would take them.
    Rig {
        /// Action to perform.
        #[command(subcommand)]
        command: super::rig::Command,
    },
    /// Identify a model from measured inputs and outputs.
    Identify {
        /// Kind of model.
        #[command(subcommand)]
        command: super::identify::Command,
    },
    /// Find a motion for a system of FMUs: the least cost within bounds, from a problem file.
    ///
    /// Writes trajectory.csv (time [s], states, inputs, costates), command.csv (to be played with `airloop run
    /// --input`), summary.json, iterations.csv, the roll-outs of the command through a master, figures as SVG, and
    /// index.html with an animation. The gap between plan and roll-outs is reported.
    Optimize(Box<super::optimize::args::Args>),
    /// Keep a system on its plan: a regulator with state estimator, written as an FMU, and the closed loop with it.
    ///
    /// Writes controller.fmu (for any FMI 2.0 tool), closed_loop.ssd (for `airloop run`), gains.csv, closed_loop.csv (a
    /// run of it), summary.json and figures.
    Stabilize(super::stabilize::Args),
    /// Try a stabilized plan, and the plan alone, on perturbed systems with sensor noise.
    ///
    /// Writes trials.csv, trajectories.csv (the first ten trials), summary.json and figures.
    Trials(super::trials::Args),
    /// Find the physical effect that a declared model lacks, from measured records.
    ///
    /// Writes report.json, report.md and report.html. Candidates are fitted in simulation on the estimation records;
    /// errors are reported on the validation records.
    Refine(super::refine::Args),
    /// Thousands of independent tasks as one plan: simulations over samples of parameters, trials, fits, searches; on
    /// one computer or a cluster, with the same results.
    Sweep {
        /// Action to perform.
        #[command(subcommand)]
        command: super::sweep::Command,
    },
    /// The process of an FMU; other commands start it.
    #[command(hide = true)]
    FmuWorker,
    /// Begin something of one's own with a file that explains itself.
    New {
        /// Beginning.
        #[command(subcommand)]
        command: super::new::Command,
    },
    /// Effects of one's own, written as formulas: for `airloop refine --effects`.
    Effects {
        /// Action to perform.
        #[command(subcommand)]
        command: super::effects::Command,
    },
    /// Print a completion script for a shell, e.g. `airloop completions bash >
    /// ~/.local/share/bash-completion/completions/airloop`.
    Completions {
        /// Shell.
        shell: clap_complete::Shell,
    },
}

/// `airloop run`
#[derive(Debug, Args)]
#[command(
    group = clap::ArgGroup::new("data").multiple(true),
    after_help = "Exit codes: 0 success (also if a component ends the simulation), 1 failure (the result so far is kept), 2 wrong usage (also a time, step or tolerance out of range), 130 interrupted (Ctrl-C, SIGTERM, SIGHUP; the result so far is kept).\n\nExample: airloop run examples/01_run/system.ssd --measured record.csv --step 1ms -o out/run"
)]
pub struct RunArgs {
    /// System: .ssd or .ssp (SSP 1.0 or 2.0), or a single .fmu.
    pub system: PathBuf,
    /// Stop time [s], e.g. 4 or 500ms. Default: end of the measured or input data, else the default experiment of
    /// the system.
    #[arg(long, value_parser = parse_time, value_name = "TIME", allow_hyphen_values = true)]
    pub stop: Option<f64>,
    /// Communication step size [s], e.g. 1ms or 0.001; the last step is shortened to meet the stop time. Default:
    /// that of the default experiment of a single FMU, else 1ms.
    #[arg(long, value_parser = parse_duration, value_name = "TIME", allow_hyphen_values = true)]
    pub step: Option<f64>,
    /// Start time [s]. Default: first time of the measured or input data, else the default experiment, else 0.
    #[arg(long, value_parser = parse_time, value_name = "TIME", allow_hyphen_values = true)]
    pub start: Option<f64>,
    /// Coupling of the components.
    #[arg(long, value_enum, default_value_t = MasterChoice::GaussSeidel)]
    pub master: MasterChoice,
    /// Order of the polynomials that inputs follow inside a step of Gauss-Seidel or Jacobi, through the last values of
    /// what feeds them; 0 (default) holds them. Higher orders are more exact at short steps and unstable sooner.
    #[arg(long, value_name = "ORDER", value_parser = clap::value_parser!(u32).range(0..=2))]
    pub extrapolation: Option<u32>,
    /// Options of one master.
    #[command(flatten)]
    pub coupling: CouplingArgs,
    /// Options of adaptive steps.
    #[command(flatten)]
    pub adaptive: AdaptiveArgs,
    /// Estimate of the coupling error.
    #[command(flatten)]
    pub coupling_error: super::coupling::CouplingErrorArgs,
    /// CSV file with inputs of the system: first column time [s] (or for example `time [ms]`), then one column per
    /// input. Truth values are 0 and 1, or true and false.
    #[arg(long, value_name = "FILE", group = "data")]
    pub input: Option<PathBuf>,
    /// Continuous inputs between their samples; inputs that are discrete, or no Reals, are always held. The inputs of a
    /// step are those at its start. At a communication point both choices give the sample, so that for a command
    /// sampled on the communication grid they agree; choose hold for a sampled command and steps that divide its
    /// sample time.
    #[arg(long, value_enum, default_value_t = InterpolationChoice::Linear)]
    pub interpolation: InterpolationChoice,
    /// Start value of a parameter, input or state, in the unit of the variable: component.variable=value (or
    /// variable=value for a single FMU). May be repeated.
    #[arg(long, value_name = "NAME=VALUE", value_parser = parse_assignment)]
    pub set: Vec<(String, String)>,
    /// CSV file with a measurement: outputs of the system to compare with, and its inputs unless --input is given.
    /// Columns belong to the connectors of the same name, else see --signals.
    #[arg(long, value_name = "FILE", group = "data")]
    pub measured: Option<PathBuf>,
    /// Start of the states that are measured: at the first measured value, or at the start values of the model
    /// (usually zero). A zero start can cost several points of fit.
    #[arg(long, value_enum, default_value_t = InitialChoice::Measured, requires = "measured")]
    pub initial: InitialChoice,
    /// TOML file with a [signals] table: connector = "column", for columns of another name.
    #[arg(long, value_name = "FILE", requires = "data")]
    pub signals: Option<PathBuf>,
    /// Study whose records are simulated as the study compares them: its inputs (scaled, filtered or derived), initial
    /// states (given, measured or fitted) and windows. Of the amended system of a refine report the errors are those of
    /// the report. Simulated through Model Exchange with the step of the study.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["data", "set", "stop", "step", "start", "tolerance"])]
    pub study: Option<PathBuf>,
    /// Every record of the --study as one free run: initial states are fitted to so much of its beginning, e.g. 0.5s,
    /// and errors are those of the rest. Default: initial states and windows of the study.
    #[arg(long, value_parser = super::export::parse_step, value_name = "TIME", allow_hyphen_values = true, requires = "study")]
    pub free_run: Option<f64>,
    /// Time between the rows of the result [s], e.g. 10ms: the communication points nearest to its multiples, with the
    /// first and the last; not shorter than --step. Default: every communication point.
    #[arg(long, value_parser = super::export::parse_step, value_name = "TIME", allow_hyphen_values = true)]
    pub output_step: Option<f64>,
    /// Save the states of all FMUs at this interval of real time, e.g. 60s or 10min, and where the run is interrupted,
    /// for --restart-from. For masters with a fixed --step and FMUs that can serialize their states.
    #[arg(long, value_parser = super::restart::parse_interval, value_name = "TIME", allow_hyphen_values = true, conflicts_with = "study")]
    pub save_states: Option<f64>,
    /// Continue a run from the states that it saved last (--save-states), whatever ended it: its folder, or its file
    /// result.states.json (result.partial.states.json of a run that was killed) with the rows beside it. The other
    /// options are those of that run. The result has the rows before, too, and is that of the unbroken run, bit for
    /// bit.
    #[arg(long, value_name = "PATH", conflicts_with = "study")]
    pub restart_from: Option<PathBuf>,
    /// Processes of FMUs.
    #[command(flatten)]
    pub isolate: super::isolate::IsolateArgs,
    /// Folder for the results; it is made if it is not there.
    #[arg(short, long, value_name = "DIR", default_value = "out/run")]
    pub output: PathBuf,
    /// Relative tolerance for solvers inside FMUs, between 0 and 1. Default: each FMU uses its own. Also that of
    /// --master monolithic, there by default 1e-10.
    #[arg(long, value_name = "NUMBER", allow_hyphen_values = true)]
    pub tolerance: Option<f64>,
    /// Draw no figures.
    #[arg(long)]
    pub no_plots: bool,
    /// Print nothing but errors.
    #[arg(short, long)]
    pub quiet: bool,
}

const COUPLING: &str = "Options of --master interface-jacobian";

/// Options of `--master interface-jacobian`.
#[derive(Debug, Clone, Args)]
pub struct CouplingArgs {
    /// Number of times that the slaves of a coupled component repeat a step from their saved state. 0: the prediction
    /// is kept, and no state is saved. Default: 1.
    #[arg(long, value_name = "NUMBER", conflicts_with = "iterate", value_parser = clap::value_parser!(u32).range(0..=20), help_heading = COUPLING)]
    pub corrections: Option<u32>,
    /// Repeat until the outputs change by less than this part of the larger of value and nominal value, e.g. 1e-6.
    #[arg(long, value_name = "TOL", help_heading = COUPLING)]
    pub iterate: Option<f64>,
    /// Interpolation of inputs inside a communication step. Default: ramped.
    #[arg(long, value_enum, help_heading = COUPLING)]
    pub inputs: Option<InputsChoice>,
}

const ADAPTIVE: &str = "Adaptive communication steps";

/// Options of adaptive communication steps.
#[derive(Debug, Clone, Args)]
pub struct AdaptiveArgs {
    /// Choose every communication step by its error, from --step on. gauss-seidel and jacobi repeat each step from the
    /// saved states with inputs that run toward the result of the pass before; interface-jacobian makes it whole and in
    /// two halves, which are kept. For gauss-seidel, jacobi and interface-jacobian; all FMUs must save and restore
    /// their state. Steps end at samples of components and inputs; interface-jacobian may span whole samples of
    /// components.
    #[arg(long, help_heading = ADAPTIVE)]
    pub adaptive: bool,
    /// Error of one step that is allowed, relative to the largest value of the signal so far (at least a hundredth of
    /// its nominal value). Default: 1e-4.
    #[arg(long, value_name = "TOL", requires = "adaptive", help_heading = ADAPTIVE)]
    pub step_tolerance: Option<f64>,
    /// Shortest communication step [s]; a run that needs a shorter one fails. Default: --step / 1000000.
    #[arg(long, value_parser = parse_duration, value_name = "TIME", requires = "adaptive", help_heading = ADAPTIVE)]
    pub min_step: Option<f64>,
    /// Longest communication step [s]. Default: 10 * --step.
    #[arg(long, value_parser = parse_duration, value_name = "TIME", requires = "adaptive", help_heading = ADAPTIVE)]
    pub max_step: Option<f64>,
}

impl RunArgs {
    /// Choices for the simulation.
    pub fn options(&self) -> Options {
        let tolerance = self.adaptive.step_tolerance.unwrap_or(Adaptive::default().tolerance);
        let (min_step, max_step) = (self.adaptive.min_step, self.adaptive.max_step);
        Options {
            start: self.start,
            stop: self.stop,
            step: self.step,
            algorithm: self.master.into(),
            extrapolation: self.extrapolation,
            tolerance: self.tolerance,
            adaptive: self.adaptive.adaptive.then_some(Adaptive { tolerance, min_step, max_step }),
            corrections: self.coupling.corrections,
            iterate: self.coupling.iterate,
            ramped: self.coupling.inputs.map(|inputs| inputs == InputsChoice::Ramped),
        }
    }
}

/// `--inputs`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum InputsChoice {
    /// Straight lines (for FMUs that take input derivatives) with the mean and the first moment of the input.
    Ramped,
    /// Held at their mean.
    Held,
}

/// `--master`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum MasterChoice {
    /// Serial: in evaluation order, each slave gets the newest outputs of those before it. Algebraic loops are solved
    /// at every communication point.
    GaussSeidel,
    /// Parallel: outputs are exchanged, then all slaves step; every connection is one step late, but for those of
    /// algebraic loops, which are solved at every communication point.
    Jacobi,
    /// Linearly implicit: strongly coupled components are solved in the master, then their slaves step, with
    /// rollback. For stiff coupling; accurate at long steps.
    InterfaceJacobian,
    /// All components as one differential equation through Model Exchange: explicit Runge-Kutta of order 8 with error
    /// control (--tolerance), state and time events, algebraic loops; no coupling error. --step sets the rows of
    /// the result, and no integrator step is longer.
    Monolithic,
}

impl From<MasterChoice> for Algorithm {
    fn from(choice: MasterChoice) -> Algorithm {
        match choice {
            MasterChoice::GaussSeidel => Algorithm::GaussSeidel,
            MasterChoice::Jacobi => Algorithm::Jacobi,
            MasterChoice::InterfaceJacobian => Algorithm::InterfaceJacobian,
            MasterChoice::Monolithic => Algorithm::Monolithic,
        }
    }
}

/// `--interpolation`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum InterpolationChoice {
    /// Straight line between samples.
    Linear,
    /// Each sample is held until the next.
    Hold,
}

impl From<InterpolationChoice> for Interpolation {
    fn from(choice: InterpolationChoice) -> Interpolation {
        match choice {
            InterpolationChoice::Linear => Interpolation::Linear,
            InterpolationChoice::Hold => Interpolation::Hold,
        }
    }
}

/// `--initial`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum InitialChoice {
    /// At the first measured value.
    Measured,
    /// At the start values of the model.
    Zero,
}

pub(super) fn parse_assignment(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.trim().is_empty() => Ok((name.trim().into(), value.trim().into())),
        _ => Err("write component.variable=value".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_definition_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn assignments_need_a_name_and_keep_later_equal_signs() {
        assert_eq!(parse_assignment("a.b = x=y"), Ok(("a.b".into(), "x=y".into())));
        assert!(parse_assignment("=1").is_err() && parse_assignment("a.b").is_err());
    }
}
