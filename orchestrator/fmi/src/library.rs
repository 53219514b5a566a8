//! The shared library of an FMU: where it lies in the archive, loading, first questions.

#![allow(unsafe_code, reason = "loading and asking a third-party library")]

use std::ffi::{CStr, c_char};
use std::path::Path;
use std::sync::atomic::AtomicBool;

use fmi::fmi2::binding::Fmi2Binding;
use fmi::fmi3::binding::Fmi3Binding;

use super::error::Error;
use super::fmi3;
use super::functions::{CommonFunctions, FirstFunctions, ModelFunctions, SlaveFunctions};

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
}

/// The loaded code, which the function tables point into.
enum Binding {
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
    _binding: Binding,
}

impl Library {
    /// Loads `folder/inner` for the archive `path` and checks that it speaks FMI 2.0.
    pub(super) fn load(path: &Path, folder: &Path, inner: &str) -> Result<Self, Error> {
        // SAFETY: loading runs the initializers of third-party code; whoever opens an FMU to run it trusts that code.
        let binding = unsafe { Fmi2Binding::new(folder.join(inner)) }.map_err(|error| Error::Load {
            path: path.to_owned(),
            library: inner.to_owned(),
            reason: reason(&error, folder),
        })?;
        let missing =
            |function, interface| Error::MissingFunction { path: path.to_owned(), function, interface };
        let first = FirstFunctions::new(&binding).map_err(|f| missing(f, "FMI 2.0"))?;
        let common = CommonFunctions::new(&binding).map_err(|f| missing(f, "FMI 2.0"))?;
        let slave = SlaveFunctions::new(&binding);
        let model = ModelFunctions::new(&binding);

        // SAFETY: both functions take nothing and return a static C string (FMI 2.0.5 section 2.1.4).
        let answers = unsafe {
            [
                ("fmi2GetTypesPlatform", (first.get_types_platform)(), "default"),
                ("fmi2GetVersion", (first.get_version)(), "2.0"),
            ]
        };
        for (function, answer, expected) in answers {
            let answer = text(answer);
            if answer != expected {
                return Err(Error::Header { path: path.to_owned(), function, answer, expected });
            }
        }
        let (origin, binding) = (Origin::Two(first), Binding::Two { _code: Box::new(binding) });
        Ok(Library { common, slave, model, occupied: AtomicBool::new(false), origin, _binding: binding })
    }

    /// Same as [`Self::load`] for a library of FMI 3.0.
    pub(super) fn load_fmi3(path: &Path, folder: &Path, inner: &str) -> Result<Self, Error> {
        // SAFETY: as for FMI 2.0.
        let binding = unsafe { Fmi3Binding::new(folder.join(inner)) }.map_err(|error| Error::Load {
            path: path.to_owned(),
            library: inner.to_owned(),
            reason: reason(&error, folder),
        })?;
        let missing =
            |function, interface| Error::MissingFunction { path: path.to_owned(), function, interface };
        let functions = fmi3::functions::Functions::new(&binding).map_err(|f| missing(f, "FMI 3.0"))?;
        let slave = fmi3::functions::SlaveFunctions::new(&binding);
        let model = fmi3::functions::ModelFunctions::new(&binding);
        let answer = functions.version();
        if !answer.starts_with("3.") {
            let (path, function, expected) = (path.to_owned(), "fmi3GetVersion", "3.0");
            return Err(Error::Header { path, function, answer, expected });
        }
        let three = ThreeFunctions { common: functions, slave: slave.ok(), model: model.ok() };
        Ok(Library {
            common: fmi3::tables::common(&three),
            slave: slave.map(|_| fmi3::tables::slave(&three)),
            model: model.map(|_| fmi3::tables::MODEL),
            occupied: AtomicBool::new(false),
            origin: Origin::Three(Box::new(three)),
            _binding: Binding::Three { _code: Box::new(binding) },
        })
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
