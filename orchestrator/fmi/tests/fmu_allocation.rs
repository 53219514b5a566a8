//! Setting, stepping and reading allocate nothing once an instance runs.
#![cfg(target_os = "linux")]

use airloop_testing::allocations;

airloop_testing::count_allocations!();
use airloop_fmi::{Fmu, Slave};
use airloop_testing::fmu_library::{FIRST_ORDER, compiled};
use tempfile::TempDir;

#[test]
fn a_running_instance_allocates_nothing() {
    let folder = TempDir::new().unwrap();
    let fmu = Fmu::open(&compiled(&folder, "first_order.c", FIRST_ORDER, &[])).unwrap();
    let mut slave = Slave::instantiate(&fmu, "it", false).unwrap();
    slave.setup_experiment(None, 0.0, None).unwrap();
    slave.enter_initialization_mode().unwrap();
    slave.exit_initialization_mode().unwrap();
    let mut state = None;
    let (mut y, mut out) = ([0.0; 2], [0.0; 1]);
    let mut step = |number: i32| {
        slave.set_real(&[0], &[f64::from(number)]).unwrap();
        slave.get_state(&mut state).unwrap();
        slave.do_step(f64::from(number) * 0.01, 0.01, false).unwrap();
        slave.set_state(state.as_ref().unwrap()).unwrap();
        slave.get_real(&[1, 3], &mut y).unwrap();
        slave.directional_derivative(&[3], &[0], &[1.0], &mut out).unwrap();
    };
    step(0);
    let before = allocations::count();
    (1..1000).for_each(&mut step);
    assert_eq!(allocations::count() - before, 0);
    // The loop did something: u of the last step is in the output.
    assert!(y[1] > 1e5, "{y:?}");
    assert_ne!(before, 0, "the counter counts");
}
