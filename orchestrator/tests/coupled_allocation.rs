//! Values and derivatives of a coupled system allocate nothing.
#![cfg(target_os = "linux")]
#![allow(unsafe_code, reason = "a global allocator is an unsafe trait")]

mod bent;

use std::alloc::{GlobalAlloc, Layout, System as Heap};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use airloop::coupled::{Options, System};
use airloop::fmu::InterfaceKind;
use airloop::system::SystemGraph;
use airloop::transcription::dynamics::{Dynamics, Point};
use tempfile::TempDir;

/// The system's allocator, counted.
struct Counting;

static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);

// SAFETY: every call is passed on unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of GlobalAlloc.
        unsafe { Heap.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { Heap.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

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
            before = ALLOCATIONS.load(Ordering::Relaxed);
        }
        let wave = 0.1 * (0.3 * f64::from(k)).sin();
        states.fill(wave);
        inputs.fill(1.0 - wave);
        let at = Point { time: 0.01 * f64::from(k), states: &states, inputs: &inputs };
        system.evaluate(at, &mut values).unwrap();
        system.jacobian(at, &mut values, &mut jacobian).unwrap();
        system.hessian(at, &weights, &mut hessian).unwrap();
    }
    assert_eq!(ALLOCATIONS.load(Ordering::Relaxed) - before, 0, "{}", path.display());
}

/// One test only: other tests in this process would be counted too.
#[test]
fn values_and_derivatives_allocate_nothing() {
    let before = ALLOCATIONS.load(Ordering::Relaxed);
    drop(std::hint::black_box(Box::new(1)));
    assert!(ALLOCATIONS.load(Ordering::Relaxed) > before, "the allocator does not count");
    let folder = TempDir::new().unwrap();
    for (name, kind) in [("bent.fmu", bent::Kind::Honest), ("plain.fmu", bent::Kind::Plain)] {
        nothing_is_allocated(&bent::fmu(&folder, name, kind));
    }
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/01_run/system.ssd");
    if example.with_file_name("../../target/fmu/arx-actuator.fmu").exists() {
        nothing_is_allocated(&example);
    } else {
        println!("skipped the pneumatic cart-pole: target/fmu is not built; run `make fmu`");
    }
}
