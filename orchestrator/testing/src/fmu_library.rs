//! Archives and libraries made for one test.

use crate::c_fmu;
use std::io::{Cursor, Write};
use std::path::PathBuf;

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

/// Compiles the C file `source` of this folder with the given macros and packs it with `xml`.
pub fn compiled(folder: &TempDir, source: &str, xml: &str, macros: &[&str]) -> PathBuf {
    let library = folder.path().join("m.so");
    c_fmu::compile(source, &library, macros);
    let path = folder.path().join("m.fmu");
    c_fmu::pack(&path, xml, Some(("m", &library)));
    path
}

/// der(x) = p x + u, y = x + u^2, as `first_order.c` computes it; without fault.
pub const FIRST_ORDER: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="m" guid="right" variableNamingConvention="structured" numberOfEventIndicators="0">
  <ModelExchange modelIdentifier="m" canGetAndSetFMUstate="true" canSerializeFMUstate="true" providesDirectionalDerivative="true"/>
  <CoSimulation modelIdentifier="m" canGetAndSetFMUstate="true" canSerializeFMUstate="true" providesDirectionalDerivative="true"/>
  <UnitDefinitions><Unit name="m"><BaseUnit m="1"/><DisplayUnit name="mm" factor="1000"/></Unit></UnitDefinitions>
  <TypeDefinitions><SimpleType name="Mode"><Enumeration><Item name="a" value="1"/><Item name="b" value="2"/></Enumeration></SimpleType></TypeDefinitions>
  <LogCategories><Category name="logAll"/></LogCategories>
  <DefaultExperiment startTime="0" stopTime="1" stepSize="0.01" tolerance="1e-6"/>
  <ModelVariables>
    <ScalarVariable name="u" valueReference="0" causality="input"><Real unit="m" start="0" min="-5" max="5"/></ScalarVariable>
    <ScalarVariable name="x" valueReference="1" causality="local" initial="exact"><Real unit="m" displayUnit="mm" start="1" nominal="1"/></ScalarVariable>
    <ScalarVariable name="der(x)" valueReference="2"><Real derivative="2"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="3" causality="output"><Real/></ScalarVariable>
    <ScalarVariable name="p" valueReference="4" causality="parameter" variability="fixed"><Real start="-1" min="-2" max="2"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="4" dependencies="1 2" dependenciesKind="dependent constant"/></Outputs>
    <Derivatives><Unknown index="3" dependencies="1 2" dependenciesKind="constant fixed"/></Derivatives>
    <InitialUnknowns><Unknown index="3" dependencies="1 2 5"/><Unknown index="4" dependencies="1 2"/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"#;
