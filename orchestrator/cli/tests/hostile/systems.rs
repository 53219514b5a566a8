//! Systems and parameter sets.

use super::Case;

const SYSTEM: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription" xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0" name="s">
  <ssd:System name="s">
    <ssd:Connectors><ssd:Connector name="u" kind="input"/><ssd:Connector name="y" kind="output"/></ssd:Connectors>
    <ssd:Elements>
      <ssd:Component name="a" source="m.fmu"><ssd:Connectors><ssd:Connector name="u" kind="input"/><ssd:Connector name="y" kind="output"/></ssd:Connectors></ssd:Component>
      <ssd:Component name="b" source="m.fmu"><ssd:Connectors><ssd:Connector name="u" kind="input"/><ssd:Connector name="y" kind="output"/></ssd:Connectors>
        <ssd:ParameterBindings><ssd:ParameterBinding source="p.ssv"/></ssd:ParameterBindings>
      </ssd:Component>
    </ssd:Elements>
    <ssd:Connections>
      <ssd:Connection startConnector="u" endElement="a" endConnector="u"/>
      <ssd:Connection startElement="a" startConnector="y" endElement="b" endConnector="u"/>
      <ssd:Connection startElement="b" startConnector="y" endConnector="y"/>
    </ssd:Connections>
  </ssd:System>
</ssd:SystemStructureDescription>
"#;

const SET: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues" version="1.0" name="p">
  <ssv:Parameters><ssv:Parameter name="x"><ssv:Real value="2"/></ssv:Parameter></ssv:Parameters>
</ssv:ParameterSet>
"#;

pub fn cases() -> Vec<Case> {
    let made = |what: &str, make: fn(&std::path::Path)| {
        Case::new(what, "run s.ssd --stop 1 --step 10ms -o out").make(make)
    };
    let run = |what: &str, system: &str, set: &str| {
        Case::new(what, "run s.ssd --stop 1 --step 10ms -o out")
            .fmu()
            .file("s.ssd", system)
            .file("p.ssv", set)
    };
    let with = |what: &str, from: &str, to: &str| {
        assert!(SYSTEM.contains(from), "{from}");
        run(what, &SYSTEM.replacen(from, to, 1), SET)
    };
    let set = |what: &str, from: &str, to: &str| {
        assert!(SET.contains(from), "{from}");
        run(what, SYSTEM, &SET.replacen(from, to, 1))
    };
    vec![
        made("a named pipe", |folder| super::pipe(&folder.join("s.ssd"))),
        made("a link to /dev/zero", |folder| {
            std::os::unix::fs::symlink("/dev/zero", folder.join("s.ssd")).unwrap()
        }),
        run("an empty file", "", SET),
        run("a text", "a -> b\n", SET),
        with("another root element", "<ssd:SystemStructureDescription ", "<ssd:Structure "),
        with("an FMU that is not there", "source=\"m.fmu\"", "source=\"other.fmu\""),
        with("an FMU on the network", "source=\"m.fmu\"", "source=\"http://example.org/m.fmu\""),
        with("two components of one name", "Component name=\"b\"", "Component name=\"a\""),
        with("a connection from a component that is not there", "startElement=\"a\"", "startElement=\"c\""),
        with(
            "a connection to a connector that is not there",
            "endElement=\"b\" endConnector=\"u\"",
            "endElement=\"b\" endConnector=\"w\"",
        ),
        with(
            "a connection into an output",
            "endElement=\"b\" endConnector=\"u\"",
            "endElement=\"b\" endConnector=\"y\"",
        ),
        with(
            "two connections into one input",
            "endElement=\"b\" endConnector=\"u\"",
            "endElement=\"a\" endConnector=\"u\"",
        ),
        with(
            "a connector that the FMU does not have",
            "<ssd:Connector name=\"u\" kind=\"input\"/><ssd:Connector name=\"y\" kind=\"output\"/></ssd:Connectors></ssd:Component>",
            "<ssd:Connector name=\"w\" kind=\"input\"/></ssd:Connectors></ssd:Component>",
        ),
        with("a parameter set that is not there", "source=\"p.ssv\"", "source=\"q.ssv\""),
        set("a parameter that is not there", "name=\"x\"", "name=\"mass\""),
        set("a value that is a word", "value=\"2\"", "value=\"two\""),
        set("a value of NaN", "value=\"2\"", "value=\"NaN\""),
        set("a value of infinity", "value=\"2\"", "value=\"INF\""),
        run("an empty parameter set", SYSTEM, ""),
        Case::new("a package that is no archive", "run s.ssp --stop 1 --step 10ms -o out").file("s.ssp", "x"),
        Case::new("a system that is a folder", "run tmp --stop 1 --step 10ms -o out"),
    ]
}
