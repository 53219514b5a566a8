//! FMUs for the tests of algebraic loops: see `looped.c` for what they do.

use crate::c_fmu;
use std::path::PathBuf;

use tempfile::TempDir;

/// Capabilities of an FMU.
#[derive(Clone, Copy)]
pub struct Abilities {
    /// Compiler flag: `STALE`, `STRICT`, or none.
    pub flag: &'static str,
    pub states: bool,
    pub derivatives: bool,
    pub model_exchange: bool,
    pub dependencies: bool,
}

/// All of it.
pub const ABLE: Abilities =
    Abilities { flag: "", states: true, derivatives: true, model_exchange: true, dependencies: true };

fn description(able: Abilities) -> String {
    let real = |name: &str, reference: u32, attributes: &str, inside: &str| {
        format!(
            "<ScalarVariable name=\"{name}\" valueReference=\"{reference}\" {attributes}><Real {inside}/></ScalarVariable>\n"
        )
    };
    let input = "causality=\"input\" variability=\"continuous\"";
    let calculated = "variability=\"continuous\" initial=\"calculated\"";
    let parameter = "causality=\"parameter\" variability=\"fixed\" initial=\"exact\"";
    let variables = [
        real("u", 0, input, "start=\"0\""),
        real("y", 1, &format!("causality=\"output\" {calculated}"), ""),
        real("x", 2, "causality=\"output\" variability=\"continuous\" initial=\"exact\"", "start=\"0\""),
        real("der(x)", 3, &format!("causality=\"local\" {calculated}"), "derivative=\"3\""),
        real("gain", 4, parameter, "start=\"0\""),
        real("bend", 5, parameter, "start=\"0\""),
        real("share", 6, parameter, "start=\"0\""),
        real("rate", 7, parameter, "start=\"0\""),
        real("offset", 8, parameter, "start=\"0\""),
        real("v", 9, input, "start=\"0\""),
    ]
    .concat();
    let Abilities { states, derivatives, model_exchange, dependencies, .. } = able;
    let exchange = format!(
        "<ModelExchange modelIdentifier=\"looped\" providesDirectionalDerivative=\"{derivatives}\"/>\n"
    );
    let known = |indices: &str| match dependencies {
        true => format!(" dependencies=\"{indices}\""),
        false => String::new(),
    };
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <fmiModelDescription fmiVersion=\"2.0\" modelName=\"looped\" guid=\"looped\">\n{}\
         <CoSimulation modelIdentifier=\"looped\" canHandleVariableCommunicationStepSize=\"true\" \
         canGetAndSetFMUstate=\"{states}\" providesDirectionalDerivative=\"{derivatives}\"/>\n\
         <ModelVariables>\n{variables}</ModelVariables>\n\
         <ModelStructure><Outputs><Unknown index=\"2\"{}/><Unknown index=\"3\"{}/></Outputs>\
         <Derivatives><Unknown index=\"4\"{}/></Derivatives></ModelStructure>\n\
         </fmiModelDescription>\n",
        if model_exchange { &exchange } else { "" },
        known("1 3"),
        known("3"),
        known("1 3"),
    )
}

/// Writes `name` with these abilities into the folder.
pub fn fmu(folder: &TempDir, name: &str, able: Abilities) {
    let library = folder.path().join(format!("looped{}.so", able.flag));
    if !library.exists() {
        let flag = format!("-D{}", able.flag);
        let macros = Some(flag.as_str()).filter(|_| !able.flag.is_empty());
        c_fmu::compile("looped.c", &library, macros.as_slice());
    }
    c_fmu::pack(&folder.path().join(name), &description(able), Some(("looped", &library)));
}

/// Writes a system of components `name fmu` with connections `from to factor offset`; `in` is the system input.
pub fn system(
    folder: &TempDir,
    components: &[(&str, &str)],
    connections: &[(&str, &str, f64, f64)],
) -> PathBuf {
    let connector = |(name, kind): (&str, &str)| format!("<ssd:Connector name=\"{name}\" kind=\"{kind}\"/>");
    let connectors =
        [("u", "input"), ("v", "input"), ("y", "output"), ("x", "output")].map(connector).concat();
    let component = |(name, fmu): &(&str, &str)| {
        format!(
            "<ssd:Component name=\"{name}\" source=\"{fmu}\"><ssd:Connectors>{connectors}</ssd:Connectors></ssd:Component>\n"
        )
    };
    let end = |side: &str, path: &str| match path.split_once('.') {
        Some((element, connector)) => format!("{side}Element=\"{element}\" {side}Connector=\"{connector}\""),
        None => format!("{side}Connector=\"{path}\""),
    };
    let connection = |(from, to, factor, offset): &(&str, &str, f64, f64)| {
        format!(
            "<ssd:Connection {} {}><ssc:LinearTransformation factor=\"{factor}\" offset=\"{offset}\"/></ssd:Connection>\n",
            end("start", from),
            end("end", to)
        )
    };
    let outside = if connections.iter().any(|(from, ..)| *from == "in") {
        connector(("in", "input"))
    } else {
        String::new()
    };
    let text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <ssd:SystemStructureDescription version=\"1.0\" name=\"s\" xmlns:ssd=\"http://ssp-standard.org/SSP1/SystemStructureDescription\" xmlns:ssc=\"http://ssp-standard.org/SSP1/SystemStructureCommon\">\n\
         <ssd:System name=\"s\"><ssd:Connectors>{outside}</ssd:Connectors>\n<ssd:Elements>\n{}</ssd:Elements>\n\
         <ssd:Connections>\n{}</ssd:Connections></ssd:System>\n</ssd:SystemStructureDescription>\n",
        components.iter().map(component).collect::<String>(),
        connections.iter().map(connection).collect::<String>(),
    );
    let path = folder.path().join("system.ssd");
    std::fs::write(&path, text).unwrap();
    path
}
