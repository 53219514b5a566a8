//! Defects of the description and of the archive.

use super::Change::{Bytes, Files, NoLibrary, Text};
use super::{Mutant, three, two};

fn latin_1(text: &str) -> Vec<u8> {
    let text = text.replace("UTF-8", "ISO-8859-1").replace("modelName=\"subject\"", "modelName=\"\u{e4}\"");
    text.chars().map(|character| u8::try_from(u32::from(character)).unwrap()).collect()
}

fn utf_16(text: &str) -> Vec<u8> {
    text.encode_utf16().flat_map(u16::to_le_bytes).collect()
}

fn cut_off(text: &str) -> Vec<u8> {
    text.as_bytes()[..text.len() / 2].to_vec()
}

pub const MUTANTS: &[Mutant] = &[
    two("element ModelStructure before ModelVariables", "schema", Bytes(structure_first)),
    two("units behind types", "schema", Bytes(units_last)),
    two("unknown attribute of a variable", "schema", Text(&[("name=\"y\"", "name=\"y\" colour=\"red\"")])),
    two("unknown attribute of a Real", "schema", Text(&[("start=\"0.5\"", "start=\"0.5\" value=\"1\"")])),
    two(
        "unknown attribute of an interface",
        "schema",
        Text(&[("<CoSimulation", "<CoSimulation canDoEverything=\"true\"")]),
    ),
    two(
        "attribute of FMI 3.0",
        "schema",
        Text(&[("<ModelExchange", "<ModelExchange needsCompletedIntegratorStep=\"true\"")]),
    ),
    two("unknown element", "schema", Text(&[("<LogCategories>", "<Remarks/><LogCategories>")])),
    two(
        "element of FMI 3.0",
        "schema",
        Text(&[("</ModelStructure>", "<EventIndicator index=\"1\"/></ModelStructure>")]),
    ),
    two(
        "two elements DefaultExperiment",
        "schema",
        Text(&[("<ModelVariables>", "<DefaultExperiment/><ModelVariables>")]),
    ),
    two(
        "list of files without file",
        "schema",
        Text(&[(
            "providesDirectionalDerivative=\"true\"/>",
            "providesDirectionalDerivative=\"true\"><SourceFiles/></ModelExchange>",
        )]),
    ),
    two("text between elements", "schema", Text(&[("<ModelVariables>", "<ModelVariables>variables")])),
    two("date that is none", "schema", Text(&[("2026-01-31T12:00:00Z", "31.01.2026 12:00")])),
    two("unknown variableNamingConvention", "refused", Text(&[("\"structured\"", "\"pretty\"")])),
    two("no modelName", "schema", Text(&[(" modelName=\"subject\"", "")])),
    two("no guid", "refused", Text(&[(" guid=\"subject\"", "")])),
    two("FMI 1.0", "refused", Text(&[("fmiVersion=\"2.0\"", "fmiVersion=\"1.0\"")])),
    two("no interface", "refused", Bytes(no_interface)),
    two("no numberOfEventIndicators", "event-indicators", Text(&[(" numberOfEventIndicators=\"1\"", "")])),
    two(
        "4294967295 event indicators",
        "refused",
        Text(&[("numberOfEventIndicators=\"1\"", "numberOfEventIndicators=\"4294967295\"")]),
    ),
    two(
        "negative number of event indicators",
        "refused",
        Text(&[("numberOfEventIndicators=\"1\"", "numberOfEventIndicators=\"-1\"")]),
    ),
    two(
        "other number of event indicators than the library's",
        "life-cycle",
        Text(&[("numberOfEventIndicators=\"1\"", "numberOfEventIndicators=\"2\"")]),
    ),
    two("Latin-1 instead of UTF-8", "refused", Bytes(latin_1)),
    two("UTF-16 instead of UTF-8", "refused", Bytes(utf_16)),
    two("description cut off", "refused", Bytes(cut_off)),
    two(
        "DOCTYPE with an entity",
        "refused",
        Text(&[("<fmiModelDescription", "<!DOCTYPE a [<!ENTITY b \"c\">]><fmiModelDescription")]),
    ),
    two("two variables of one name", "refused", Text(&[("name=\"w\"", "name=\"y\"")])),
    two(
        "two parameters with one value reference",
        "refused",
        Text(&[("valueReference=\"11\"", "valueReference=\"10\"")]),
    ),
    two("valueReference missing", "refused", Text(&[(" valueReference=\"11\"", "")])),
    two(
        "valueReference that is no number",
        "refused",
        Text(&[("valueReference=\"11\"", "valueReference=\"eleven\"")]),
    ),
    two("variable without type", "refused", Text(&[("<Real start=\"0.5\"/>", "")])),
    two("unknown causality", "refused", Text(&[("causality=\"independent\"", "causality=\"clock\"")])),
    two("unknown variability", "refused", Text(&[("variability=\"tunable\"", "variability=\"sometimes\"")])),
    two(
        "continuous parameter",
        "causality-variability",
        Text(&[("variability=\"tunable\"", "variability=\"continuous\"")]),
    ),
    two(
        "constant input",
        "causality-variability",
        Text(&[(
            "causality=\"input\" variability=\"discrete\"",
            "causality=\"input\" variability=\"constant\"",
        )]),
    ),
    two(
        "continuous Integer",
        "causality-variability",
        Text(&[(
            "causality=\"output\" variability=\"discrete\"><Integer",
            "causality=\"output\" variability=\"continuous\"><Integer",
        )]),
    ),
    two(
        "Integer without variability, which makes it continuous",
        "causality-variability",
        Text(&[("causality=\"output\" variability=\"discrete\"><Integer", "causality=\"output\"><Integer")]),
    ),
    two(
        "input with initial",
        "initial",
        Text(&[("causality=\"input\"><Real", "causality=\"input\" initial=\"exact\"><Real")]),
    ),
    two(
        "parameter with initial calculated",
        "initial",
        Text(&[(
            "causality=\"parameter\" variability=\"tunable\"",
            "causality=\"parameter\" variability=\"tunable\" initial=\"calculated\"",
        )]),
    ),
    two(
        "input without start",
        "start-missing",
        Text(&[("<Real start=\"0\" min=\"-5\" max=\"5\"/>", "<Real min=\"-5\" max=\"5\"/>")]),
    ),
    two("parameter without start", "start-missing", Text(&[("<Real start=\"0.5\"/>", "<Real/>")])),
    two(
        "exact state without start",
        "start-missing",
        Text(&[("displayUnit=\"mm\" start=\"1\"", "displayUnit=\"mm\"")]),
    ),
    two(
        "calculated output with start",
        "start-forbidden",
        Text(&[("causality=\"output\"><Real/>", "causality=\"output\"><Real start=\"1\"/>")]),
    ),
    two(
        "independent variable with start",
        "start-forbidden",
        Text(&[("<Real unit=\"s\"/>", "<Real unit=\"s\" start=\"0\"/>")]),
    ),
    two(
        "two independent variables",
        "independent",
        Text(&[(
            "</ModelVariables>",
            "<ScalarVariable name=\"t\" valueReference=\"99\" causality=\"independent\"><Real/></ScalarVariable></ModelVariables>",
        )]),
    ),
    two("start below min", "start-range", Text(&[("start=\"4\" min=\"0\"", "start=\"-4\" min=\"0\"")])),
    two(
        "start above max of an Integer",
        "start-range",
        Text(&[(
            "<Integer start=\"0\" min=\"-10\" max=\"10\"/>",
            "<Integer start=\"11\" min=\"-10\" max=\"10\"/>",
        )]),
    ),
    two("min above max", "min-max", Text(&[("min=\"-5\" max=\"5\"", "min=\"5\" max=\"-5\"")])),
    two(
        "min above max in a type",
        "min-max",
        Text(&[("min=\"-100\" max=\"100\"", "min=\"100\" max=\"-100\"")]),
    ),
    two("negative nominal", "nominal", Text(&[("start=\"0\" nominal=\"1\"", "start=\"0\" nominal=\"-1\"")])),
    two(
        "nominal 0 in a type",
        "nominal",
        Text(&[("max=\"100\" nominal=\"1\"", "max=\"100\" nominal=\"0\"")]),
    ),
    two(
        "unit that is not declared",
        "unit-undeclared",
        Text(&[("causality=\"output\"><Real unit=\"m/s\"/>", "causality=\"output\"><Real unit=\"knot\"/>")]),
    ),
    two(
        "display unit that is not declared",
        "display-unit",
        Text(&[("displayUnit=\"mm\"", "displayUnit=\"inch\"")]),
    ),
    two("unit of factor 0", "refused", Text(&[("factor=\"1000\"", "factor=\"0\"")])),
    two("type that is not declared", "refused", Text(&[("declaredType=\"Place\"", "declaredType=\"Spot\"")])),
    two("type of another kind", "refused", Text(&[("declaredType=\"Place\"", "declaredType=\"Level\"")])),
    two(
        "start that is no item of the enumeration",
        "start-range",
        Text(&[("declaredType=\"Level\" start=\"1\"", "declaredType=\"Level\" start=\"3\"")]),
    ),
    two(
        "two items with one value",
        "duplicate-definition",
        Text(&[("name=\"high\" value=\"2\"", "name=\"high\" value=\"1\"")]),
    ),
    two("unit defined twice", "duplicate-definition", Text(&[("<Unit name=\"s\">", "<Unit name=\"m\">")])),
    two(
        "category defined twice",
        "duplicate-definition",
        Text(&[(
            "<Category name=\"logStatusError\"/>",
            "<Category name=\"logStatusError\"/><Category name=\"logStatusError\"/>",
        )]),
    ),
    two("comma in a number", "refused", Text(&[("start=\"0.5\"", "start=\"0,5\"")])),
    two(
        "derivative of a parameter",
        "derivative-of-non-state",
        Text(&[("derivative=\"4\"", "derivative=\"11\"")]),
    ),
    two(
        "derivative of an Integer",
        "derivative-of-non-state",
        Text(&[("derivative=\"4\"", "derivative=\"16\"")]),
    ),
    two(
        "derivative of a discrete variable",
        "derivative-of-non-state",
        Text(&[("derivative=\"4\"", "derivative=\"10\"")]),
    ),
    two("derivative of itself", "derivative-of-non-state", Text(&[("derivative=\"4\"", "derivative=\"6\"")])),
    two("derivative beyond the variables", "refused", Text(&[("derivative=\"4\"", "derivative=\"400\"")])),
    two(
        "discrete derivative",
        "derivative-variability",
        Text(&[(
            "name=\"der(x)\" valueReference=\"5\"",
            "name=\"der(x)\" valueReference=\"5\" variability=\"discrete\"",
        )]),
    ),
    two(
        "reinit of an output that is no state",
        "reinit",
        Text(&[("causality=\"output\"><Real/>", "causality=\"output\"><Real reinit=\"true\"/>")]),
    ),
    two(
        "reinit of a parameter",
        "reinit",
        Text(&[("<Real start=\"0.5\"/>", "<Real start=\"0.5\" reinit=\"true\"/>")]),
    ),
    two(
        "multiple set of an output",
        "multiple-set",
        Text(&[(
            "name=\"w\" valueReference=\"8\"",
            "name=\"w\" valueReference=\"8\" canHandleMultipleSetPerTimeInstant=\"true\"",
        )]),
    ),
    two(
        "output that is not listed",
        "structure-outputs",
        Text(&[("      <Unknown index=\"16\" dependencies=\"15\"/>\n", "")]),
    ),
    two(
        "list of outputs with a local",
        "structure-outputs",
        Text(&[("<Outputs>", "<Outputs><Unknown index=\"21\"/>")]),
    ),
    two(
        "output listed twice",
        "structure-duplicate",
        Text(&[("<Outputs>", "<Outputs><Unknown index=\"8\"/>")]),
    ),
    two(
        "derivative that is not listed",
        "structure-derivatives",
        Text(&[("      <Unknown index=\"6\" dependencies=\"5\" dependenciesKind=\"constant\"/>\n", "")]),
    ),
    two("list of derivatives in swapped order", "state-order", Bytes(swapped_derivatives)),
    two(
        "list of derivatives with an output",
        "structure-derivatives",
        Text(&[("<Derivatives>", "<Derivatives><Unknown index=\"8\"/>")]),
    ),
    two(
        "initial unknown that is not listed",
        "structure-initial-unknowns",
        Text(&[("      <Unknown index=\"14\" dependencies=\"11\"/>\n", "")]),
    ),
    two(
        "list of initial unknowns with a parameter",
        "structure-initial-unknowns",
        Text(&[("<InitialUnknowns>", "<InitialUnknowns><Unknown index=\"11\"/>")]),
    ),
    two("index beyond the variables", "refused", Text(&[("<Unknown index=\"9\"", "<Unknown index=\"90\"")])),
    two(
        "dependency beyond the variables",
        "refused",
        Text(&[("dependencies=\"2 4\"", "dependencies=\"2 400\"")]),
    ),
    two("dependency twice", "structure-duplicate", Text(&[("dependencies=\"2 4\"", "dependencies=\"4 4\"")])),
    two(
        "dependency on an output",
        "structure-knowns",
        Text(&[(
            "<Unknown index=\"10\" dependencies=\"3\"/>",
            "<Unknown index=\"10\" dependencies=\"3 8\"/>",
        )]),
    ),
    two(
        "fewer kinds than dependencies",
        "refused",
        Text(&[("dependenciesKind=\"constant constant\"", "dependenciesKind=\"constant\"")]),
    ),
    two(
        "unknown kind of dependency",
        "refused",
        Text(&[("dependenciesKind=\"constant constant\"", "dependenciesKind=\"constant linear\"")]),
    ),
    two(
        "kinds without dependencies",
        "refused",
        Text(&[("dependencies=\"2 4\" dependenciesKind", "dependenciesKind")]),
    ),
    two(
        "no dependency declared of an output on an input",
        "dependency-undeclared",
        Text(&[(
            "dependencies=\"2 4\" dependenciesKind=\"constant constant\"",
            "dependencies=\"4\" dependenciesKind=\"constant\"",
        )]),
    ),
    two(
        "no dependency declared of an Integer on an Integer",
        "dependency-undeclared",
        Text(&[("<Unknown index=\"16\" dependencies=\"15\"/>", "<Unknown index=\"16\" dependencies=\"\"/>")]),
    ),
    two(
        "no dependency declared of a Boolean on a Boolean",
        "dependency-undeclared",
        Text(&[("<Unknown index=\"20\" dependencies=\"19\"/>", "<Unknown index=\"20\" dependencies=\"\"/>")]),
    ),
    two(
        "no dependency declared of a discrete Real",
        "dependency-undeclared",
        Text(&[("<Unknown index=\"10\" dependencies=\"3\"/>", "<Unknown index=\"10\" dependencies=\"\"/>")]),
    ),
    two(
        "name against the structured convention",
        "naming-convention",
        Text(&[("name=\"w\"", "name=\"w (speed)\"")]),
    ),
    two("stopTime before startTime", "default-experiment", Text(&[("stopTime=\"2\"", "stopTime=\"-2\"")])),
    two("stepSize 0", "default-experiment", Text(&[("stepSize=\"0.01\"", "stepSize=\"0\"")])),
    two("negative tolerance", "default-experiment", Text(&[("tolerance=\"1e-6\"", "tolerance=\"-1e-6\"")])),
    two("serialization without state", "capabilities", Text(&[("canGetAndSetFMUstate=\"true\" ", "")])),
    two(
        "modelIdentifier of no library",
        "binary-missing",
        Text(&[("<CoSimulation modelIdentifier=\"m\"", "<CoSimulation modelIdentifier=\"n\"")]),
    ),
    two(
        "modelIdentifier that is no C name",
        "model-identifier",
        Text(&[("<CoSimulation modelIdentifier=\"m\"", "<CoSimulation modelIdentifier=\"m-1\"")]),
    ),
    two("no library", "binary-missing", NoLibrary),
    two("entry that leaves the archive", "refused", Files(&[("../outside.txt", "x")])),
    two(
        "source files that are not there",
        "source-missing",
        Text(&[(
            "providesDirectionalDerivative=\"true\"/>",
            "providesDirectionalDerivative=\"true\"><SourceFiles><File name=\"gone.c\"/></SourceFiles></ModelExchange>",
        )]),
    ),
    three(
        "FMI 3.0: elements out of order",
        "schema",
        Text(&[("<ModelStructure>", "<ModelStructure><InitialUnknown valueReference=\"14\"/>")]),
    ),
    three("FMI 3.0: unknown attribute", "schema", Text(&[("name=\"y\"", "name=\"y\" colour=\"red\"")])),
    three(
        "FMI 3.0: attribute of FMI 2.0",
        "schema",
        Text(&[("variableNamingConvention", "numberOfEventIndicators=\"1\" variableNamingConvention")]),
    ),
    three(
        "FMI 3.0: no independent variable",
        "independent",
        Text(&[(
            "    <Float64 name=\"time\" valueReference=\"0\" causality=\"independent\" variability=\"continuous\" unit=\"s\"/>\n",
            "",
        )]),
    ),
    three(
        "FMI 3.0: two variables with one value reference",
        "refused",
        Text(&[("valueReference=\"11\"", "valueReference=\"10\"")]),
    ),
    three(
        "FMI 3.0: negative nominal",
        "nominal",
        Text(&[("start=\"0\" nominal=\"1\"", "start=\"0\" nominal=\"-1\"")]),
    ),
    three(
        "FMI 3.0: derivative of a parameter",
        "derivative-of-non-state",
        Text(&[("derivative=\"3\"", "derivative=\"10\"")]),
    ),
    three(
        "FMI 3.0: reinit of an output that is no state",
        "reinit",
        Text(&[("name=\"y\" valueReference=\"7\"", "name=\"y\" valueReference=\"7\" reinit=\"true\"")]),
    ),
    three(
        "FMI 3.0: start above max",
        "start-range",
        Text(&[("start=\"0\" min=\"-10\" max=\"10\"", "start=\"11\" min=\"-10\" max=\"10\"")]),
    ),
    three(
        "FMI 3.0: output that is not listed",
        "structure-outputs",
        Text(&[("    <Output valueReference=\"21\" dependencies=\"20\"/>\n", "")]),
    ),
    three(
        "FMI 3.0: no dependency declared of an Integer",
        "dependency-undeclared",
        Text(&[(
            "<Output valueReference=\"21\" dependencies=\"20\"/>",
            "<Output valueReference=\"21\" dependencies=\"\"/>",
        )]),
    ),
    three(
        "FMI 3.0: more start values than elements",
        "start-count",
        Text(&[("variability=\"discrete\" start=\"0\"/>", "variability=\"discrete\" start=\"0 0\"/>")]),
    ),
    three(
        "FMI 3.0: fewer start values than elements",
        "start-count",
        Text(&[(
            "    <Float64 name=\"indicator\"",
            "    <Float64 name=\"more\" valueReference=\"90\" causality=\"parameter\" variability=\"fixed\" start=\"1 2\"><Dimension start=\"3\"/></Float64>\n    <Float64 name=\"indicator\"",
        )]),
    ),
    three(
        "FMI 3.0: a length that is its own",
        "dimension",
        Text(&[(
            "    <Float64 name=\"indicator\"",
            "    <UInt64 name=\"n\" valueReference=\"90\" causality=\"structuralParameter\" variability=\"fixed\" start=\"1\"><Dimension valueReference=\"90\"/></UInt64>\n    <Float64 name=\"indicator\"",
        )]),
    ),
    three(
        "FMI 3.0: more bytes than maxSize",
        "max-size",
        Text(&[(
            "    <Float64 name=\"indicator\"",
            "    <Binary name=\"bytes\" valueReference=\"90\" causality=\"parameter\" variability=\"fixed\" maxSize=\"2\"><Start value=\"010203\"/></Binary>\n    <Float64 name=\"indicator\"",
        )]),
    ),
    three("FMI 3.0: UTF-16 instead of UTF-8", "refused", Bytes(utf_16)),
];

fn moved(text: &str, from: &str, to: &str, before: &str) -> Vec<u8> {
    let (start, end) = (text.find(from).unwrap(), text.find(to).unwrap() + to.len());
    let (element, mut rest) = (text[start..end].to_owned(), format!("{}{}", &text[..start], &text[end..]));
    let at = rest.find(before).unwrap();
    rest.insert_str(at, &element);
    rest.into_bytes()
}

fn structure_first(text: &str) -> Vec<u8> {
    moved(text, "<ModelStructure>", "</ModelStructure>", "<ModelVariables>")
}

fn units_last(text: &str) -> Vec<u8> {
    moved(text, "<UnitDefinitions>", "</UnitDefinitions>", "<LogCategories>")
}

fn no_interface(text: &str) -> Vec<u8> {
    let (start, end) = (text.find("<ModelExchange").unwrap(), text.find("<UnitDefinitions>").unwrap());
    format!("{}{}", &text[..start], &text[end..]).into_bytes()
}

fn swapped_derivatives(text: &str) -> Vec<u8> {
    let first = "<Unknown index=\"6\" dependencies=\"5\" dependenciesKind=\"constant\"/>";
    moved(text, first, first, "</Derivatives>")
}
