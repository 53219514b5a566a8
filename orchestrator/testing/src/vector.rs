//! The FMI 3.0 FMU of `vector.c`: arrays, variables of all types, both interfaces.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use crate::c_fmu;

/// Its model description.
pub fn description() -> String {
    let mut variables = String::from(
        r#"<Float64 name="time" valueReference="0" causality="independent"/>
<UInt64 name="n" valueReference="1" causality="structuralParameter" variability="fixed" start="2" min="1" max="4"/>
<Float64 name="A" valueReference="2" causality="parameter" start="1 2 3 4"><Dimension valueReference="1"/><Dimension valueReference="1"/></Float64>
<Float64 name="u" valueReference="3" causality="input" start="0"><Dimension valueReference="1"/></Float64>
<Float64 name="x" valueReference="4" causality="local" initial="exact" start="1 -1 1 -1" declaredType="Place"><Dimension valueReference="1"/><Alias name="x_mm" displayUnit="mm"/></Float64>
<Float64 name="der(x)" valueReference="5" causality="local" derivative="4"><Dimension valueReference="1"/></Float64>
<Float64 name="y" valueReference="6" causality="output"><Dimension valueReference="1"/></Float64>
<Boolean name="early" valueReference="40" causality="parameter" start="false"/>
<Int32 name="updates" valueReference="41" causality="output" initial="exact" start="0"/>
<Int32 name="count" valueReference="42" causality="output" initial="exact" start="0"/>
<Float64 name="indicator" valueReference="43"/>
<Boolean name="below" valueReference="44" causality="output"/>
<Enumeration name="choice_in" valueReference="32" causality="input" declaredType="Choice" start="1"/>
<Enumeration name="choice_out" valueReference="33" causality="output" declaredType="Choice"/>
<String name="text_in" valueReference="30" causality="input"><Start value="start"/></String>
<String name="text_out" valueReference="31" causality="output"/>
<Binary name="bytes_in" valueReference="52" causality="input"><Start value="00FF10"/></Binary>
<Binary name="bytes_out" valueReference="53" causality="output"/>
<Clock name="ticks" valueReference="51" causality="output" intervalVariability="triggered"/>
"#,
    );
    let scalars = [
        ("Int8", "i8", 10),
        ("UInt8", "u8", 12),
        ("Int16", "i16", 14),
        ("UInt16", "u16", 16),
        ("Int32", "i32", 18),
        ("UInt32", "u32", 20),
        ("Int64", "i64", 22),
        ("UInt64", "u64", 24),
        ("Float32", "f32", 26),
        ("Boolean", "flag", 28),
    ];
    for (kind, name, reference) in scalars {
        let start = if kind == "Boolean" { "false" } else { "0" };
        let _ = writeln!(
            variables,
            "<{kind} name=\"{name}_in\" valueReference=\"{reference}\" causality=\"input\" start=\"{start}\"/>\n\
             <{kind} name=\"{name}_out\" valueReference=\"{}\" causality=\"output\"/>",
            reference + 1
        );
    }
    let mut structure = String::from(
        "<Output valueReference=\"6\" dependencies=\"3 4\" dependenciesKind=\"constant constant\"/>\
         <Output valueReference=\"41\"/><Output valueReference=\"42\"/><Output valueReference=\"44\"/>\
         <Output valueReference=\"33\" dependencies=\"32\"/><Output valueReference=\"31\" dependencies=\"30\"/>\
         <Output valueReference=\"53\" dependencies=\"52\"/><Output valueReference=\"51\"/>",
    );
    for (_, _, reference) in scalars {
        let other = if reference == 24 { " 28" } else { "" };
        let output = reference + 1;
        let _ =
            write!(structure, "<Output valueReference=\"{output}\" dependencies=\"{reference}{other}\"/>");
    }
    structure += "<ContinuousStateDerivative valueReference=\"5\" dependencies=\"3 4\"/>\
                  <InitialUnknown valueReference=\"5\"/><InitialUnknown valueReference=\"6\"/>\
                  <InitialUnknown valueReference=\"44\"/><InitialUnknown valueReference=\"33\"/>\
                  <InitialUnknown valueReference=\"31\"/><InitialUnknown valueReference=\"53\"/>";
    for (_, _, reference) in scalars {
        let _ = write!(structure, "<InitialUnknown valueReference=\"{}\"/>", reference + 1);
    }
    structure += "<EventIndicator valueReference=\"43\"/>";
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <fmiModelDescription fmiVersion=\"3.0\" modelName=\"vector\" instantiationToken=\"vector\">\n\
         <ModelExchange modelIdentifier=\"vector\" canGetAndSetFMUState=\"true\" canSerializeFMUState=\"true\" \
         providesDirectionalDerivatives=\"true\"/>\n\
         <CoSimulation modelIdentifier=\"vector\" canGetAndSetFMUState=\"true\" canSerializeFMUState=\"true\" \
         canHandleVariableCommunicationStepSize=\"true\" providesDirectionalDerivatives=\"true\" \
         maxOutputDerivativeOrder=\"1\" hasEventMode=\"true\" providesIntermediateUpdate=\"true\"/>\n\
         <UnitDefinitions><Unit name=\"m\"><BaseUnit m=\"1\"/><DisplayUnit name=\"mm\" factor=\"1000\"/></Unit></UnitDefinitions>\n\
         <TypeDefinitions><Float64Type name=\"Place\" unit=\"m\"/>\
         <EnumerationType name=\"Choice\"><Item name=\"one\" value=\"1\"/><Item name=\"two\" value=\"2\"/></EnumerationType>\
         </TypeDefinitions>\n\
         <DefaultExperiment startTime=\"0\" stopTime=\"1\" stepSize=\"0.1\"/>\n\
         <ModelVariables>\n{variables}</ModelVariables>\n<ModelStructure>{structure}</ModelStructure>\n\
         </fmiModelDescription>\n"
    )
}

/// Writes the FMU with a description into the folder.
pub fn fmu(folder: &Path, name: &str, description: &str) -> PathBuf {
    let library = folder.join("vector.so");
    if !library.exists() {
        c_fmu::compile("vector.c", &library, &["-fvisibility=hidden"]);
    }
    let path = folder.join(name);
    c_fmu::pack_for(&path, description, Some(("vector", &library)), "x86_64-linux");
    path
}

/// A folder with `vector.fmu`, ready to run.
pub fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    fmu(folder.path(), "vector.fmu", &description());
    folder
}
