//! Errors of FMUs; each message says what to try.

use std::fmt;
use std::path::PathBuf;

use super::archive::ArchiveError;
use super::description::DescriptionError;
use super::log::LogMessage;

/// Reason why an FMU could not be opened, loaded, instantiated or called.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The archive was refused.
    #[error("{}: {source}", path.display())]
    Archive {
        /// The archive.
        path: PathBuf,
        /// Fault of the archive.
        source: ArchiveError,
    },
    /// The model description was refused.
    #[error("{}: {source}", path.display())]
    Description {
        /// The archive.
        path: PathBuf,
        /// Fault of the description.
        source: DescriptionError,
    },
    /// The FMU does not offer the interface.
    #[error("{}: the FMU has no {wanted} interface; it offers {offered}", path.display())]
    Interface {
        /// The archive.
        path: PathBuf,
        /// Interface that was asked for.
        wanted: &'static str,
        /// Interfaces of the FMU.
        offered: String,
    },
    /// No library for this platform.
    #[error(
        "{}: no library {wanted} for this platform; the FMU has binaries for {available}; rebuild it for this platform",
        path.display()
    )]
    NoBinary {
        /// The archive.
        path: PathBuf,
        /// Path of the missing library inside the archive.
        wanted: String,
        /// Platforms in the archive.
        available: String,
    },
    /// The system refused to load the library.
    #[error("{}: the library {library} cannot be loaded: {reason}", path.display())]
    Load {
        /// The archive.
        path: PathBuf,
        /// Path of the library inside the archive.
        library: String,
        /// Message of the operating system.
        reason: String,
    },
    /// The library lacks a function.
    #[error("{}: the library does not export {function}, which {interface} needs; export it with all functions of FMI", path.display())]
    MissingFunction {
        /// The archive.
        path: PathBuf,
        /// C name.
        function: &'static str,
        /// Interface.
        interface: &'static str,
    },
    /// The library is of another version of FMI than the model description.
    #[error("{}: {function} of the library answers \"{answer}\" where \"{expected}\" is needed", path.display())]
    Header {
        /// The archive.
        path: PathBuf,
        /// C name.
        function: &'static str,
        /// Answer of the library.
        answer: String,
        /// Answer of a library of the right version.
        expected: &'static str,
    },
    /// The FMU may exist only once per process.
    #[error(
        "{component}: {} declares canBeInstantiatedOnlyOncePerProcess and has an instance already; give this component a \
         copy of the .fmu file under another name, which is loaded as a library of its own",
        path.display()
    )]
    OnlyOnce {
        /// Instance name.
        component: String,
        /// The archive.
        path: PathBuf,
    },
    /// A name that C cannot take.
    #[error("{component}: {what} contains a NUL character, which no C string can hold")]
    NulCharacter {
        /// Instance name.
        component: String,
        /// Given value.
        what: String,
    },
    /// `fmi2Instantiate`, or a function of FMI 3.0 that instantiates, returned NULL.
    #[error(
        "{component}: {function} of {} returned NULL (guid \"{guid}\"){hint}{}", path.display(), LogTail(log)
    )]
    Instantiate {
        /// C name.
        function: &'static str,
        /// Instance name.
        component: String,
        /// The archive.
        path: PathBuf,
        /// The guid that was passed.
        guid: String,
        /// Remedy to try.
        hint: &'static str,
        /// Messages of the FMU.
        log: Vec<LogMessage>,
    },
    /// A call returned a status other than OK or Warning.
    #[error(transparent)]
    Call(Box<CallError>),
    /// The worker process of the FMU ended, or had to be ended.
    #[error(transparent)]
    Lost(Box<LostError>),
    /// A call on an instance that returned `fmi2Fatal` before.
    #[error(
        "{component}: {function} not called, since {cause} returned fmi2Fatal before; make a new instance"
    )]
    Dead {
        /// Instance name.
        component: String,
        /// Function that was asked for.
        function: &'static str,
        /// Function that returned `fmi2Fatal`.
        cause: &'static str,
    },
    /// Argument slices of different length.
    #[error("{component}: {function} was given {given} values where {expected} are needed")]
    Length {
        /// Instance name.
        component: String,
        /// Function that was asked for.
        function: &'static str,
        /// Length that was given.
        given: usize,
        /// Length that is needed.
        expected: usize,
    },
    /// A serialized state that no memory is to be had for.
    #[error(
        "{component}: {function} says that a saved state has {size} bytes, which is more than there is memory for; report it to the author of the FMU, or do without saved states"
    )]
    StateSize {
        /// Instance name.
        component: String,
        /// Function that was asked for.
        function: &'static str,
        /// Its answer \[bytes\].
        size: usize,
    },
    /// A saved state of another instance, or one that was freed.
    #[error(
        "{component}: {function} was given a state of another instance; a state belongs to the instance that made it"
    )]
    StateOfAnotherInstance {
        /// Instance name.
        component: String,
        /// Function that was asked for.
        function: &'static str,
    },
}

