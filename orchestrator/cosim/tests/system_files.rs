//! Reading of systems: what a description means, and what is refused with which words.

use airloop_cosim::system::graph::{Conversion, Source, Start};
use airloop_cosim::system::{Error, SystemGraph};
use airloop_testing::slave::{component, connection, description, folder_without_library, pack, ssd, write};
use tempfile::TempDir;

const U_AND_Y: &str = "<ssd:Connector name=\"u\" kind=\"input\"><ssc:Real unit=\"N\"/></ssd:Connector>\n\
     <ssd:Connector name=\"y\" kind=\"output\"><ssc:Real unit=\"N\"/></ssd:Connector>\n";

fn open(folder: &TempDir, text: &str) -> Result<SystemGraph, Error> {
    SystemGraph::open(&write(folder, "system.ssd", text))
}

fn binding(parameters: &str) -> String {
    format!(
        "<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version=\"1.0\" name=\"p\"><ssv:Parameters>{parameters}</ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>\n"
    )
}

fn real(name: &str, value: &str) -> String {
    format!("<ssv:Parameter name=\"{name}\"><ssv:Real value=\"{value}\"/></ssv:Parameter>")
}

#[test]
fn a_chain_is_ordered_by_its_connections_and_not_by_the_file() {
    let folder = folder_without_library();
    let components = [component("c", ""), component("a", ""), component("b", "")].concat();
    let connections =
        [connection("b.y", "c.u"), connection("u", "a.u"), connection("a.y", "b.u"), connection("c.y", "y")]
            .concat();
    let graph = open(&folder, &ssd(U_AND_Y, &components, &connections, "")).unwrap();
    let names: Vec<&str> = graph.order.iter().map(|&index| graph.components[index].name.as_str()).collect();
    assert_eq!(names, ["a", "b", "c"]);
    assert_eq!(graph.source_name(graph.outputs[0].source), "c.y");
    assert_eq!(graph.inputs[0].unit.as_deref(), Some("N"));
}

#[test]
fn a_loop_through_a_state_is_ordered_without_error() {
    let folder = folder_without_library();
    // a.y depends on a.u = b.x, a state: no algebraic loop.
    let components = [component("b", ""), component("a", "")].concat();
    let connections = [connection("b.x", "a.u"), connection("a.y", "b.u")].concat();
    let text = ssd("", &components, &connections, "");
    // x [N.s] into u [N] would be a mismatch of units; the test is about the order.
    let text = text.replace("endConnector=\"u\"/>", "endConnector=\"u\" suppressUnitConversion=\"true\"/>");
    let graph = open(&folder, &text).unwrap();
    let names: Vec<&str> = graph.order.iter().map(|&index| graph.components[index].name.as_str()).collect();
    assert_eq!(names, ["a", "b"]);
}

#[test]
fn an_algebraic_loop_of_reals_is_found_with_its_variables_in_order() {
    let folder = folder_without_library();
    let components = [component("far", ""), component("a", ""), component("b", "")].concat();
    let connections =
        [connection("a.y", "b.u"), connection("b.y", "a.u"), connection("b.y", "far.u")].concat();
    let graph = open(&folder, &ssd("", &components, &connections, "")).unwrap();
    assert_eq!(graph.loops.len(), 1);
    assert_eq!(graph.loops[0].variables, [(1, 0), (1, 1), (2, 0), (2, 1)]);
    let names = graph.loop_names(&graph.loops[0]);
    assert_eq!((names.len(), names.first()), (5, names.last()));
    let text = names.join(" -> ");
    let twice = format!("{text} -> {}", names[1..].join(" -> "));
    assert!(twice.contains("a.y -> b.u -> b.y -> a.u -> a.y"), "{text}");
    // Those of the loop stand together, before what they feed.
    assert_eq!(graph.order, [1, 2, 0]);
}

