//! Model descriptions that must be refused with line and element, and odd ones that must be accepted.

use airloop_fmi::{Causality, Initial, ModelDescription, VariableKind};
use airloop_testing::fmu_library::{INPUT, description};

fn refusal(xml: &str) -> String {
    ModelDescription::parse(xml.as_bytes()).map(|_| ()).expect_err(xml).to_string()
}

fn variable(attributes: &str, inner: &str) -> String {
    format!("<ScalarVariable name=\"x\" valueReference=\"1\" {attributes}>{inner}</ScalarVariable>")
}

#[test]
fn defects_are_named_with_line_and_element() {
    let two = |second: &str| description(&format!("{INPUT}\n{second}"));
    let structure = |unknown: &str| {
        two(&variable("causality=\"output\"", "<Real/>")).replace(
            "<ModelStructure/>",
            &format!("<ModelStructure><Outputs>\n{unknown}\n</Outputs></ModelStructure>"),
        )
    };
    let output = "causality=\"output\"";
    let cases: Vec<(String, &[&str])> = vec![
        (two(INPUT), &["line 6", "\"u\"", "line 5"]),
        (
            two(&variable("causality=\"input\"", "<Real start=\"NaN\"/>")),
            &["line 6", "\"x\"", "start=\"NaN\"", "finite"],
        ),
        (two(&variable("", "<Real start=\"INF\"/>")), &["\"x\"", "INF"]),
        (two(&variable("", "<Real start=\"1,5\"/>")), &["\"x\"", "1,5", "a number"]),
        (two(&variable("", "<Real derivative=\"3\"/>")), &["\"x\"", "derivative=\"3\"", "1 to 2"]),
        (two(&variable("", "<Real derivative=\"0\"/>")), &["\"x\"", "derivative=\"0\""]),
        (two(&variable("", "<Integer start=\"3000000000\"/>")), &["\"x\"", "3000000000", "i32"]),
        (two(&variable("", "<Boolean start=\"yes\"/>")), &["\"x\"", "yes", "true or false"]),
        (two(&variable("", "")), &["\"x\"", "none of the elements"]),
        (two(&variable("", "<Real/><Integer/>")), &["\"x\"", "Real and Integer"]),
        (two(&variable("", "<Enumeration/>")), &["\"x\"", "declaredType"]),
        (two(&variable("", "<Real declaredType=\"Force\"/>")), &["\"x\"", "Force", "TypeDefinitions"]),
        (two(&variable("causality=\"out\"", "<Real/>")), &["\"x\"", "\"out\"", "calculatedParameter"]),
        (
            two("<ScalarVariable valueReference=\"1\"><Real/></ScalarVariable>"),
            &["line 6", "name is missing"],
        ),
        (two("<ScalarVariable name=\"x\"><Real/></ScalarVariable>"), &["\"x\"", "valueReference is missing"]),
        (
            two("<ScalarVariable name=\"x\" valueReference=\"-1\"><Real/></ScalarVariable>"),
            &["\"x\"", "\"-1\""],
        ),
        (
            two(&INPUT.replace("\"u\"", "\"x\"")),
            &["line 6", "\"x\"", "valueReference 0", "\"u\"", "both can be set"],
        ),
        (
            two("<ScalarVariable name=\"x\" valueReference=\"0\"><Real start=\"2\"/></ScalarVariable>"),
            &["\"x\"", "start values differ"],
        ),
        (structure("<Unknown index=\"3\"/>"), &["line 9", "Outputs", "index 3", "2 variables"]),
        (structure("<Unknown index=\"0\"/>"), &["Outputs", "index 0"]),
        (structure("<Unknown/>"), &["index is missing"]),
        (structure("<Unknown index=\"2\" dependencies=\"7\"/>"), &["dependency 7"]),
        (
            structure("<Unknown index=\"2\" dependencies=\"1\" dependenciesKind=\"constant fixed\"/>"),
            &["index=\"2\"", "1 dependencies and 2 words"],
        ),
        (
            structure("<Unknown index=\"2\" dependencies=\"1\" dependenciesKind=\"some\"/>"),
            &["\"some\"", "tunable"],
        ),
        (description(INPUT).replace("guid=\"right\"", ""), &["line 2", "guid is missing"]),
        (description(INPUT).replace("\"2.0\"", "\"1.0\""), &["FMI 1.0", "2.0 and 3.0"]),
        (description(INPUT).replace("fmiVersion=\"2.0\"", ""), &["fmiVersion is missing"]),
        (
            description(INPUT).replace("<CoSimulation modelIdentifier=\"m\"/>", ""),
            &["neither a CoSimulation"],
        ),
        (
            description(INPUT).replace("modelIdentifier=\"m\"", ""),
            &["CoSimulation", "modelIdentifier is missing"],
        ),
        (
            description(INPUT).replace("?>\n", "?>\n<!DOCTYPE x [<!ENTITY a \"b\">]>\n"),
            &["line 2", "DOCTYPE"],
        ),
        (description(&variable(output, "<Real/>").replace("\"x\"", "\"&bomb;\"")), &["bomb"]),
        (description(INPUT).replace("</fmiModelDescription>", ""), &["line 2", "truncated"]),
        (description(INPUT).replace("</ModelVariables>", ""), &["well-formed"]),
        (format!("{}<a/>", description(INPUT)), &["second root"]),
        ("".to_owned(), &["no element"]),
        ("just text".to_owned(), &["outside of the root"]),
        (format!("{}{}", "<a>".repeat(100_000), "</a>".repeat(100_000)), &["64 deep"]),
        (
            format!("<a {}/>", (0..100_000).map(|i| format!("a{i}=\"\" ")).collect::<String>()),
            &["more than 100 attributes"],
        ),
        ("<a>".to_owned() + &"<b/>".repeat(2_000_001) + "</a>", &["2000000 elements"]),
    ];
    for (xml, parts) in cases {
        let message = refusal(&xml);
        for part in parts {
            assert!(message.contains(part), "{part:?} is missing in: {message}");
        }
    }
}