/// A worker process that ended in a call, or that was ended because the call exceeded a limit.
#[derive(Debug, Clone)]
pub struct LostError {
    /// Instance name.
    pub component: String,
    /// The archive.
    pub path: PathBuf,
    /// C name of the function that the FMU was in.
    pub function: &'static str,
    /// Time of the instance \[s\], if it has one yet.
    pub time: Option<f64>,
    /// Signal, exit code or exceeded limit.
    pub cause: String,
    /// Last messages of the FMU, and last lines that it printed.
    pub printed: Vec<String>,
}

impl LostError {
    pub(crate) fn new(
        component: &str,
        fmu: &crate::Fmu,
        time: Option<f64>,
        death: &crate::isolate::Death,
    ) -> LostError {
        let (component, path) = (component.to_owned(), fmu.shown.clone());
        let is_fmi3 = fmu.description.is_fmi3();
        let function = if is_fmi3 { crate::fmi3::names::of(death.function) } else { death.function };
        let (cause, printed) = (death.cause.clone(), death.printed.clone());
        LostError { component, path, function, time, cause, printed }
    }
}

impl fmt::Display for LostError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: the FMU {} was lost in {}", self.component, self.path.display(), self.function)?;
        if let Some(time) = self.time {
            write!(f, " at t = {time} s")?;
        }
        let advice = if self.cause.contains("did not return") {
            "it may hang there, or need longer: --call-limit allows more"
        } else if self.cause.contains("exit code") {
            "a library must not end its process: report it to the author of the FMU"
        } else {
            "the library crashed: report it to the author of the FMU; if it needs much memory, --memory-limit allows more"
        };
        write!(f, ": {}; {advice}", self.cause)?;
        self.printed.iter().try_for_each(|line| write!(f, "\n  FMU: {line}"))
    }
}

impl std::error::Error for LostError {}

/// A status that is not good, by its name in FMI 2.0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// `fmi2Discard`.
    Discard,
    /// `fmi2Error`.
    Error,
    /// `fmi2Fatal`.
    Fatal,
    /// `fmi2Pending`.
    Pending,
    /// A number that the standard does not know.
    Unknown(u32),
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Status::Discard => f.write_str("fmi2Discard"),
            Status::Error => f.write_str("fmi2Error"),
            Status::Fatal => f.write_str("fmi2Fatal"),
            Status::Pending => f.write_str("fmi2Pending"),
            Status::Unknown(value) => write!(f, "the unknown status {value}"),
        }
    }
}

/// A call that an instance answered with a status other than OK or Warning.
#[derive(Debug, Clone)]
pub struct CallError {
    /// Instance name.
    pub component: String,
    /// C name of the function.
    pub function: &'static str,
    /// Its answer.
    pub status: Status,
    /// Time of the instance \[s\], if it has one yet.
    pub time: Option<f64>,
    /// Communication step size \[s\] (`fmi2DoStep` only).
    pub step: Option<f64>,
    /// Names of the variables in the call, with the values that were to be set.
    pub variables: Vec<(String, Option<String>)>,
    /// Last messages of the FMU.
    pub log: Vec<LogMessage>,
}

/// A message lists at most this many variables.
const SHOWN_VARIABLES: usize = 5;

impl fmt::Display for CallError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let status = self.status.to_string();
        let status = if self.function.starts_with("fmi3") { status.replace("fmi2", "fmi3") } else { status };
        write!(f, "{}: {} returned {status}", self.component, self.function)?;
        for (index, (name, value)) in self.variables.iter().take(SHOWN_VARIABLES).enumerate() {
            f.write_str(if index == 0 { " for " } else { ", " })?;
            f.write_str(name)?;
            if let Some(value) = value {
                write!(f, " = {value}")?;
            }
        }
        if self.variables.len() > SHOWN_VARIABLES {
            write!(f, " and {} more", self.variables.len() - SHOWN_VARIABLES)?;
        }
        if let Some(time) = self.time {
            write!(f, " at t = {time} s")?;
        }
        if let Some(step) = self.step {
            write!(f, " with step {step} s")?;
        }
        write!(f, "; {}{}", self.advice(), LogTail(&self.log))
    }
}

impl CallError {
    /// Remedy to try next.
    fn advice(&self) -> &'static str {
        match (self.status, self.function) {
            (Status::Discard, "fmi2DoStep" | "fmi3DoStep") => "try a smaller communication step",
            (Status::Discard, function)
                if function.starts_with("fmi2Set") || function.starts_with("fmi3Set") =>
            {
                "the value was refused: check it against the variable's range (airloop inspect)"
            }
            (Status::Discard, _) => "the FMU cannot compute this here: try a smaller step or other values",
            (Status::Error, _) => {
                "the instance cannot go on: check parameters and start values, or make a new instance"
            }
            (Status::Fatal, _) => {
                "no instance of this FMU can be trusted any more in this process: start again"
            }
            (Status::Pending, _) => {
                "the FMU computes in the background, which is not supported: export it with \
                 canRunAsynchronuously = false"
            }
            (Status::Unknown(_), _) => "the library does not follow FMI: report it to its author",
        }
    }
}

impl std::error::Error for CallError {}

/// The last messages of an FMU as an appendix of an error message.
struct LogTail<'a>(&'a [LogMessage]);

impl fmt::Display for LogTail<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() {
            return f.write_str("; the FMU logged nothing");
        }
        self.0.iter().try_for_each(|message| write!(f, "\n  FMU log: {message}"))
    }
}