#[test]
fn an_algebraic_loop_of_integers_is_refused_but_can_be_looked_at() {
    let folder = folder_without_library();
    let components = [component("a", ""), component("b", "")].concat();
    let connections = [connection("a.j", "b.i"), connection("b.j", "a.i")].concat();
    let text = ssd("", &components, &connections, "");
    let error = open(&folder, &text).unwrap_err();
    let Error::AlgebraicLoop { variables, .. } = &error else { panic!("{error}") };
    assert_eq!((variables.len(), variables.first()), (5, variables.last()));
    let message = error.to_string();
    for word in ["system.ssd: algebraic loop: ", "with `a.i`", "a delay or a filter"] {
        assert!(message.contains(word), "{message}");
    }
    assert!(!message.contains("--master"), "no master solves it: {message}");
    let graph = SystemGraph::open_to_read(&folder.path().join("system.ssd")).unwrap();
    assert_eq!(graph.loops.len(), 1);
}

#[test]
fn units_are_converted_between_connectors() {
    let folder = folder_without_library();
    let connectors = U_AND_Y.replace("unit=\"N\"", "unit=\"mN\"");
    let connections = [connection("u", "a.u"), connection("a.y", "y")].concat();
    let graph = open(&folder, &ssd(&connectors, &component("a", ""), &connections, "")).unwrap();
    assert!((graph.connections[0].conversion.factor - 0.001).abs() < 1e-15);
    assert!((graph.outputs[0].conversion.factor - 1000.0).abs() < 1e-9);
}

#[test]
fn a_linear_transformation_is_applied() {
    let folder = folder_without_library();
    let connections = "<ssd:Connection startConnector=\"u\" endElement=\"a\" endConnector=\"u\"><ssc:LinearTransformation factor=\"2\" offset=\"-1\"/></ssd:Connection>";
    let graph = open(&folder, &ssd(U_AND_Y, &component("a", ""), connections, "")).unwrap();
    assert_eq!(graph.connections[0].conversion, Conversion { factor: 2.0, offset: -1.0 });
    assert_eq!(graph.connections[0].source, Source::Input(0));
}

#[test]
fn a_transformation_acts_between_the_units_of_the_connectors() {
    let folder = folder_without_library();
    // u [mN] -> 2 u - 1 [N] and a.y [N] -> 3 a.y + 5 [mN] -> b.u [N].
    let connectors = U_AND_Y.replace("unit=\"N\"", "unit=\"mN\"");
    let linear = |factor: &str, offset: &str| {
        format!("><ssc:LinearTransformation factor=\"{factor}\" offset=\"{offset}\"/></ssd:Connection>")
    };
    let connections = [
        connection("u", "a.u").replace("/>", &linear("2", "-1")),
        connection("a.y", "b.u").replace("/>", &linear("3", "5")),
        connection("b.y", "y"),
    ]
    .concat();
    let milli = component("b", "").replace(
        "name=\"u\" kind=\"input\"/>",
        "name=\"u\" kind=\"input\"><ssc:Real unit=\"mN\"/></ssd:Connector>",
    );
    let components = component("a", "") + &milli;
    let graph = open(&folder, &ssd(&connectors, &components, &connections, "")).unwrap();
    let close = |found: Conversion, at: f64, expected: f64| {
        assert!((found.apply(at) - expected).abs() < 1e-12, "{found:?}");
    };
    let into = |component: usize| {
        graph.connections.iter().find(|connection| connection.component == component).unwrap().conversion
    };
    close(into(0), 1500.0, 2.0);
    close(into(1), 0.25, 0.755);
    close(graph.outputs[0].conversion, 0.25, 250.0);
}

#[test]
fn a_unit_that_only_the_connector_has_counts() {
    let folder = folder_without_library();
    // gain has no unit in the FMU; the connector says that it is a length in meters.
    let connectors = "<ssd:Connector name=\"k\" kind=\"parameter\"><ssc:Real unit=\"mm\"/></ssd:Connector>\n";
    let meters = component("a", "").replace(
        "name=\"gain\" kind=\"parameter\"/>",
        "name=\"gain\" kind=\"parameter\"><ssc:Real unit=\"m\"/></ssd:Connector>",
    );
    let text = ssd(connectors, &meters, &connection("k", "a.gain"), &binding(&real("k", "3500")));
    let graph = open(&folder, &text).unwrap();
    assert_eq!(graph.components[0].start_values[0].value, Start::Real(3.5));
}