#[test]
fn wrong_encodings_are_named() {
    let mut latin1 = description(INPUT).into_bytes();
    let at = latin1.windows(4).position(|window| window == b"\"m\" ").unwrap();
    latin1[at + 1] = 0xE4;
    let message = ModelDescription::parse(&latin1).unwrap_err().to_string();
    assert!(message.contains("line 2") && message.contains("UTF-8"), "{message}");
    let utf16: Vec<u8> = [0xFF, 0xFE]
        .into_iter()
        .chain(description(INPUT).encode_utf16().flat_map(u16::to_le_bytes))
        .collect();
    let message = ModelDescription::parse(&utf16).unwrap_err().to_string();
    assert!(message.contains("UTF-16"), "{message}");
}

#[test]
fn valid_oddities_are_accepted() {
    let variables = format!(
        "<!-- comment -->{INPUT}\
         <ScalarVariable name=\"y\" valueReference=\"0\" causality=\"output\" canHandleMultipleSetPerTimeInstant=\"false\">\
         <Real min=\"-INF\" max=\"1e3\"/><Annotations><Tool name=\"t\"><deep><Real/></deep></Tool></Annotations>\
         </ScalarVariable>\
         <ScalarVariable name=\"a &lt; &#228;\" valueReference=\"0\"><Boolean/></ScalarVariable>"
    );
    let xml = description(&variables).replace(
        "<ModelVariables>",
        "<VendorAnnotations><Tool name=\"x\"><any xmlns:q=\"urn:q\" q:attribute=\"1\">text</any></Tool></VendorAnnotations>\
         <ModelVariables>",
    );
    let bytes: Vec<u8> = b"\xEF\xBB\xBF".iter().copied().chain(xml.into_bytes()).collect();
    let description = ModelDescription::parse(&bytes).unwrap();
    assert_eq!(description.variables.len(), 3);
    assert_eq!(description.variable("y").unwrap().can_handle_multiple_set, Some(false));
    assert_eq!(description.index_of("a < ä"), Some(2));
}

#[test]
fn defaults_follow_the_standard() {
    let types = "<TypeDefinitions><SimpleType name=\"Force\"><Real unit=\"N\" min=\"-9\" max=\"9\" nominal=\"5\"/>\
                 </SimpleType></TypeDefinitions><ModelVariables>";
    let xml = description(
        "<ScalarVariable name=\"F\" valueReference=\"0\" causality=\"input\"><Real declaredType=\"Force\" max=\"3\" start=\"1\"/></ScalarVariable>\
         <ScalarVariable name=\"p\" valueReference=\"1\" causality=\"parameter\" variability=\"fixed\"><Real start=\"1\"/></ScalarVariable>\
         <ScalarVariable name=\"y\" valueReference=\"2\" causality=\"output\"><Real/></ScalarVariable>\
         <ScalarVariable name=\"l\" valueReference=\"3\"><Real/></ScalarVariable>",
    )
    .replace("<ModelVariables>", types)
    .replace(
        "<ModelStructure/>",
        "<ModelStructure><Outputs><Unknown index=\"3\" dependencies=\"\"/></Outputs>\
         <InitialUnknowns><Unknown index=\"3\"/></InitialUnknowns></ModelStructure>",
    );
    let description = ModelDescription::parse(xml.as_bytes()).unwrap();
    let VariableKind::Real(force) = &description.variable("F").unwrap().kind else { panic!() };
    assert_eq!(
        (force.unit.as_deref(), force.min, force.max, force.nominal),
        (Some("N"), Some(-9.0), Some(3.0), Some(5.0))
    );
    let initials: Vec<_> = description.variables.iter().map(|variable| variable.initial).collect();
    assert_eq!(initials, [None, Some(Initial::Exact), Some(Initial::Calculated), Some(Initial::Calculated)]);
    assert_eq!(description.variables[3].causality, Causality::Local);
    // Nothing listed is "on none"; no list at all is "on everything".
    assert_eq!(description.outputs[0].dependencies, Some(vec![]));
    assert_eq!(description.initial_unknowns[0].dependencies, None);
}

#[test]
fn a_cut_model_description_never_panics() {
    let xml = description(INPUT);
    for length in 0..xml.trim_end().len() {
        assert!(ModelDescription::parse(&xml.as_bytes()[..length]).is_err(), "{length}");
    }
}
