//! FMUs with one defect each, and legal ones that look odd, made from the subject of `airloop-testing`.

use std::path::{Path, PathBuf};

use airloop_testing::c_fmu;
use airloop_testing::fmu_library::archive;
use airloop_testing::subject::{FMI2, FMI3};

pub mod behavior;
pub mod description;
pub mod legal;

/// How the subject is changed.
#[derive(Clone, Copy)]
pub enum Change {
    /// Texts of the description, each with another one in its place.
    Text(&'static [(&'static str, &'static str)]),
    /// A fault of this name in the library, and texts as before.
    Fault(&'static str, &'static [(&'static str, &'static str)]),
    /// The library compiled with these macros.
    Macros(&'static [&'static str]),
    /// The bytes of the description.
    Bytes(fn(&str) -> Vec<u8>),
    /// Names and contents of the files besides those of the subject; the first is the description's own.
    Files(&'static [(&'static str, &'static str)]),
    /// Without the library.
    NoLibrary,
}

/// An FMU that the checker judges.
#[derive(Clone, Copy)]
pub struct Mutant {
    /// Defect or oddity.
    pub name: &'static str,
    /// 2 or 3.
    pub version: u32,
    /// Rule that has to find it; `refused` where the FMU must not open. Empty for legal ones.
    pub rule: &'static str,
    pub change: Change,
}

/// A mutant of FMI 2.0.
pub const fn two(name: &'static str, rule: &'static str, change: Change) -> Mutant {
    Mutant { name, version: 2, rule, change }
}

/// A mutant of FMI 3.0.
pub const fn three(name: &'static str, rule: &'static str, change: Change) -> Mutant {
    Mutant { name, version: 3, rule, change }
}

impl Mutant {
    fn description(&self) -> Vec<u8> {
        let sound = if self.version == 2 { FMI2 } else { FMI3 };
        let replaced = |texts: &[(&str, &str)]| {
            texts.iter().fold(sound.to_owned(), |text, (from, to)| {
                assert!(text.contains(from), "{}: {from}", self.name);
                text.replacen(from, to, 1)
            })
        };
        let with_fault = |text: String, fault: &str| {
            let token = if self.version == 2 { "guid=\"subject" } else { "instantiationToken=\"subject" };
            text.replacen(token, &format!("{token}:{fault}"), 1).into_bytes()
        };
        match self.change {
            Change::Text(texts) => replaced(texts).into_bytes(),
            Change::Fault(fault, texts) => with_fault(replaced(texts), fault),
            Change::Bytes(bytes) => bytes(sound),
            Change::Macros(_) | Change::Files(_) | Change::NoLibrary => sound.as_bytes().to_vec(),
        }
    }

    /// Writes the FMU as `name` into a folder; libraries without faults of their own are compiled once.
    pub fn write(&self, folder: &Path, name: &str) -> PathBuf {
        let platform = if self.version == 2 { "linux64" } else { "x86_64-linux" };
        let mut macros = if self.version == 2 { vec![] } else { vec!["-DFMI3"] };
        let library = match self.change {
            Change::Macros(more) => {
                macros.extend(more);
                folder.join(format!("{name}.so"))
            }
            _ => folder.join(format!("subject{}.so", self.version)),
        };
        if !library.exists() {
            c_fmu::compile("subject.c", &library, &macros);
        }
        let (description, library) = (self.description(), std::fs::read(&library).unwrap());
        let binary = format!("binaries/{platform}/m.so");
        let mut files: Vec<(&str, &[u8])> = vec![("modelDescription.xml", &description)];
        if !matches!(self.change, Change::NoLibrary) {
            files.push((&binary, &library));
        }
        if let Change::Files(more) = self.change {
            files.extend(more.iter().map(|(name, text)| (*name, text.as_bytes())));
        }
        let path = folder.join(name);
        std::fs::write(&path, archive(&files)).unwrap();
        path
    }
}
