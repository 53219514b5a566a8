//! The cases: files that are written, and the command that reads them.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use airloop_testing::c_fmu;

mod archives;
pub mod machine;
mod records;
mod settings;
mod systems;
mod tables;

/// One line of the table.
pub struct Case {
    /// Description of the fault.
    pub what: String,
    /// Files by name.
    files: Vec<(String, Vec<u8>)>,
    /// Done in the folder: what is no plain file.
    make: Option<fn(&Path)>,
    /// Whether the good FMU `m.fmu` is there.
    with_fmu: bool,
    /// Arguments of the program.
    pub command: String,
}

impl Case {
    fn new(what: &str, command: &str) -> Case {
        Case { what: what.into(), files: Vec::new(), make: None, with_fmu: false, command: command.into() }
    }

    fn file(mut self, name: &str, bytes: impl Into<Vec<u8>>) -> Case {
        self.files.push((name.into(), bytes.into()));
        self
    }

    fn fmu(mut self) -> Case {
        self.with_fmu = true;
        self
    }

    fn make(mut self, make: fn(&Path)) -> Case {
        self.make = Some(make);
        self
    }

    /// Writes the files.
    pub fn write(&self, folder: &Path) {
        if self.with_fmu {
            c_fmu::pack(&folder.join("m.fmu"), c_fmu::DESCRIPTION, Some(("m", library())));
        }
        for (name, bytes) in &self.files {
            std::fs::write(folder.join(name), bytes).unwrap();
        }
        if let Some(make) = self.make {
            make(folder);
        }
    }
}

/// Makes a pipe that nobody writes into.
fn pipe(path: &Path) {
    assert!(std::process::Command::new("mkfifo").arg(path).status().unwrap().success());
}

/// The library of the good FMU, compiled once.
fn library() -> &'static Path {
    static LIBRARY: OnceLock<(tempfile::TempDir, PathBuf)> = OnceLock::new();
    let made = || {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.so");
        c_fmu::compile("hostile.c", &path, &["-pthread"]);
        (folder, path)
    };
    &LIBRARY.get_or_init(made).1
}

/// A folder with the good FMU, and an empty one for temporary files.
pub fn folder_with_fmu() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("tmp")).unwrap();
    Case::new("", "").fmu().write(folder.path());
    folder
}

/// All cases by their title.
pub fn all() -> Vec<(&'static str, Vec<Case>)> {
    vec![
        ("Archives of FMUs", archives::archives()),
        ("Model descriptions", archives::descriptions()),
        ("Systems and parameter sets", systems::cases()),
        ("Records", records::cases()),
        ("TOML files", tables::cases()),
        ("Settings", settings::cases()),
    ]
}
