//! FMUs from C sources, compiled and packed where a test needs them.

use std::io::Write;
use std::path::Path;
use std::process::Command;

use zip::ZipWriter;
use zip::write::SimpleFileOptions;

/// Folder of the binaries of this machine.
pub const PLATFORM: &str = "linux64";

/// A model with an input, a state and an output, such as `hostile.c`.
pub const DESCRIPTION: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="m" guid="g">
  <ModelExchange modelIdentifier="m"/>
  <CoSimulation modelIdentifier="m" canHandleVariableCommunicationStepSize="true"/>
  <ModelVariables>
    <ScalarVariable name="u" valueReference="0" causality="input"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="x" valueReference="1" causality="local" initial="exact"><Real start="1"/></ScalarVariable>
    <ScalarVariable name="der(x)" valueReference="2"><Real derivative="2"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="3" causality="output"><Real/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="4" dependencies="2"/></Outputs>
    <Derivatives><Unknown index="3" dependencies="1 2"/></Derivatives>
    <InitialUnknowns><Unknown index="3" dependencies="1 2"/><Unknown index="4" dependencies="2"/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"#;

/// Compiles `source` (a relative path is one in the folder `c` of this crate) into the shared library `target`, with
/// macros such as `-DSTALE`.
pub fn compile(source: impl AsRef<Path>, target: &Path, macros: &[&str]) {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("c").join(source);
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".to_owned());
    let status = Command::new(&compiler)
        .args(["-shared", "-fPIC", "-O2", "-o"])
        .arg(target)
        .args(macros)
        .arg(source)
        .arg("-lm")
        .status()
        .unwrap_or_else(|error| panic!("{compiler}: {error}; set CC to a C compiler"));
    assert!(status.success());
}

/// Writes an FMU with this description and, if given, the library as `identifier`.so.
pub fn pack(path: &Path, description: &str, library: Option<(&str, &Path)>) {
    pack_for(path, description, library, PLATFORM);
}

/// Same as [`pack`] with another name of the folder of the library.
pub fn pack_for(path: &Path, description: &str, library: Option<(&str, &Path)>, platform: &str) {
    let mut writer = ZipWriter::new(std::fs::File::create(path).unwrap());
    let mut add = |name: &str, bytes: &[u8]| {
        writer.start_file(name, SimpleFileOptions::default()).unwrap();
        writer.write_all(bytes).unwrap();
    };
    add("modelDescription.xml", description.as_bytes());
    if let Some((identifier, library)) = library {
        add(&format!("binaries/{platform}/{identifier}.so"), &std::fs::read(library).unwrap());
    }
    writer.finish().unwrap();
}
