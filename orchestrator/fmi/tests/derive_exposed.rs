//! Local variables of FMUs as outputs: descriptions of both versions, with and without the parts that change.

use airloop_fmi::derive::{DeriveError, expose};
use airloop_fmi::{Causality, Fmu};
use airloop_testing::c_fmu;

const HEAD_2: &str = r#"<?xml version="1.0"?>
<fmiModelDescription fmiVersion="2.0" modelName="m" guid="g"><ModelExchange modelIdentifier="m"/>
<ModelVariables>
<ScalarVariable name="u" valueReference="0" causality="input"><Real start="0"/></ScalarVariable>
<ScalarVariable name="x &lt;1&gt;" valueReference="1" causality="local" initial="exact"><Real start="1"/></ScalarVariable>
<ScalarVariable name="der(x)" valueReference="2"><Real derivative="2"/></ScalarVariable>
<ScalarVariable name="v" valueReference="3" description="a > b"><Real/></ScalarVariable>
<ScalarVariable name="k" valueReference="4" causality="parameter"><Real start="3"/></ScalarVariable>
</ModelVariables>
"#;

const HEAD_3: &str = r#"<?xml version="1.0"?>
<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="g"><ModelExchange modelIdentifier="m"/>
<ModelVariables>
<Float64 name="u" valueReference="10" causality="input" start="0"/>
<Float64 name="x &lt;1&gt;" valueReference="11" causality="local" initial="exact" start="1 2"><Dimension start="2"/></Float64>
<Float64 name="der(x)" valueReference="12" derivative="11"><Dimension start="2"/></Float64>
<Float64 name="v" valueReference="13"/>
<Float64 name="k" valueReference="14" causality="parameter" start="3"/>
</ModelVariables>
"#;

/// Outputs and unknowns of the initialization, by name, after `names` were exposed; with the text of the description.
fn exposed(head: &str, structure: &str, names: &[&str]) -> (Vec<String>, Vec<String>, String) {
    let folder = tempfile::tempdir().unwrap();
    let (from, to) = (folder.path().join("m.fmu"), folder.path().join("n.fmu"));
    c_fmu::pack(&from, &format!("{head}{structure}</fmiModelDescription>"), None);
    let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
    expose(&from, &to, &names).unwrap();
    let fmu = Fmu::open(&to).unwrap();
    let own = &fmu.description;
    let listed: Vec<String> =
        own.outputs.iter().map(|unknown| own.variables[unknown.variable].name.clone()).collect();
    for variable in &own.variables {
        let is_output = variable.causality == Causality::Output;
        assert_eq!(is_output, listed.contains(&variable.name), "{}", variable.name);
    }
    let initial =
        own.initial_unknowns.iter().map(|unknown| own.variables[unknown.variable].name.clone()).collect();
    let text = std::fs::read_to_string(fmu.folder().join("modelDescription.xml")).unwrap();
    // A second time nothing changes, in place.
    expose(&to, &to, &names).unwrap();
    let again = Fmu::open(&to).unwrap();
    assert_eq!(std::fs::read_to_string(again.folder().join("modelDescription.xml")).unwrap(), text);
    (listed, initial, text)
}

#[test]
fn local_variables_are_outputs_in_whatever_model_structure() {
    let derivatives = r#"<Derivatives><Unknown index="3" dependencies="1 2"/></Derivatives>"#;
    for (structure, initial) in [
        (format!("<ModelStructure>{derivatives}</ModelStructure>"), &["v"][..]),
        (format!("<ModelStructure><Outputs/>{derivatives}<InitialUnknowns/></ModelStructure>"), &["v"]),
        (
            format!(
                "<ModelStructure><Outputs></Outputs>{derivatives}<InitialUnknowns><Unknown \
                 index=\"3\"/></InitialUnknowns></ModelStructure>"
            ),
            &["v", "der(x)"],
        ),
    ] {
        let (outputs, unknowns, text) = exposed(HEAD_2, &structure, &["v", "x <1>", "k", "v"]);
        assert_eq!(outputs, ["v", "x <1>"], "{text}");
        assert_eq!(unknowns, initial, "{text}");
        // A state follows itself.
        assert!(text.contains(r#"<Unknown index="2" dependencies="2"/>"#), "{text}");
        assert!(text.contains(r#"description="a > b""#) && text.contains(r#"name="x &lt;1&gt;""#), "{text}");
    }
}

#[test]
fn an_element_of_an_array_stands_for_the_whole() {
    let state = r#"<ContinuousStateDerivative valueReference="12"/>"#;
    let structure =
        format!("<ModelStructure>{state}<EventIndicator valueReference=\"13\"/></ModelStructure>");
    let (outputs, unknowns, text) = exposed(HEAD_3, &structure, &["x <1>[2]", "v"]);
    assert_eq!(outputs, ["x <1>[1]", "x <1>[2]", "v"], "{text}");
    assert_eq!(unknowns, ["v"]);
    let order = ["<Output ", "<ContinuousStateDerivative ", "<InitialUnknown ", "<EventIndicator "];
    let places = order.map(|tag| text.find(tag).unwrap());
    assert!(places.is_sorted(), "{text}");
}

#[test]
fn a_name_that_is_not_there_is_refused_and_nothing_written() {
    let folder = tempfile::tempdir().unwrap();
    let (from, to) = (folder.path().join("m.fmu"), folder.path().join("n.fmu"));
    c_fmu::pack(&from, &format!("{HEAD_2}<ModelStructure/></fmiModelDescription>"), None);
    let error = expose(&from, &to, &["w".into()]).unwrap_err();
    assert!(matches!(error, DeriveError::Unknown { .. }), "{error}");
    assert!(!to.exists());
}
