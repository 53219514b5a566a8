//! The place of `linux.rs` on other systems: FMUs run in this process there, and a check in a process that is not
//! confined.

use std::fs::File;
use std::io;
use std::process::{Child, Command, ExitStatus};
use std::sync::atomic::AtomicU32;
use std::time::Duration;

pub(super) type Descriptor = i32;

pub(super) const SHARED: Descriptor = 3;

fn refused() -> io::Error {
    io::Error::new(io::ErrorKind::Unsupported, "worker processes exist on Linux only; leave --isolate out")
}

pub(super) fn shared_memory() -> io::Result<File> {
    Err(refused())
}

pub(super) fn of_descriptor(_: Descriptor) -> io::Result<File> {
    Err(refused())
}

pub(super) fn descriptor(_: &File) -> Descriptor {
    -1
}

pub(super) fn map(_: &File, _: usize) -> io::Result<*mut u8> {
    Err(refused())
}

/// # Safety
/// None is needed: there is no mapping.
pub(super) unsafe fn unmap(_: *mut u8, _: usize) {}

pub(super) fn sleep(_: &AtomicU32, _: u32, _: Option<Duration>) {}

pub(super) fn wake(_: &AtomicU32) {}

pub(super) fn confine(_: &mut Command, _: Option<Descriptor>, _: u64) {}

pub(super) fn end_group(_: &Child) {}

pub(super) fn end_those_with(_: &[u8]) -> usize {
    0
}

pub(super) fn signal(_: ExitStatus) -> Option<i32> {
    None
}
