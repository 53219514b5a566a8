//! FMUs with second derivatives in closed form: see `bent.c` for what they do.

use crate::c_fmu;
use std::path::PathBuf;

use tempfile::TempDir;

/// Kind of the description of an FMU.
#[derive(Clone, Copy, PartialEq)]
pub enum Kind {
    /// All of it, and true.
    Honest,
    /// No directional derivatives.
    Plain,
    /// No dependencies.
    Silent,
    /// `der(x1)` would not depend on `x0`, and on `u` with a constant factor.
    Wrong,
}

fn description(kind: Kind) -> String {
    let real = |name: &str, reference: u32, attributes: &str, inside: &str| {
        format!(
            "<ScalarVariable name=\"{name}\" valueReference=\"{reference}\" {attributes}><Real {inside}/></ScalarVariable>\n"
        )
    };
    let calculated = "variability=\"continuous\" initial=\"calculated\"";
    let state = "causality=\"local\" variability=\"continuous\" initial=\"exact\"";
    let parameter = "causality=\"parameter\" variability=\"fixed\" initial=\"exact\"";
    let variables = [
        real("u", 0, "causality=\"input\" variability=\"continuous\"", "start=\"0\""),
        real("y", 1, &format!("causality=\"output\" {calculated}"), ""),
        real("x0", 2, state, "start=\"0\""),
        real("x1", 3, state, "start=\"0\""),
        real("der(x0)", 4, &format!("causality=\"local\" {calculated}"), "derivative=\"3\""),
        real("der(x1)", 5, &format!("causality=\"local\" {calculated}"), "derivative=\"4\""),
        real("fault", 6, parameter, "start=\"0\""),
        real("limit", 7, parameter, "start=\"1e300\""),
    ]
    .concat();
    let known = |dependencies: &str, kinds: &str| match kind {
        Kind::Silent => String::new(),
        _ => format!(" dependencies=\"{dependencies}\" dependenciesKind=\"{kinds}\""),
    };
    let of_x1 = match kind {
        Kind::Wrong => known("1", "constant"),
        _ => known("1 3", "dependent dependent"),
    };
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <fmiModelDescription fmiVersion=\"2.0\" modelName=\"bent\" guid=\"bent\">\n\
         <ModelExchange modelIdentifier=\"bent\" providesDirectionalDerivative=\"{}\"/>\n\
         <ModelVariables>\n{variables}</ModelVariables>\n\
         <ModelStructure><Outputs><Unknown index=\"2\"{}/></Outputs>\
         <Derivatives><Unknown index=\"5\"{}/><Unknown index=\"6\"{of_x1}/></Derivatives></ModelStructure>\n\
         </fmiModelDescription>\n",
        kind != Kind::Plain,
        known("1 3 4", "dependent dependent dependent"),
        known("4", "constant"),
    )
}

/// Writes an FMU called `name` into the folder.
pub fn fmu(folder: &TempDir, name: &str, kind: Kind) -> PathBuf {
    let library = folder.path().join("bent.so");
    if !library.exists() {
        c_fmu::compile("bent.c", &library, &[]);
    }
    let path = folder.path().join(name);
    c_fmu::pack(&path, &description(kind), Some(("bent", &library)));
    path
}

/// Writes a chain `in -> a.u`, `a.y -> b.u` with a factor and an offset at each connection.
pub fn chain(folder: &TempDir, first: &str, second: &str) -> PathBuf {
    let component = |name: &str, fmu: &str| {
        format!(
            "<ssd:Component name=\"{name}\" source=\"{fmu}\"><ssd:Connectors><ssd:Connector name=\"u\" kind=\"input\"/>\
             <ssd:Connector name=\"y\" kind=\"output\"/></ssd:Connectors></ssd:Component>\n"
        )
    };
    let text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <ssd:SystemStructureDescription version=\"1.0\" name=\"s\" xmlns:ssd=\"http://ssp-standard.org/SSP1/SystemStructureDescription\" xmlns:ssc=\"http://ssp-standard.org/SSP1/SystemStructureCommon\">\n\
         <ssd:System name=\"s\"><ssd:Connectors><ssd:Connector name=\"in\" kind=\"input\"/></ssd:Connectors>\n\
         <ssd:Elements>\n{}{}</ssd:Elements>\n<ssd:Connections>\n\
         <ssd:Connection startConnector=\"in\" endElement=\"a\" endConnector=\"u\"><ssc:LinearTransformation factor=\"2\" offset=\"0.5\"/></ssd:Connection>\n\
         <ssd:Connection startElement=\"a\" startConnector=\"y\" endElement=\"b\" endConnector=\"u\"><ssc:LinearTransformation factor=\"-0.5\" offset=\"1\"/></ssd:Connection>\n\
         </ssd:Connections></ssd:System>\n</ssd:SystemStructureDescription>\n",
        component("a", first),
        component("b", second),
    );
    let path = folder.path().join("chain.ssd");
    std::fs::write(&path, text).unwrap();
    path
}
