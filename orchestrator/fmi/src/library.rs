//! The shared library of an FMU: where it lies in the archive, loading, first questions.

#![allow(unsafe_code, reason = "loading and asking a third-party library")]

use std::ffi::{CStr, c_char};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use fmi::fmi2::binding::Fmi2Binding;
use fmi::fmi3::binding::Fmi3Binding;

use super::error::{Error, LostError};
use super::fmi3;
use super::functions::{CommonFunctions, FirstFunctions, ModelFunctions, SlaveFunctions};
use super::isolate::{self, Channel, Isolation};
use super::loading::{Code, Loading};
use super::open::{Fmu, InterfaceKind};

/// Names of the folder below `binaries/` that fit this machine, best first. FMI 2.0 names only the 32 and 64 bit
/// x86 platforms; for others the tuples of FMI 3.0 are usual.
pub(super) fn platform_folders() -> &'static [&'static str] {
    match (std::env::consts::OS, std::env::consts::ARCH) {
        ("linux", "x86_64") => &["linux64", "x86_64-linux"],
        ("linux", "x86") => &["linux32", "x86-linux"],
        ("linux", "aarch64") => &["aarch64-linux"],
        ("macos", "x86_64") => &["darwin64", "x86_64-darwin"],
        ("macos", "aarch64") => &["aarch64-darwin", "darwin64"],
        ("windows", "x86_64") => &["win64", "x86_64-windows"],
        ("windows", "x86") => &["win32", "x86-windows"],
        _ => &[],
    }
}

/// The functions of an FMI 3.0 library.
#[derive(Clone, Copy)]
pub(super) struct ThreeFunctions {
    pub(super) common: fmi3::functions::Functions,
    pub(super) slave: Option<fmi3::functions::SlaveFunctions>,
    pub(super) model: Option<fmi3::functions::ModelFunctions>,
}

/// How instances of a library are made.
pub(super) enum Origin {
    /// By fmi2Instantiate.
    Two(FirstFunctions),
    /// By a component that translates.
    Three(Box<ThreeFunctions>),
    /// By a worker process.
    Worker(Arc<Channel>),
}

/// The loaded code, which the function tables point into.
pub(super) enum Binding {
    Two { _code: Box<Fmi2Binding> },
    Three { _code: Box<Fmi3Binding> },
}

/// A loaded library with the functions of the interfaces that it has.
pub(super) struct Library {
    pub(super) common: CommonFunctions,
    pub(super) slave: Result<SlaveFunctions, &'static str>,
    pub(super) model: Result<ModelFunctions, &'static str>,
    /// Whether an instance exists of an FMU that allows one only.
    pub(super) occupied: AtomicBool,
    pub(super) origin: Origin,
    _code: Option<Code>,
}

impl Library {
    /// Loads `folder/inner` for the archive `path` and checks that it speaks FMI 2.0.
    pub(super) fn load(path: &Path, folder: &Path, inner: &str) -> Result<Self, Error> {
        let loading = Loading::begin(path);
        // SAFETY: loading runs the initializers of third-party code; whoever opens an FMU to run it trusts that code.
        let binding = bind(path, folder, inner, |library| unsafe { Fmi2Binding::new(library) })?;
        let first = FirstFunctions::new(&binding).map_err(missing(path, "FMI 2.0"))?;
        let common = CommonFunctions::new(&binding).map_err(missing(path, "FMI 2.0"))?;
        // SAFETY: both functions take nothing and return a static C string (FMI 2.0.5 section 2.1.4).
        let (platform, version) = unsafe { ((first.get_types_platform)(), (first.get_version)()) };
        answers(path, "fmi2GetTypesPlatform", text(platform), "default", |answer| answer == "default")?;
        answers(path, "fmi2GetVersion", text(version), "2.0", |answer| answer == "2.0")?;
        Ok(Library {
            common,
            slave: SlaveFunctions::new(&binding),
            model: ModelFunctions::new(&binding),
            occupied: AtomicBool::new(false),
            origin: Origin::Two(first),
            _code: Some(loading.end(Binding::Two { _code: Box::new(binding) })),
        })
    }

    /// Same as [`Self::load`] for a library of FMI 3.0.
    pub(super) fn load_fmi3(path: &Path, folder: &Path, inner: &str) -> Result<Self, Error> {
        let loading = Loading::begin(path);
        // SAFETY: as for FMI 2.0.
        let binding = bind(path, folder, inner, |library| unsafe { Fmi3Binding::new(library) })?;
        let functions = fmi3::functions::Functions::new(&binding).map_err(missing(path, "FMI 3.0"))?;
        answers(path, "fmi3GetVersion", functions.version(), "3.0", |answer| answer.starts_with("3."))?;
        let slave = fmi3::functions::SlaveFunctions::new(&binding);
        let model = fmi3::functions::ModelFunctions::new(&binding);
        let three = ThreeFunctions { common: functions, slave: slave.ok(), model: model.ok() };
        Ok(Library {
            common: fmi3::tables::common(&three),
            slave: slave.map(|_| fmi3::tables::slave(&three)),
            model: model.map(|_| fmi3::tables::MODEL),
            occupied: AtomicBool::new(false),
            origin: Origin::Three(Box::new(three)),
            _code: Some(loading.end(Binding::Three { _code: Box::new(binding) })),
        })
    }

    /// The worker that has the library, if it is not in this process.
    pub(super) fn remote(&self) -> Option<&Arc<Channel>> {
        match &self.origin {
            Origin::Worker(channel) => Some(channel),
            Origin::Two(_) | Origin::Three(_) => None,
        }
    }