#[test]
fn parameters_of_the_system_win_over_those_of_a_component() {
    let folder = folder_without_library();
    write(
        &folder,
        "set.ssv",
        &format!(
            "<ssv:ParameterSet xmlns:ssv=\"http://ssp-standard.org/SSP1/SystemStructureParameterValues\" version=\"1.0\" name=\"p\"><ssv:Parameters>{}<ssv:Parameter name=\"how\"><ssv:Enumeration value=\"nan\"/></ssv:Parameter></ssv:Parameters></ssv:ParameterSet>",
            real("gain", "4")
        ),
    );
    let components =
        [component("a", &binding(&(real("gain", "2") + &real("x", "0.5")))), component("b", "")].concat();
    let rest = "<ssd:ParameterBindings><ssd:ParameterBinding prefix=\"a.\" source=\"set.ssv\"/></ssd:ParameterBindings>\n";
    let graph = open(&folder, &ssd("", &components, "", rest)).unwrap();
    let starts = &graph.components[0].start_values;
    let value = |name: &str| {
        let variable = graph.components[0].fmu.description.index_of(name).unwrap();
        starts.iter().find(|start| start.variable == variable).map(|start| start.value.clone())
    };
    assert_eq!(value("gain"), Some(Start::Real(4.0)));
    assert_eq!(value("x"), Some(Start::Real(0.5)));
    assert_eq!(value("how"), Some(Start::Integer(6)));
    assert_eq!(starts.len(), 3);
    assert!(graph.components[1].start_values.is_empty());
}

#[test]
fn a_parameter_of_the_system_reaches_the_components_it_is_connected_to() {
    let folder = folder_without_library();
    let connectors = "<ssd:Connector name=\"k\" kind=\"parameter\"><ssc:Real/></ssd:Connector>\n";
    let connections = [connection("k", "a.gain"), connection("k", "b.gain")].concat();
    let components = [component("a", ""), component("b", "")].concat();
    let graph =
        open(&folder, &ssd(connectors, &components, &connections, &binding(&real("k", "3")))).unwrap();
    for component in &graph.components {
        assert_eq!(component.start_values[0].value, Start::Real(3.0));
    }
    assert!(graph.connections.is_empty());
}

#[test]
fn a_package_is_read_like_its_description() {
    let folder = folder_without_library();
    let text = ssd(U_AND_Y, &component("a", ""), &connection("u", "a.u"), "")
        .replace("slave.fmu", "resources/slave.fmu");
    let path = folder.path().join("system.ssp");
    let mut writer = zip::ZipWriter::new(std::fs::File::create(&path).unwrap());
    let fmu = std::fs::read(folder.path().join("slave.fmu")).unwrap();
    for (name, bytes) in [("SystemStructure.ssd", text.as_bytes()), ("resources/slave.fmu", &fmu)] {
        use std::io::Write;
        writer.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        writer.write_all(bytes).unwrap();
    }
    writer.finish().unwrap();
    let graph = SystemGraph::open(&path).unwrap();
    assert_eq!((graph.components.len(), graph.connections.len()), (1, 1));
    assert_eq!(graph.file, path);
}

#[test]
fn a_single_fmu_is_a_system_of_its_inputs_and_outputs() {
    let folder = folder_without_library();
    let mut graph = SystemGraph::open(&folder.path().join("slave.fmu")).unwrap();
    let names = |names: Vec<&String>| names.into_iter().cloned().collect::<Vec<String>>().join(" ");
    assert_eq!(names(graph.inputs.iter().map(|input| &input.name).collect()), "u i b s");
    assert_eq!(names(graph.outputs.iter().map(|output| &output.name).collect()), "y x held j c t");
    graph.set_start("gain", "2", "test").unwrap();
    graph.set_start("slave.how", "discard", "test").unwrap();
    assert_eq!(graph.components[0].start_values[1].value, Start::Integer(1));
}

#[test]
fn start_values_that_cannot_be_are_refused_with_what_is_allowed() {
    let folder = folder_without_library();
    let mut graph = open(&folder, &ssd("", &component("a", ""), "", "")).unwrap();
    let cases = [
        ("gain", "1", "there is no variable `gain`; write component.variable, the components are: a"),
        ("z.gain", "1", "there is no variable `z.gain`"),
        ("a.gian", "1", "no variable `gian` in component `a`; its parameters are: gain, when, how"),
        ("a.gain", "11", "cannot be set to `11`: allowed is a number from -10 to 10"),
        ("a.gain", "abc", "cannot be set to `abc`"),
        ("a.gain", "NaN", "cannot be set to `NaN`"),
        ("a.how", "7", "one of none (0), discard (1)"),
        ("a.i", "1.5", "allowed is an integer"),
        ("a.b", "maybe", "allowed is true or false"),
        ("a.y", "1", "may not be given a start value: it is calculated by the FMU"),
    ];
    for (name, value, expected) in cases {
        let message = graph.set_start(name, value, "--set").unwrap_err().to_string();
        assert!(message.starts_with("--set: ") && message.contains(expected), "{message}");
    }
}

