//! Values and derivatives of a coupled system allocate nothing.
#![cfg(target_os = "linux")]

use airloop_testing::{allocations, bent};

airloop_testing::count_allocations!();
use std::path::Path;

use airloop_cosim::coupled::{Options, System};
use airloop_cosim::system::SystemGraph;
use airloop_fmi::InterfaceKind;
use airloop_ocp::transcription::dynamics::{Dynamics, Point};
use tempfile::TempDir;

fn nothing_is_allocated(path: &Path) {
    let graph = SystemGraph::open_for(path, InterfaceKind::ModelExchange).unwrap();
    let mut system = System::open(&graph, &Options::default()).unwrap();
    let size = system.size();
    let (mut values, mut jacobian) = (vec![0.0; size.values()], vec![0.0; size.values() * size.arguments()]);
    let mut hessian = vec![0.0; size.arguments() * size.arguments()];
    let (weights, mut states, mut inputs) =
        (vec![0.6; size.values()], vec![0.0; size.states], vec![0.0; size.inputs]);
    let mut before = 0;
    for k in 0..200 {
        // The first calls may set up what the FMUs and the thread need.
        if k == 10 {
            before = allocations::count();
        }
        let wave = 0.1 * (0.3 * f64::from(k)).sin();
        states.fill(wave);
        inputs.fill(1.0 - wave);
        let at = Point { time: 0.01 * f64::from(k), states: &states, inputs: &inputs };
        system.evaluate(at, &mut values).unwrap();
        system.jacobian(at, &mut values, &mut jacobian).unwrap();
        system.hessian(at, &weights, &mut hessian).unwrap();
    }
    assert_eq!(allocations::count() - before, 0, "{}", path.display());
}

/// One test only: other tests in this process would be counted too.
#[test]
fn values_and_derivatives_allocate_nothing() {
    let before = allocations::count();
    drop(std::hint::black_box(Box::new(1)));
    assert!(allocations::count() > before, "the allocator does not count");
    let folder = TempDir::new().unwrap();
    for (name, kind) in [("bent.fmu", bent::Kind::Honest), ("plain.fmu", bent::Kind::Plain)] {
        nothing_is_allocated(&bent::fmu(&folder, name, kind));
    }
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/01_run/system.ssd");
    if example.with_file_name("../../target/fmu/arx-actuator.fmu").exists() {
        nothing_is_allocated(&example);
    } else {
        println!("skipped the pneumatic cart-pole: target/fmu is not built; run `make fmu`");
    }
}