    /// Has the library of an interface loaded by a process of its own.
    pub(super) fn in_worker(
        fmu: &Fmu,
        kind: InterfaceKind,
        inner: &str,
        isolation: &Isolation,
    ) -> Result<Self, Error> {
        let refused = |reason| Error::Load { path: fmu.shown.clone(), library: inner.to_owned(), reason };
        let channel = Channel::open(isolation, fmu)
            .map_err(|error| refused(format!("no process of its own can be started: {error}")))?;
        let Some(found) = isolate::functions(&channel, fmu, kind) else {
            let death = channel.death().cloned().unwrap_or_default();
            let component = fmu.shown.file_stem().unwrap_or_default().to_string_lossy();
            return Err(Error::Lost(Box::new(LostError::new(&component, fmu, None, &death))));
        };
        let (common, slave, model) = found.map_err(refused)?;
        let (occupied, origin) = (AtomicBool::new(false), Origin::Worker(channel));
        Ok(Library { common, slave, model, occupied, origin, _code: None })
    }
}

/// Loads `folder/inner` for the archive `path` by `load`.
fn bind<Code, Cause: std::error::Error>(
    path: &Path,
    folder: &Path,
    inner: &str,
    load: impl FnOnce(PathBuf) -> Result<Code, Cause>,
) -> Result<Code, Error> {
    let refused = |reason| Error::Load { path: path.to_owned(), library: inner.to_owned(), reason };
    let file = folder.join(inner);
    whole(&file).map_err(refused)?;
    load(file).map_err(|error| refused(reason(&error, folder)))
}

/// The error of a function that an interface needs and the library of the archive `path` lacks.
fn missing(path: &Path, interface: &'static str) -> impl Fn(&'static str) -> Error {
    move |function| Error::MissingFunction { path: path.to_owned(), function, interface }
}

/// Refuses a library of which `function` gave another answer than is expected.
fn answers(
    path: &Path,
    function: &'static str,
    answer: String,
    expected: &'static str,
    is_expected: impl Fn(&str) -> bool,
) -> Result<(), Error> {
    match is_expected(&answer) {
        true => Ok(()),
        false => Err(Error::Header { path: path.to_owned(), function, answer, expected }),
    }
}

/// Processors of the ELF format (`e_machine`) by their names in Rust.
const MACHINES: [(u64, &str); 4] = [(3, "x86"), (62, "x86_64"), (183, "aarch64"), (243, "riscv64")];

/// Refuses a file of the ELF format for another processor, of which the loader only says that it is not there, and one
/// that is cut off: the system maps it and the first use of what is missing ends the
/// process.
fn whole(file: &Path) -> Result<(), String> {
    use std::io::{Read, Seek, SeekFrom};
    // A file that cannot be read is left to the loader, which says why.
    let Ok(mut open) = std::fs::File::open(file) else { return Ok(()) };
    let size = open.metadata().map_or(0, |data| data.len());
    let mut head = [0_u8; 64];
    if open.read_exact(&mut head).is_err() || head[..5] != *b"\x7fELF\x02" || head[5] != 1 {
        return Ok(());
    }
    let number = |bytes: &[u8]| bytes.iter().rev().fold(0_u64, |sum, &byte| sum << 8 | u64::from(byte));
    let machine = number(&head[18..20]);
    let own = MACHINES.iter().find(|(_, name)| *name == std::env::consts::ARCH);
    if let Some((_, own)) = own.filter(|(own, _)| *own != machine) {
        let found = MACHINES.iter().find(|(number, _)| *number == machine);
        let found = found.map_or_else(|| format!("the processor {machine}"), |(_, name)| (*name).to_owned());
        return Err(format!("it is made for {found}, and this program runs on {own}; build it for {own}"));
    }
    let (headers, count) = (number(&head[32..40]), number(&head[56..58]));
    let mut table = vec![0_u8; 56 * usize::try_from(count).unwrap_or(0)];
    let cut = |end: u64| {
        format!(
            "the file has {size} bytes where its header speaks of {end}: it is cut off; pack the FMU again"
        )
    };
    if open.seek(SeekFrom::Start(headers)).and_then(|_| open.read_exact(&mut table)).is_err() {
        return Err(cut(headers.saturating_add(56 * count)));
    }
    let end = |entry: &[u8]| number(&entry[8..16]).saturating_add(number(&entry[32..40]));
    // Type 1: mapped into the memory.
    let ends = table.chunks_exact(56).filter(|entry| number(&entry[..4]) == 1).map(end);
    match ends.max().filter(|&end| end > size) {
        Some(end) => Err(cut(end)),
        None => Ok(()),
    }
}

/// Message of the system about a library, without the name of the temporary folder that the user never sees.
fn reason(error: &dyn std::error::Error, folder: &Path) -> String {
    let folder = format!("{}/", folder.display());
    let mut reason = error.to_string();
    let mut source = error.source();
    while let Some(error) = source {
        let next = error.to_string();
        if !reason.contains(&next) {
            reason = format!("{reason}: {next}");
        }
        source = error.source();
    }
    reason.replace(&folder, "")
}

/// An answer of a library as text.
pub(super) fn text(pointer: *const c_char) -> String {
    if pointer.is_null() {
        return "NULL".to_owned();
    }
    // SAFETY: not null, and a NUL-terminated string by the standard.
    unsafe { CStr::from_ptr(pointer) }.to_string_lossy().into_owned()
}
