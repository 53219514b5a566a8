//! Memory of instances over many lives. Alone in its binary: other tests would change the memory of the process.
#![cfg(target_os = "linux")]

use airloop_fmi::{Fmu, Slave};
use airloop_testing::fmu_library::{FIRST_ORDER, compiled};
use tempfile::TempDir;

#[test]
fn instances_and_their_states_leave_no_memory_behind() {
    let folder = TempDir::new().unwrap();
    let fmu = Fmu::open(&compiled(&folder, "first_order.c", FIRST_ORDER, &[])).unwrap();
    // Resident pages of this process, the second number of statm.
    let pages = || {
        let text = std::fs::read_to_string("/proc/self/statm").unwrap();
        text.split(' ').nth(1).unwrap().parse::<i64>().unwrap()
    };
    let live = || {
        let mut slave = Slave::instantiate(&fmu, "it", false).unwrap();
        // The handle is dropped without freeing: the instance frees what is left.
        (0..10).for_each(|_| slave.get_state(&mut None).unwrap());
    };
    (0..2000).for_each(|_| live());
    let before = pages();
    (0..20_000).for_each(|_| live());
    // A leak of one instance or one state (some 60 bytes) per round would be above 300 pages of 4 KiB.
    let grown = pages() - before;
    assert!(grown < 100, "{grown} pages");
}
