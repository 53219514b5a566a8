//! Services of Linux for workers: shared memory, sleep until a word changes, confinement of a process.

use std::fs::File;
use std::io;
use std::os::fd::{AsRawFd, FromRawFd, RawFd};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, Command, ExitStatus};
use std::sync::atomic::AtomicU32;
use std::time::Duration;

/// Number of an open file, also in another process.
pub(super) type Descriptor = RawFd;

/// Descriptor of the shared memory in a worker.
pub(super) const SHARED: Descriptor = 3;

/// New memory of length 0 that can be shared with a process.
pub(super) fn shared_memory() -> io::Result<File> {
    // SAFETY: a static name; the descriptor that comes back is nobody else's.
    unsafe {
        let flags = libc::MFD_CLOEXEC | libc::MFD_ALLOW_SEALING;
        let file = libc::memfd_create(c"airloop-worker".as_ptr(), flags);
        if file < 0 {
            return Err(io::Error::last_os_error());
        }
        // A library that makes it shorter would crash the owner, too. Where seals are unknown, that remains possible.
        libc::fcntl(file, libc::F_ADD_SEALS, libc::F_SEAL_SHRINK | libc::F_SEAL_SEAL);
        Ok(File::from_raw_fd(file))
    }
}

/// The memory behind a descriptor that was made for this process.
pub(super) fn of_descriptor(descriptor: Descriptor) -> io::Result<File> {
    // SAFETY: nobody else uses the descriptor.
    Ok(unsafe { File::from_raw_fd(descriptor) })
}

pub(super) fn descriptor(file: &File) -> Descriptor {
    file.as_raw_fd()
}

/// Maps the first `size` bytes, shared with all who do so.
pub(super) fn map(file: &File, size: usize) -> io::Result<*mut u8> {
    // SAFETY: a new mapping at a place that the system chooses.
    let base = unsafe {
        let access = libc::PROT_READ | libc::PROT_WRITE;
        libc::mmap(std::ptr::null_mut(), size, access, libc::MAP_SHARED, file.as_raw_fd(), 0)
    };
    if base == libc::MAP_FAILED { Err(io::Error::last_os_error()) } else { Ok(base.cast()) }
}

/// Ends a mapping.
///
/// # Safety
/// It is one of [`map`] with this size, and no reference into it is left.
pub(super) unsafe fn unmap(base: *mut u8, size: usize) {
    // SAFETY: as the caller says.
    unsafe { libc::munmap(base.cast(), size) };
}

/// Sleeps until someone wakes those who wait for the word, if it is `old`, at most for `limit`.
pub(super) fn sleep(word: &AtomicU32, old: u32, limit: Option<Duration>) {
    let limit = limit.map(|limit| libc::timespec {
        tv_sec: limit.as_secs() as libc::time_t,
        tv_nsec: limit.subsec_nanos().into(),
    });
    let limit = limit.as_ref().map_or(std::ptr::null(), std::ptr::from_ref);
    // SAFETY: the word is a futex that lives during the call; the limit is a local.
    unsafe { libc::syscall(libc::SYS_futex, word.as_ptr(), libc::FUTEX_WAIT, old, limit) };
}

/// Wakes one who waits for the word.
pub(super) fn wake(word: &AtomicU32) {
    // SAFETY: the word is a futex that lives during the call.
    unsafe { libc::syscall(libc::SYS_futex, word.as_ptr(), libc::FUTEX_WAKE, 1) };
}

/// Confines the process that `command` starts: a group of its own, `memory` bytes of address space, no descriptors but
/// the standard streams and `shared`, which becomes [`SHARED`], and its end with the thread that starts it.
pub(super) fn confine(command: &mut Command, shared: Option<Descriptor>, memory: u64) {
    // SAFETY: the closure runs between fork and exec and makes only calls that are safe there.
    unsafe { command.pre_exec(move || prepare(shared, memory)) };
}

/// Preparation of a worker by itself before it becomes another program.
fn prepare(shared: Option<Descriptor>, memory: u64) -> io::Result<()> {
    // SAFETY: plain system calls with numbers and locals.
    let done = unsafe {
        let first = SHARED + libc::c_int::from(shared.is_some());
        let shared = match shared {
            Some(SHARED) => libc::fcntl(SHARED, libc::F_SETFD, 0),
            Some(shared) => libc::dup2(shared, SHARED),
            None => 0,
        };
        // Whoever is not a standard stream or the shared memory stays here.
        libc::syscall(libc::SYS_close_range, first, libc::c_uint::MAX, libc::CLOSE_RANGE_CLOEXEC);
        libc::setsid();
        let limit = libc::rlimit { rlim_cur: memory, rlim_max: memory };
        libc::setrlimit(libc::RLIMIT_AS, &raw const limit);
        let none = libc::rlimit { rlim_cur: 0, rlim_max: 0 };
        libc::setrlimit(libc::RLIMIT_CORE, &raw const none);
        libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGKILL);
        shared
    };
    if done < 0 { Err(io::Error::last_os_error()) } else { Ok(()) }
}

/// Ends all processes in the group of a confined child.
pub(super) fn end_group(child: &Child) {
    // The group has this number as long as one process is in it, or the child was not waited for.
    // SAFETY: a system call with numbers.
    unsafe { libc::kill(-(child.id() as libc::pid_t), libc::SIGKILL) };
}

/// Ends all processes with an entry of their environment that begins with `entry`, and counts them. Those that ended
/// and were not waited for have no environment.
pub(super) fn end_those_with(entry: &[u8]) -> usize {
    let Ok(folders) = std::fs::read_dir("/proc") else { return 0 };
    let own = std::process::id().to_string();
    let mut count = 0;
    for folder in folders.flatten() {
        let name = folder.file_name();
        let Some(id) =
            name.to_str().filter(|name| *name != own).and_then(|name| name.parse::<libc::pid_t>().ok())
        else {
            continue;
        };
        // Processes of other users cannot be read.
        let Ok(environment) = std::fs::read(folder.path().join("environ")) else { continue };
        if environment.split(|byte| *byte == 0).any(|own| own.starts_with(entry)) {
            count += 1;
            // SAFETY: a system call with numbers.
            unsafe { libc::kill(id, libc::SIGKILL) };
        }
    }
    count
}

/// Signal that ended a process.
pub(super) fn signal(status: ExitStatus) -> Option<i32> {
    status.signal()
}
