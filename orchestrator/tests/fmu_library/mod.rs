//! Archives and libraries made for one test.

#![allow(dead_code, reason = "each test binary uses a part")]

use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};
use std::process::Command;

use tempfile::TempDir;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

/// A model description around `variables`, with one real input and one real output by default.
pub fn description(variables: &str) -> String {
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <fmiModelDescription fmiVersion=\"2.0\" modelName=\"m\" guid=\"right\">\n\
         <CoSimulation modelIdentifier=\"m\"/>\n\
         <ModelVariables>\n{variables}\n</ModelVariables>\n\
         <ModelStructure/>\n\
         </fmiModelDescription>\n"
    )
}

/// One real input.
pub const INPUT: &str = "<ScalarVariable name=\"u\" valueReference=\"0\" causality=\"input\"><Real start=\"0\"/></ScalarVariable>";

/// An archive of the given files.
pub fn archive(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        writer.start_file(*name, SimpleFileOptions::default()).unwrap();
        writer.write_all(bytes).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

/// Writes `bytes` as `name` into `folder`.
pub fn save(folder: &TempDir, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

/// Folder of the binaries of this machine.
pub const PLATFORM: &str = "linux64";

/// Compiles `library.c` with the given macros and packs it with `xml`.
pub fn compiled(folder: &TempDir, xml: &str, macros: &[&str]) -> PathBuf {
    let library = folder.path().join("m.so");
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fmu_library/library.c");
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".to_owned());
    let status = Command::new(&compiler)
        .args(["-shared", "-fPIC", "-o"])
        .arg(&library)
        .args(macros)
        .arg(source)
        .status()
        .unwrap_or_else(|error| panic!("{compiler}: {error}; set CC to a C compiler"));
    assert!(status.success());
    let bytes = std::fs::read(&library).unwrap();
    let inner = format!("binaries/{PLATFORM}/m.so");
    save(folder, "m.fmu", &archive(&[("modelDescription.xml", xml.as_bytes()), (&inner, &bytes)]))
}
