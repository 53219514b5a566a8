//! Setting, stepping and reading allocate nothing once an instance runs.
#![cfg(target_os = "linux")]

mod fmu_library;

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use airloop::fmu::{Fmu, Slave};
use fmu_library::{FIRST_ORDER, compiled};
use tempfile::TempDir;

struct Counting;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is passed on to the system allocator unchanged.
#[allow(unsafe_code, reason = "an allocator is unsafe by nature")]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps the contract of `dealloc`.
        unsafe { System.dealloc(memory, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

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
    let before = ALLOCATIONS.load(Ordering::Relaxed);
    (1..1000).for_each(&mut step);
    assert_eq!(ALLOCATIONS.load(Ordering::Relaxed) - before, 0);
    // The loop did something: u of the last step is in the output.
    assert!(y[1] > 1e5, "{y:?}");
    assert_ne!(before, 0, "the counter counts");
}
