//! FMUs of a small Model Exchange library (`model.c`), made where a test needs them.

use crate::c_fmu;
use std::path::PathBuf;

use tempfile::TempDir;

fn description(derivatives: bool) -> String {
    let real = |name: &str, reference: u32, attributes: &str, inside: &str| {
        format!(
            "<ScalarVariable name=\"{name}\" valueReference=\"{reference}\" {attributes}><Real {inside}/></ScalarVariable>\n"
        )
    };
    let calculated = "variability=\"continuous\" initial=\"calculated\"";
    let parameter = "causality=\"parameter\" variability=\"fixed\" initial=\"exact\"";
    let variables = [
        real("u", 0, "causality=\"input\" variability=\"continuous\"", "start=\"0\""),
        real("y", 1, &format!("causality=\"output\" {calculated}"), ""),
        real("c", 2, &format!("causality=\"output\" {calculated}"), ""),
        real("x", 3, "causality=\"output\" variability=\"continuous\" initial=\"exact\"", "start=\"0\""),
        real("der(x)", 4, &format!("causality=\"local\" {calculated}"), "derivative=\"4\""),
        real("gain", 5, parameter, "start=\"1\""),
        real("offset", 6, parameter, "start=\"0\""),
        real("rate", 7, parameter, "start=\"0\""),
        real("relay", 8, parameter, "start=\"0\""),
        real("growth", 9, parameter, "start=\"0\""),
        real("held", 10, "causality=\"output\" variability=\"discrete\" initial=\"calculated\"", ""),
    ]
    .concat();
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <fmiModelDescription fmiVersion=\"2.0\" modelName=\"model\" guid=\"model\" numberOfEventIndicators=\"1\">\n\
         <ModelExchange modelIdentifier=\"model\" providesDirectionalDerivative=\"{derivatives}\"/>\n\
         <ModelVariables>\n{variables}</ModelVariables>\n\
         <ModelStructure><Outputs><Unknown index=\"2\" dependencies=\"1\"/><Unknown index=\"3\" dependencies=\"1\"/>\
         <Unknown index=\"4\" dependencies=\"4\"/><Unknown index=\"11\" dependencies=\"\"/></Outputs>\
         <Derivatives><Unknown index=\"5\" dependencies=\"1 4\"/></Derivatives></ModelStructure>\n\
         </fmiModelDescription>\n"
    )
}

/// A folder with `model.fmu`, and `plain.fmu` which declares no directional derivatives.
pub fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    let library = folder.path().join("model.so");
    c_fmu::compile("model.c", &library, &[]);
    for (name, derivatives) in [("model.fmu", true), ("plain.fmu", false)] {
        c_fmu::pack(&folder.path().join(name), &description(derivatives), Some(("model", &library)));
    }
    folder
}

/// Writes a system of components `name fmu` with connections `from to`; the system input is `u`.
pub fn system(folder: &TempDir, components: &[(&str, &str)], connections: &[(&str, &str)]) -> PathBuf {
    let connector = |(name, kind): (&str, &str)| format!("<ssd:Connector name=\"{name}\" kind=\"{kind}\"/>");
    let kinds = [("u", "input"), ("y", "output"), ("c", "output"), ("x", "output"), ("held", "output")];
    let connectors: String = kinds.map(connector).concat();
    let component = |(name, fmu): &(&str, &str)| {
        format!(
            "<ssd:Component name=\"{name}\" source=\"{fmu}\"><ssd:Connectors>{connectors}</ssd:Connectors></ssd:Component>\n"
        )
    };
    let end = |side: &str, path: &str| match path.split_once('.') {
        Some((element, connector)) => format!("{side}Element=\"{element}\" {side}Connector=\"{connector}\""),
        None => format!("{side}Connector=\"{path}\""),
    };
    let connection =
        |(from, to): &(&str, &str)| format!("<ssd:Connection {} {}/>\n", end("start", from), end("end", to));
    let text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <ssd:SystemStructureDescription version=\"1.0\" name=\"s\" xmlns:ssd=\"http://ssp-standard.org/SSP1/SystemStructureDescription\">\n\
         <ssd:System name=\"s\"><ssd:Connectors>{}</ssd:Connectors>\n<ssd:Elements>\n{}</ssd:Elements>\n\
         <ssd:Connections>\n{}</ssd:Connections></ssd:System>\n</ssd:SystemStructureDescription>\n",
        if connections.iter().any(|(from, _)| *from == "u") {
            connector(("u", "input"))
        } else {
            String::new()
        },
        components.iter().map(component).collect::<String>(),
        connections.iter().map(connection).collect::<String>(),
    );
    let path = folder.path().join("system.ssd");
    std::fs::write(&path, text).unwrap();
    path
}
