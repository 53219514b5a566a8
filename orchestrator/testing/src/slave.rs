//! FMUs and systems made for one test: see `slave.c` for what the FMU does.

use crate::c_fmu;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

/// Description of the FMU of `slave.c`; `change` may alter the text.
pub fn description() -> String {
    let variable = |name: &str, reference: u32, attributes: &str, typed: &str| {
        format!(
            "<ScalarVariable name=\"{name}\" valueReference=\"{reference}\" {attributes}>{typed}</ScalarVariable>\n"
        )
    };
    let input = "causality=\"input\" variability=\"continuous\"";
    let discrete_input = "causality=\"input\" variability=\"discrete\"";
    let output = "causality=\"output\" variability=\"continuous\" initial=\"calculated\"";
    let discrete_output = "causality=\"output\" variability=\"discrete\" initial=\"calculated\"";
    let parameter = "causality=\"parameter\" variability=\"fixed\"";
    let variables = [
        variable("u", 0, input, "<Real unit=\"N\" start=\"0\"/>"),
        variable("y", 1, output, "<Real unit=\"N\"/>"),
        variable("gain", 2, parameter, "<Real start=\"1\" min=\"-10\" max=\"10\"/>"),
        variable(
            "x",
            3,
            "causality=\"output\" variability=\"continuous\" initial=\"exact\"",
            "<Real unit=\"N.s\" start=\"0\"/>",
        ),
        variable("held", 4, discrete_output, "<Real unit=\"N\"/>"),
        variable("when", 5, parameter, "<Real unit=\"s\" start=\"1e300\"/>"),
        variable("i", 0, discrete_input, "<Integer start=\"0\"/>"),
        variable("j", 1, discrete_output, "<Integer/>"),
        variable("how", 2, parameter, "<Enumeration declaredType=\"How\" start=\"0\"/>"),
        variable("b", 0, discrete_input, "<Boolean start=\"false\"/>"),
        variable("c", 1, discrete_output, "<Boolean/>"),
        variable("s", 0, discrete_input, "<String start=\"\"/>"),
        variable("t", 1, discrete_output, "<String/>"),
        variable("der(x)", 6, "causality=\"local\" variability=\"continuous\"", "<Real derivative=\"4\"/>"),
    ]
    .concat();
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <fmiModelDescription fmiVersion=\"2.0\" modelName=\"slave\" guid=\"slave\">\n\
         <CoSimulation modelIdentifier=\"slave\" canHandleVariableCommunicationStepSize=\"true\"/>\n\
         <UnitDefinitions><Unit name=\"N\"><BaseUnit kg=\"1\" m=\"1\" s=\"-2\"/></Unit>\
         <Unit name=\"N.s\"><BaseUnit kg=\"1\" m=\"1\" s=\"-1\"/></Unit><Unit name=\"s\"><BaseUnit s=\"1\"/></Unit></UnitDefinitions>\n\
         <TypeDefinitions><SimpleType name=\"How\"><Enumeration><Item name=\"none\" value=\"0\"/>\
         <Item name=\"discard\" value=\"1\"/><Item name=\"terminate\" value=\"2\"/><Item name=\"error\" value=\"3\"/>\
         <Item name=\"fatal\" value=\"4\"/><Item name=\"pending\" value=\"5\"/><Item name=\"nan\" value=\"6\"/></Enumeration>\
         </SimpleType></TypeDefinitions>\n\
         <ModelVariables>\n{variables}</ModelVariables>\n\
         <ModelStructure><Outputs><Unknown index=\"2\" dependencies=\"1\"/><Unknown index=\"4\" dependencies=\"\"/>\
         <Unknown index=\"5\" dependencies=\"1\"/><Unknown index=\"8\" dependencies=\"7\"/>\
         <Unknown index=\"11\" dependencies=\"10\"/><Unknown index=\"13\" dependencies=\"12\"/></Outputs>\
         <Derivatives><Unknown index=\"14\" dependencies=\"1\"/></Derivatives></ModelStructure>\n\
         </fmiModelDescription>\n"
    )
}

/// Writes an FMU with this description and, if given, a library.
pub fn pack(path: &Path, description: &str, library: Option<&Path>) {
    c_fmu::pack(path, description, library.map(|library| ("slave", library)));
}

/// A folder with `slave.fmu`, which can only be inspected.
pub fn folder_without_library() -> TempDir {
    let folder = TempDir::new().unwrap();
    pack(&folder.path().join("slave.fmu"), &description(), None);
    folder
}

/// A folder with `slave.fmu`, ready to run.
pub fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    let library = folder.path().join("slave.so");
    c_fmu::compile("slave.c", &library, &[]);
    pack(&folder.path().join("slave.fmu"), &description(), Some(&library));
    folder
}

/// A component of `slave.fmu` with all its connectors; `inside` is put behind them.
pub fn component(name: &str, inside: &str) -> String {
    let connector = |name: &str, kind: &str| format!("<ssd:Connector name=\"{name}\" kind=\"{kind}\"/>");
    let inputs: String = ["u", "i", "b", "s"].map(|name| connector(name, "input")).concat();
    let outputs: String = ["y", "x", "held", "j", "c", "t"].map(|name| connector(name, "output")).concat();
    let gain = connector("gain", "parameter");
    format!(
        "<ssd:Component name=\"{name}\" source=\"slave.fmu\"><ssd:Connectors>{inputs}{outputs}{gain}</ssd:Connectors>{inside}</ssd:Component>\n"
    )
}

/// `from` and `to` as `component.connector`, or a plain name for a connector of the system.
pub fn connection(from: &str, to: &str) -> String {
    let end = |side: &str, path: &str| match path.split_once('.') {
        Some((element, connector)) => format!("{side}Element=\"{element}\" {side}Connector=\"{connector}\""),
        None => format!("{side}Connector=\"{path}\""),
    };
    format!("<ssd:Connection {} {}/>\n", end("start", from), end("end", to))
}

/// A description of a system.
pub fn ssd(connectors: &str, components: &str, connections: &str, rest: &str) -> String {
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <ssd:SystemStructureDescription version=\"1.0\" name=\"s\" xmlns:ssd=\"http://ssp-standard.org/SSP1/SystemStructureDescription\" xmlns:ssc=\"http://ssp-standard.org/SSP1/SystemStructureCommon\" xmlns:ssv=\"http://ssp-standard.org/SSP1/SystemStructureParameterValues\">\n\
         <ssd:System name=\"s\">\n<ssd:Connectors>\n{connectors}</ssd:Connectors>\n{rest}<ssd:Elements>\n{components}</ssd:Elements>\n\
         <ssd:Connections>\n{connections}</ssd:Connections>\n</ssd:System>\n\
         <ssd:Units><ssc:Unit name=\"mN\"><ssc:BaseUnit kg=\"1\" m=\"1\" s=\"-2\" factor=\"0.001\"/></ssc:Unit></ssd:Units>\n\
         </ssd:SystemStructureDescription>\n"
    )
}

/// Writes `text` as `name` into the folder.
pub fn write(folder: &TempDir, name: &str, text: &str) -> PathBuf {
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    path
}
