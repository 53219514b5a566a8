//! Names of signals, as messages give them. The numbers are those of Linux, and of Windows where
//! it has another.

/// Number and name of the signals that end a process.
const NAMES: &[(i32, &str)] = &[
    (1, "1 (SIGHUP)"),
    (2, "2 (SIGINT)"),
    (3, "3 (SIGQUIT)"),
    (4, "4 (SIGILL)"),
    (5, "5 (SIGTRAP)"),
    (6, "6 (SIGABRT)"),
    (7, "7 (SIGBUS)"),
    (8, "8 (SIGFPE)"),
    (9, "9 (SIGKILL)"),
    (10, "10 (SIGUSR1)"),
    (11, "11 (SIGSEGV)"),
    (12, "12 (SIGUSR2)"),
    (13, "13 (SIGPIPE)"),
    (14, "14 (SIGALRM)"),
    (15, "15 (SIGTERM)"),
    (16, "16 (SIGSTKFLT)"),
    #[cfg(windows)]
    (22, "22 (SIGABRT)"),
    (24, "24 (SIGXCPU)"),
    (25, "25 (SIGXFSZ)"),
    (26, "26 (SIGVTALRM)"),
    (27, "27 (SIGPROF)"),
    (29, "29 (SIGIO)"),
    (30, "30 (SIGPWR)"),
    (31, "31 (SIGSYS)"),
];

/// Number and name of a signal, such as `11 (SIGSEGV)`. It reads a table of constants, which a handler may do.
pub(crate) fn known(signal: i32) -> Option<&'static str> {
    NAMES.iter().find(|(number, _)| *number == signal).map(|(_, name)| *name)
}
