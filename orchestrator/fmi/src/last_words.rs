//! Messages for the moment when the library of an FMU ends this process: by a crash, or by an `exit` from inside.
//!
//! Each thread notes the call that it is in. The handlers only read that note and write to the standard error, which
//! is safe in a signal handler. Libraries that run in workers ([`isolate`](crate::isolate)) do not need them.

#![allow(unsafe_code, reason = "handlers of signals and of the end of the process")]

use std::cell::Cell;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::fmi3::names;
use crate::open::Fmu;
use crate::signals;

/// Component and FMU in messages.
#[derive(Clone)]
pub(crate) struct Label {
    text: Box<str>,
    is_fmi3: bool,
}

impl Label {
    pub(crate) fn new(component: &str, fmu: &Fmu) -> Label {
        let text = format!("{component}: the FMU {}", fmu.shown.display()).into();
        Label { text, is_fmi3: fmu.description.is_fmi3() }
    }

    /// For what concerns no instance.
    pub(crate) fn of_library(path: &Path) -> Label {
        Label { text: format!("the FMU {}", path.display()).into(), is_fmi3: false }
    }
}

/// A call into an FMU.
#[derive(Clone, Copy)]
struct Site {
    /// A thin pointer, as every call of an FMU writes it down.
    label: *const Label,
    function: &'static str,
}

thread_local! {
    // Without a lazy initialization, which every call would ask about.
    static IN_CALL: Cell<Option<Site>> = const { Cell::new(None) };
}

/// This thread calls `function` of the instance with this label, which stays in place until [`leave`].
#[inline(always)]
pub(crate) fn enter(label: &Label, function: &'static str) {
    IN_CALL.set(Some(Site { label, function }));
}

/// The call came back, or was not made: this thread is in no call.
#[inline(always)]
pub fn leave() {
    end_if_copy();
    IN_CALL.set(None);
}

/// Whether this process is a copy that a library made of its process.
static IS_COPY: AtomicBool = AtomicBool::new(false);

extern "C" fn copied() {
    IS_COPY.store(true, Ordering::Relaxed);
}

/// From now on a copy of this process that a library makes (`fork`) ends where it comes back out of the library: it
/// would go on with the work of this process a second time.
pub fn end_copies() {
    // SAFETY: the handler stores a word.
    #[cfg(unix)]
    unsafe {
        libc::pthread_atfork(None, None, Some(copied));
    }
}

/// Ends this process without a word if it is such a copy.
#[inline(always)]
pub(crate) fn end_if_copy() {
    if IS_COPY.load(Ordering::Relaxed) {
        // SAFETY: ends the process, whose memory and files are those of the original.
        unsafe { libc::_exit(1) };
    }
}

const ADVICE: &str = "\n  Rows of a run up to here are in result.partial.csv of its folder; other results in it are of an \
                      earlier run.\n  With --isolate the FMU has a process of its own, and the run ends as after any error.\n";

/// Whether the program itself wants its end.
static ENDS: AtomicBool = AtomicBool::new(false);

/// The program ends by itself from here on.
pub fn end() {
    leave();
    ENDS.store(true, Ordering::Release);
}

/// Signals by which a library crashes.
const CRASHES: &[libc::c_int] = &[
    libc::SIGSEGV,
    libc::SIGILL,
    libc::SIGFPE,
    libc::SIGABRT,
    #[cfg(unix)]
    libc::SIGBUS,
    #[cfg(unix)]
    libc::SIGTRAP,
    #[cfg(unix)]
    libc::SIGSYS,
    #[cfg(target_os = "linux")]
    libc::SIGUSR1,
    #[cfg(target_os = "linux")]
    libc::SIGUSR2,
    #[cfg(target_os = "linux")]
    libc::SIGALRM,
    #[cfg(target_os = "linux")]
    libc::SIGVTALRM,
    #[cfg(target_os = "linux")]
    libc::SIGPROF,
    #[cfg(target_os = "linux")]
    libc::SIGIO,
    #[cfg(target_os = "linux")]
    libc::SIGXCPU,
];

/// From now on a crash or an `exit` in a call of an FMU names the FMU and the call; the process still ends as a
/// failure.
pub fn install() {
    end_copies();
    for &signal in CRASHES {
        // SAFETY: a zeroed action is one without mask; the handler makes only calls that are safe in it. The threads of
        // Rust have a stack of their own for handlers.
        #[cfg(unix)]
        unsafe {
            let mut action: libc::sigaction = std::mem::zeroed();
            action.sa_sigaction = crashed as *const () as libc::sighandler_t;
            action.sa_flags = libc::SA_ONSTACK | libc::SA_RESETHAND;
            libc::sigaction(signal, &raw const action, std::ptr::null_mut());
        }
        // SAFETY: the handler makes only calls that are safe in it; the C library takes it off before it calls it.
        #[cfg(not(unix))]
        unsafe {
            libc::signal(signal, crashed as *const () as libc::sighandler_t);
        }
    }
    // A file that may not grow further (`ulimit -f`) is an error of its writer.
    // SAFETY: no handler is involved.
    #[cfg(unix)]
    unsafe {
        libc::signal(libc::SIGXFSZ, libc::SIG_IGN);
    }
    // SAFETY: the handler neither panics nor unwinds.
    unsafe {
        libc::atexit(exited);
        #[cfg(target_os = "linux")]
        at_quick_exit(exited);
    }
}

#[cfg(target_os = "linux")]
unsafe extern "C" {
    /// C11; has no binding in `libc`.
    fn at_quick_exit(handler: extern "C" fn()) -> libc::c_int;
}

/// Writes to the standard error, as far as that is possible.
fn say(text: &[u8]) {
    // SAFETY: a system call with a slice; safe in a handler.
    unsafe { libc::write(2, text.as_ptr().cast(), text.len() as _) };
}

fn say_site(site: Site) {
    // SAFETY: the label of an instance that is in a call, which keeps it in place.
    let label = unsafe { &*site.label };
    say(b"\nerror: ");
    say(label.text.as_bytes());
    say(b" ended the program in ");
    // A table of constants, which a handler may read.
    say(if label.is_fmi3 { names::of(site.function) } else { site.function }.as_bytes());
}

extern "C" fn crashed(signal: libc::c_int) {
    match IN_CALL.get() {
        Some(site) => say_site(site),
        None => say(
            b"\nerror: the program crashed outside of any call of an FMU, perhaps in a thread that one left",
        ),
    }
    say(b" by signal ");
    say(signals::known(signal).unwrap_or("without a name").as_bytes());
    say(ADVICE.as_bytes());
    // The action is the default one again: the signal ends the process as it would have.
    // SAFETY: a system call.
    unsafe { libc::raise(signal) };
}

extern "C" fn exited() {
    if let Some(site) = IN_CALL.get() {
        say_site(site);
        say(b" by exit, which no library may call");
    } else if ENDS.load(Ordering::Acquire) {
        return;
    } else {
        say(b"\nerror: the program was ended by exit outside of any call of an FMU, perhaps by a thread that one left");
    }
    say(ADVICE.as_bytes());
    // SAFETY: ends the process; nothing of it is used after this.
    unsafe { libc::_exit(1) };
}
