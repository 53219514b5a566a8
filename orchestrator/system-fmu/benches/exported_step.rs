//! Cost of one communication step of an exported system, against the master of `airloop run` on the same system.
//!
//! The system of example 01 with its FMUs and the library in `target/fmu`. The FMU gets its input, steps, and is asked
//! for all outputs of its system by one call each, as an importer does; the master gets the same input and records all
//! values. Both take short turns, so that they see the same machine; the ratio is the median over the turns. Goal:
//! 1.3; it fails above 1.6.
//!
//! Run it with `cargo bench -p airloop-system-fmu --bench exported_step`.

#![allow(missing_docs, reason = "a bench has no public items")]

use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use airloop_cosim::master::{Master, Settings};
use airloop_cosim::results::Recorder;
use airloop_cosim::system::SystemGraph;
use airloop_fmi::{Causality, Fmu, Slave, StepStatus, VariableKind};
use airloop_system::{Recipe, write};

/// Short enough that most turns are not interrupted by other programs.
const STEPS: usize = 500;
const TURNS: usize = 201;
const STEP: f64 = 1e-3;
const GOAL: f64 = 1.3;
/// Programs beside this one move the ratio by 0.1.
const LIMIT: f64 = 1.6;

fn main() -> ExitCode {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let template = workspace.join("target/fmu/template/airloop-system.fmu");
    if !template.exists() {
        println!("exported_step: skipped, as there is no {}; package the FMUs first", template.display());
        return ExitCode::SUCCESS;
    }
    let graph = SystemGraph::open(&workspace.join("examples/01_run/system.ssd")).expect("the example opens");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("system.fmu");
    let recipe = Recipe { step: STEP, ..Recipe::new(&graph) };
    write(&graph, &recipe, &template, &path).expect("the system becomes an FMU");

    let fmu = Fmu::open(&path).expect("the exported FMU opens");
    let reals = |causality| -> Vec<u32> {
        let variables = fmu.description.variables.iter();
        let wanted =
            variables.filter(|v| v.causality == causality && matches!(v.kind, VariableKind::Real(_)));
        wanted.map(|variable| variable.value_reference).collect()
    };
    let (input, outputs) = (reals(Causality::Input), reals(Causality::Output));
    assert!(input.len() == 1 && !outputs.is_empty(), "example 01 has one input, and outputs");
    let mut exported = Slave::instantiate(&fmu, "system", false).expect("an instance");
    exported.setup_experiment(None, 0.0, None).expect("a start time");
    exported.enter_initialization_mode().expect("initialization mode");
    exported.exit_initialization_mode().expect("step mode");
    let settings = Settings {
        stop_time: 2.0 * (TURNS * STEPS) as f64 * STEP,
        step_size: STEP,
        read_all_outputs: true,
        ..Settings::default()
    };
    let mut master = Master::new(&graph, &settings, &[]).expect("the system starts");

    let command = |k: usize| if k % 200 < 100 { 15.0 } else { -15.0 };
    let mut values = vec![0.0; outputs.len()];
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    for turn in 0..TURNS {
        let kept = master.values();
        let width = [kept.reals.len(), kept.integers.len(), kept.booleans.len()];
        let mut recorder = Recorder::new(master.columns(&graph), width, STEPS + 1);
        ours.push(timed(|| {
            for k in 0..STEPS {
                master.set_input(0, command(k));
                master.step().expect("the system steps");
                let values = master.values();
                recorder.record(master.time(), &values.reals, &values.integers, &values.booleans);
            }
        }));
        theirs.push(timed(|| {
            for k in 0..STEPS {
                exported.set_real(&input, &[command(k)]).expect("the input is taken");
                let t = (turn * STEPS + k) as f64 * STEP;
                let status = exported.do_step(t, STEP, true).expect("the FMU steps");
                assert_eq!(status, StepStatus::Complete);
                exported.get_real(&outputs, &mut values).expect("the outputs are read");
            }
        }));
    }
    let ratios: Vec<f64> = theirs.iter().zip(&ours).map(|(theirs, ours)| theirs / ours).collect();
    let ratio = median(&ratios);
    println!("example 01, one step of {STEP} s (medians of {TURNS} turns)");
    println!("  master, all recorded  {:7.0} ns", median(&ours));
    let verdict = match ratio {
        _ if ratio <= GOAL => "ok",
        _ if ratio <= LIMIT => "above the goal",
        _ => "TOO SLOW",
    };
    println!(
        "  exported FMU          {:7.0} ns   ratio {ratio:.2}, at most {GOAL} is the goal: {verdict}",
        median(&theirs)
    );
    if ratio <= LIMIT { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Time per step \[ns\].
fn timed(work: impl FnOnce()) -> f64 {
    let began = Instant::now();
    work();
    began.elapsed().as_nanos() as f64 / STEPS as f64
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}
