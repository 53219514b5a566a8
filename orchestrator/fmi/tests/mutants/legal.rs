//! FMUs that look odd and are right: the checker must not call them wrong.

use super::Change::{Bytes, Fault, Files, Text};
use super::{Mutant, three, two};

fn with_mark(text: &str) -> Vec<u8> {
    [b"\xEF\xBB\xBF", text.as_bytes()].concat()
}

fn windows_lines(text: &str) -> Vec<u8> {
    text.replace('\n', "\r\n").into_bytes()
}

fn without(text: &str, from: &str, to: &str) -> String {
    let (start, end) = (text.find(from).unwrap(), text.find(to).unwrap());
    format!("{}{}", &text[..start], &text[end..])
}

fn co_simulation_only(text: &str) -> Vec<u8> {
    without(text, "<ModelExchange", "<CoSimulation").into_bytes()
}

fn model_exchange_only(text: &str) -> Vec<u8> {
    without(text, "<CoSimulation", "<UnitDefinitions>").into_bytes()
}

fn co_simulation_first(text: &str) -> Vec<u8> {
    let (from, to) = (text.find("<ModelExchange").unwrap(), text.find("<CoSimulation").unwrap());
    let exchange = text[from..to].to_owned();
    let rest = without(text, "<ModelExchange", "<CoSimulation");
    rest.replace("<UnitDefinitions>", &format!("{exchange}<UnitDefinitions>")).into_bytes()
}

fn without_dependencies(text: &str) -> Vec<u8> {
    let mut out = String::new();
    let mut rest = text;
    while let Some(at) = rest.find(" dependencies") {
        out.push_str(&rest[..at]);
        let value = rest[at..].find('"').unwrap() + at + 1;
        rest = &rest[value + rest[value..].find('"').unwrap() + 1..];
    }
    (out + rest).into_bytes()
}

pub const VARIANTS: &[Mutant] = &[
    two("the subject itself", "", Text(&[])),
    two("Co-Simulation only", "", Bytes(co_simulation_only)),
    two("Model Exchange only", "", Bytes(model_exchange_only)),
    two("CoSimulation before ModelExchange", "", Bytes(co_simulation_first)),
    two("no dependencies at all", "", Bytes(without_dependencies)),
    two("byte order mark of UTF-8", "", Bytes(with_mark)),
    two("lines of Windows", "", Bytes(windows_lines)),
    two(
        "no DefaultExperiment",
        "",
        Text(&[(
            "<DefaultExperiment startTime=\"0\" stopTime=\"2\" stepSize=\"0.01\" tolerance=\"1e-6\"/>",
            "",
        )]),
    ),
    two(
        "annotations of a vendor",
        "",
        Text(&[
            (
                "<ModelVariables>",
                "<VendorAnnotations><Tool name=\"t\"><any:thing xmlns:any=\"urn:x\" a=\"1\">text</any:thing></Tool></VendorAnnotations><ModelVariables>",
            ),
            ("start=\"0.5\"/>", "start=\"0.5\"/><Annotations><Tool name=\"t\"/></Annotations>"),
        ]),
    ),
    two(
        "place of a schema in the root",
        "",
        Text(&[(
            "<fmiModelDescription",
            "<fmiModelDescription xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" xsi:noNamespaceSchemaLocation=\"fmi2ModelDescription.xsd\"",
        )]),
    ),
    two(
        "comments, and other ways to write values",
        "",
        Text(&[
            ("<ModelVariables>", "<!-- variables --><ModelVariables>"),
            ("start=\"0.5\"", "start=\"+5.0E-1\""),
            ("reinit=\"true\"", "reinit=\"1\""),
            ("min=\"0\" max=\"100\"", "min=\"-INF\" max=\"INF\""),
        ]),
    ),
    two(
        "alias of an output",
        "",
        Text(&[(
            "</ModelVariables>",
            "<ScalarVariable name=\"speed\" valueReference=\"8\"><Real unit=\"m/s\"/></ScalarVariable></ModelVariables>",
        )]),
    ),
    two(
        "names beyond ASCII, flat convention",
        "",
        Text(&[("\"structured\"", "\"flat\""), ("name=\"w\"", "name=\"\u{3c9} (speed) \u{2192}\"")]),
    ),
    two("states jump and everybody is told", "", Fault("ANNOUNCED_JUMP", &[])),
    two(
        "dependencies declared that are none",
        "",
        Text(&[
            (
                "<Unknown index=\"16\" dependencies=\"15\"/>",
                "<Unknown index=\"16\" dependencies=\"15 2 3 19\"/>",
            ),
            (
                "<Unknown index=\"9\" dependencies=\"5\" dependenciesKind=\"constant\"/>",
                "<Unknown index=\"9\" dependencies=\"2 4 5\"/>",
            ),
        ]),
    ),
    two("text on the standard output", "", Fault("PRINTS", &[])),
    two(
        "one instance per process",
        "",
        Text(&[
            ("<ModelExchange", "<ModelExchange canBeInstantiatedOnlyOncePerProcess=\"true\""),
            ("<CoSimulation", "<CoSimulation canBeInstantiatedOnlyOncePerProcess=\"true\""),
        ]),
    ),
    two(
        "folders, documentation and files of a vendor",
        "",
        Files(&[
            ("documentation/index.html", "<p/>"),
            ("resources/a.txt", "a"),
            ("extra/org.example/b.txt", "b"),
            ("README.txt", "c"),
        ]),
    ),
    two("no claims", "", Bytes(without_claims)),
    three("FMI 3.0: the subject itself", "", Text(&[])),
    three("FMI 3.0: Model Exchange only", "", Bytes(model_exchange_only)),
    three("FMI 3.0: Co-Simulation only", "", Bytes(co_simulation_only)),
    three(
        "FMI 3.0: an attribute of a vendor at an interface",
        "",
        Text(&[("<CoSimulation", "<CoSimulation xmlns:v=\"urn:v\" v:speed=\"fast\"")]),
    ),
    three(
        "FMI 3.0: annotations and an alias",
        "",
        Text(&[
            (
                "</ModelStructure>",
                "</ModelStructure><Annotations><Annotation type=\"t\">text</Annotation></Annotations>",
            ),
            (
                "causality=\"output\" unit=\"m/s\"/>",
                "causality=\"output\" unit=\"m/s\"><Alias name=\"speed\"/></Float64>",
            ),
        ]),
    ),
];

fn without_claims(text: &str) -> Vec<u8> {
    let mut text = text.to_owned();
    for claim in [
        "canGetAndSetFMUstate",
        "canSerializeFMUstate",
        "providesDirectionalDerivative",
        "canInterpolateInputs",
        "canHandleVariableCommunicationStepSize",
    ] {
        text = text.replace(&format!(" {claim}=\"true\""), "");
    }
    text.replace(" maxOutputDerivativeOrder=\"1\"", "").into_bytes()
}