#[test]
fn bad_descriptions_are_refused_with_file_and_line() {
    let folder = folder_without_library();
    pack(
        &folder.path().join("exchange.fmu"),
        &description()
            .replace(
                "<CoSimulation modelIdentifier=\"slave\" canHandleVariableCommunicationStepSize=\"true\"/>",
                "<ModelExchange modelIdentifier=\"slave\"/>",
            )
            .replace("fmiVersion", "numberOfEventIndicators=\"0\" fmiVersion"),
        None,
    );
    std::fs::write(folder.path().join("broken.fmu"), "not a zip").unwrap();
    let two = [component("a", ""), component("b", "")].concat();
    let one = component("a", "");
    let with = |connections: &str| ssd(U_AND_Y, &two, connections, "");
    let system = |rest: &str| ssd(U_AND_Y, &one, "", rest);
    let nested = "<ssd:System name=\"inner\"><ssd:Elements/></ssd:System>\n";
    let moment = "<ssd:Connector name=\"u\" kind=\"input\"><ssc:Real unit=\"N.m\"/></ssd:Connector>\n";
    let odd = "<ssd:Connector name=\"u\" kind=\"input\"><ssc:Real unit=\"smoot\"/></ssd:Connector>\n";
    let integer = "<ssd:Connector name=\"u\" kind=\"input\"><ssc:Integer/></ssd:Connector>\n";
    let boolean_map = "<ssd:Connection startConnector=\"u\" endElement=\"a\" endConnector=\"u\"><ssc:BooleanMappingTransformation/></ssd:Connection>\n";
    let linear_text = "<ssd:Connection startElement=\"a\" startConnector=\"t\" endElement=\"b\" endConnector=\"s\"><ssc:LinearTransformation factor=\"2\"/></ssd:Connection>\n";
    let cases: Vec<(String, &str)> = vec![
        ("no xml".into(), "line 1: text outside of the root element"),
        ("  \n".into(), "the file has no element"),
        ("<a/>".into(), "expected <SystemStructureDescription>"),
        (
            with("").replace("version=\"1.0\" name=\"s\"", "version=\"3.0\" name=\"s\""),
            "SSP version 3.0 is not supported",
        ),
        (with(&connection("u", "c.u")), "unknown component `c` in a connection; the system has: a, b"),
        (
            with(&connection("u", "a.v")),
            "unknown connector `v` of component `a` in a connection; it has: u, i, b, s",
        ),
        (with(&connection("w", "a.u")), "unknown connector `w` of the system in a connection; it has: u, y"),
        (with(&connection("a.u", "b.u")), "connection a.u -> b.u: a.u is of kind `input`"),
        (with(&connection("a.y", "b.y")), "connection a.y -> b.y: b.y is of kind `output`"),
        (with(&connection("y", "a.u")), "y (system) is of kind `output`"),
        (with(&connection("u", "a.gain")), "a.gain is of kind `parameter`"),
        (
            with(&(connection("u", "b.u") + &connection("a.y", "b.u"))),
            "b.u already has a connection, from u (system); a second one, from a.y",
        ),
        (with(&connection("a.y", "b.i")), "Real cannot be connected to Integer"),
        (with(&connection("a.c", "b.s")), "Boolean cannot be connected to String"),
        (with(linear_text), "String cannot be connected to a linear transformation"),
        (with(boolean_map), "the BooleanMappingTransformation is not supported"),
        (with(&connection("a.x", "b.u")), "the units [N.s] and [N] have different dimensions"),
        (ssd(moment, &one, &connection("u", "a.u"), ""), "the units [N.m] and [N] have different dimensions"),
        (ssd(odd, &one, &connection("u", "a.u"), ""), "the units [smoot] and [N] cannot be compared"),
        (ssd(integer, &one, &connection("u", "a.u"), ""), "Integer cannot be connected to Real"),
        (
            with("<ssd:Connection startConnector=\"u\" endElement=\"a\"/>"),
            "<Connection> has no attribute `endConnector`",
        ),
        (with("").replace("slave.fmu", "gone.fmu"), "component `a`: there is no file "),
        (with("").replace("slave.fmu", "broken.fmu"), "component `a`: "),
        (with("").replace("slave.fmu", "exchange.fmu"), "has no Co-Simulation interface"),
        (
            with("").replace("slave.fmu", "http://x/slave.fmu"),
            "the source http://x/slave.fmu is not supported",
        ),
        (
            with("").replace("name=\"u\" kind=\"input\"/>", "name=\"nope\" kind=\"input\"/>"),
            "connector `nope` of component `a` is not a variable of",
        ),
        (
            with("").replace("name=\"u\" kind=\"input\"/>", "name=\"u\" kind=\"output\"/>"),
            "connector `u` of component `a` is declared as output, but the FMU's variable is an input",
        ),
        (
            with("").replace("name=\"u\" kind=\"input\"/>", "name=\"u\" kind=\"inward\"/>"),
            "`inward` is not input, output",
        ),
        (
            with("").replace(
                "name=\"u\" kind=\"input\"/>",
                "name=\"u\" kind=\"input\"><ssc:Boolean/></ssd:Connector>",
            ),
            "is declared as Boolean, but the FMU's variable is Real",
        ),
        (
            with("").replace(
                "name=\"u\" kind=\"input\"/>",
                "name=\"u\" kind=\"input\"><ssc:Real unit=\"m\"/></ssd:Connector>",
            ),
            "the units [m] and [N] have different dimensions",
        ),
        (ssd(U_AND_Y, &(one.clone() + &one), "", ""), "the component `a` appears twice"),
        (ssd(&(U_AND_Y.to_owned() + U_AND_Y), &one, "", ""), "the connector `u` appears twice"),
        (ssd(U_AND_Y, &component("a.b", ""), "", ""), "`a.b` is not a name without a dot"),
        (ssd(U_AND_Y, nested, "", ""), "the nested <System> `inner` is not supported"),
        (ssd(U_AND_Y, "<ssd:Componnt name=\"a\"/>", "", ""), "unexpected element <Componnt> in <Elements>"),
        (
            system(
                "<ssd:ParameterBindings><ssd:ParameterBinding source=\"gone.ssv\"/></ssd:ParameterBindings>",
            ),
            "line 8: there is no file",
        ),
        (
            system("<ssd:ParameterBindings><ssd:ParameterBinding/></ssd:ParameterBindings>"),
            "<ParameterBinding> has no attribute `source`",
        ),
        (system(&binding(&real("a.gain", "inf"))), "`inf` is not a finite number"),
        (system(&binding(&real("a.gain", "99"))), "`gain` cannot be set to `99`"),
        (system(&binding(&real("a.nope", "1"))), "there is no variable `nope`"),
        (
            system(&binding("<ssv:Parameter name=\"a.gain\"><ssv:String value=\"1\"/></ssv:Parameter>")),
            "allowed is a number",
        ),
        (
            system(&binding(
                "<ssv:Parameter name=\"a.how\"><ssv:Enumeration value=\"what\"/></ssv:Parameter>",
            )),
            "one of none (0)",
        ),
        (system("<ssd:SignalDictionaries/>"), "a signal dictionary is not supported"),
    ];
    for (text, expected) in cases {
        let message =
            open(&folder, &text).map(|graph| panic!("{expected}: accepted {}", graph.name)).unwrap_err();
        let message: &Error = &message;
        assert!(message.to_string().contains(expected), "expected {expected}\nfound    {message}");
        let names_file = ["system.ssd", "gone.ssv"].iter().any(|name| message.to_string().contains(name));
        assert!(names_file, "the file is not named: {message}");
    }
}

#[test]
fn other_kinds_of_files_are_refused() {
    let message = SystemGraph::open(std::path::Path::new("a.txt")).unwrap_err().to_string();
    assert!(message.contains("a.txt: not a system"), "{message}");
    let message = SystemGraph::open(std::path::Path::new("gone.ssd")).unwrap_err().to_string();
    assert!(message.starts_with("gone.ssd: "), "{message}");
}
