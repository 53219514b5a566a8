//! Reading of problem files, and messages about wrong ones.

use super::phase::{Duration, Of, Where};
use super::{Place, Quantity, Source, Statement, TRANSCRIPTIONS, parse};
use airloop_ocp::transcription::Transcription;

fn statement(text: &str) -> Result<Statement, crate::Error> {
    parse(Source { file: "folder/problem.toml".into(), text: text.into() })
}

/// The message for a text.
fn wrong(text: &str) -> String {
    statement(text).expect_err(text).to_string()
}

const SMALLEST: &str = "system = \"s.ssd\"\nduration = \"2 s\"\n";

#[test]
fn the_smallest_problem_has_defaults_for_all_else() {
    let found = statement(SMALLEST).unwrap();
    assert_eq!(found.name, "problem");
    assert_eq!(found.system_file, std::path::Path::new("folder/s.ssd"));
    assert_eq!(found.settings.transcription, Transcription::HermiteSimpson);
    let time = Quantity { value: 2.0, unit: Some("s".into()), place: Place(28) };
    assert_eq!(found.phases.len(), 1);
    assert_eq!(found.phases[0].duration, Duration::Quantity(time));
}

#[test]
fn conditions_bounds_rates_and_costs_keep_their_words() {
    let more = "[initial]\nx = \"free\"\ny = { min = -1 }\n[bounds]\nx = { min = \"-1 cm\", max = 2, name = \"stroke\", \
                at = \"everywhere\", during = [0.2, 1] }\n[rates]\nu = \"500 N/s\"\n[[cost]]\nintegral = \"u\"\nweight = 3\n\
                [[cost]]\nduration = 0.5\n[[constraint]]\nterms = { x = 1, y = -2.5 }\nmax = 1\n";
    let found = statement(&format!("{SMALLEST}{more}")).unwrap();
    let phase = &found.phases[0];
    let ranges: Vec<_> = phase.initial.iter().map(|(_, condition)| condition.range()).collect();
    assert!(ranges[0].min.is_none() && ranges[0].max.is_none());
    assert_eq!(ranges[1].min.as_ref().unwrap().value, -1.0);
    let bounds: Vec<_> = phase.limits().collect();
    let bound = bounds[0];
    assert_eq!(
        (bound.name.as_deref(), bound.at, bound.during),
        (Some("stroke"), Some(Where::Everywhere), [0.2, 1.0])
    );
    assert_eq!(bound.min.as_ref().unwrap().unit.as_deref(), Some("cm"));
    assert_eq!(
        bounds[1].terms.iter().map(|(name, factor)| (name.text.as_str(), *factor)).collect::<Vec<_>>(),
        [("x", 1.0), ("y", -2.5)]
    );
    let rate = phase.rates[0].1.range();
    assert_eq!((rate.min.as_ref().unwrap().value, rate.max.as_ref().unwrap().value), (-500.0, 500.0));
    assert!(matches!(phase.costs[0].of, Of::Integral(..)) && phase.costs[0].weight == 3.0);
    assert!(matches!(phase.costs[1].of, Of::Duration) && phase.costs[1].weight == 0.5);
}

#[test]
fn phases_have_their_own_keys() {
    let text = "system = \"s.ssd\"\n[[phase]]\nname = \"stance\"\nduration = { min = 0.5, max = 1.5, guess = 1 }\n\
                intervals = 30\nparameters = { \"walker.mode\" = 2 }\n[phase.final]\nx = 0\n[[phase]]\nduration = \"200 ms\"\n";
    let found = statement(text).unwrap();
    assert_eq!(
        found.phases.iter().map(|phase| phase.name.as_str()).collect::<Vec<_>>(),
        ["stance", "phase 2"]
    );
    assert_eq!(found.phases[0].intervals, Some(30));
    assert_eq!(found.phases[0].parameters[0].1.to_string(), "2");
    assert!(matches!(found.phases[0].duration, Duration::Table(_)));
    assert_eq!(found.phases[0].terminal[0].0.text, "x");
}

#[test]
fn what_is_wrong_is_named_with_line_column_and_remedy() {
    let cases: &[(&str, &str, &str)] = &[
        ("duration = 2\n", "line 1, column 1", "has no `system`"),
        ("system = \"s.ssd\"\n", "line 1, column 1", "has no `duration`"),
        ("system = 3\nduration = 2\n", "line 1, column 10", "a text in quotes is wanted"),
        ("system = \"s\"\nduration = \"2 s\"\n[setings]\n", "line 3, column 2", "did you mean `settings`?"),
        ("system = \"s\"\nduration = \"two\"\n", "line 2, column 12", "does not begin with a number"),
        ("system = \"s\"\nduration = 2\n[settings]\nintervals = 0\n", "line 4, column 13", "at least 1"),
        ("system = \"s\"\nduration = 2\n[settings]\nintervals = -5\n", "line 4, column 13", "`-5`"),
        ("system = \"s\"\nduration = 2\n[settings]\nintervals = 2.5\n", "line 4, column 13", "`2.5`"),
        (
            "system = \"s\"\nduration = 2\n[settings]\ntranscription = \"hs\"\n",
            "line 4, column 17",
            "hermite-simpson",
        ),
        ("system = \"s\"\nduration = 2\n[settings]\ntolerance = 2\n", "line 4, column 13", "between 0 and 1"),
        ("system = \"s\"\nduration = 2\n[bounds]\nx = {}\n", "line 4, column 5", "`min`, `max` or both"),
        (
            "system = \"s\"\nduration = 2\n[bounds]\nx = { mim = 1, max = 2 }\n",
            "line 4, column 7",
            "did you mean `min`",
        ),
        ("system = \"s\"\nduration = 2\n[[cost]]\nweight = 1\n", "line 3, column 1", "a cost is one of"),
        (
            "system = \"s\"\nduration = 2\n[[cost]]\nintegral = \"u\"\nweight = -1\n",
            "line 3, column 1",
            "negative",
        ),
        (
            "system = \"s\"\nduration = 2\n[guess.a]\nx = { t = [0, 1], value = [1] }\n",
            "line 4, column 27",
            "as many",
        ),
        (
            "system = \"s\"\nduration = 2\n[guess.a]\nx = { t = [0, 0], value = [1, 2] }\n",
            "line 4, column 11",
            "increase",
        ),
        (
            "system = \"s\"\nduration = 2\n[guess.a]\nx = { t = [0, 2], value = [1, 2] }\n",
            "line 4, column 11",
            "0 to 1",
        ),
        ("system = \"s\"\nduration = 2\n[guess.linear]\n", "line 3", "built in"),
        ("system = \"s\"\nduration = 2\nx = [1,\n", "line 3", ""),
    ];
    for (text, place, words) in cases {
        let message = wrong(text);
        assert!(message.starts_with("folder/problem.toml: "), "{message}");
        assert!(message.contains(place) && message.contains(words), "{text}\n{message}");
    }
}

#[test]
fn numbers_are_finite_and_keys_of_a_phase_stand_in_one() {
    let message = wrong(&format!("{SMALLEST}[[cost]]\nduration = inf\n"));
    assert!(message.contains("line 4, column 12: `inf` is not a finite number"), "{message}");
    let message = wrong("system = \"s.ssd\"\nduration = 2\n[[phase]]\nduration = 1\n");
    assert!(message.contains("line 2, column 1: `duration` belongs to a phase"), "{message}");
    let message = wrong(&format!("{SMALLEST}[bounds]\nx = {{ terms = {{ y = 1 }}, max = 1 }}\n"));
    assert!(message.contains("belongs to [[constraint]]"), "{message}");
}

#[test]
fn messages_name_the_table_the_value_and_what_is_wanted() {
    let cases = [
        (
            "[verification]\nrun = 3\n",
            "line 4, column 7: `verification.run`: this is the whole number `3`; true or false is wanted",
        ),
        (
            "[bounds]\nx = { max = 1, during = [1, 0] }\n",
            "line 4, column 25: `bounds.x.during`: wanted is [from, to] as parts of the phase, 0 <= from <= to <= 1",
        ),
        (
            "[settings]\nmehtod = 3\n",
            "line 4, column 1: [settings] has no key `mehtod`; did you mean `method`?",
        ),
        ("[settings.mesh]\nrounds = 3\n", "line 3, column 1: [settings.mesh] has no `tolerance`; add it"),
        (
            "[guess.a]\nothers = \"one\"\n",
            "line 4, column 10: `guess.a.others`: `one` is none of zero, linear",
        ),
        (
            "[guess.a]\nx = { t = [0, true], value = [1, 2] }\n",
            "line 4, column 15: `guess.a.x.t`: this is `true`; a number is wanted",
        ),
        (
            "[initial]\nx = [1]\n",
            "line 4, column 5: `initial.x`: this is a list; a number, or a text such as \"150 mm\" is wanted",
        ),
        (
            "[initial]\nx = { mim = 1 }\n",
            "line 4, column 7: [initial.x] has no key `mim`; did you mean `min`",
        ),
        (
            "[settings]\nsample_time = { min = 1 }\n",
            "line 4, column 15: `settings.sample_time`: this is a table; a number, or a text such as",
        ),
        ("[rates]\nu = -1\n", "line 4, column 5: one number limits the rate both ways"),
        (
            "inputs = [\"a\", 3]\n",
            "line 3, column 16: `inputs`: this is the whole number `3`; a text in quotes is wanted",
        ),
    ];
    for (more, words) in cases {
        let message = wrong(&format!("{SMALLEST}{more}"));
        assert!(message.contains(words), "{more}\n{message}");
    }
}

#[test]
fn the_problems_of_the_examples_are_read() {
    let examples = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    for (name, phases) in [
        ("03_swing_up/problem.toml", 1),
        ("04_half_step/problem.toml", 3),
        ("04_half_step/joint.toml", 3),
        ("04_half_step/variant_a.toml", 3),
    ] {
        let found = super::read(&examples.join(name)).unwrap();
        assert_eq!(found.phases.len(), phases, "{name}");
    }
    for name in ["03_swing_up/stabilize.toml", "04_half_step/stabilize.toml"] {
        crate::stabilize::settings::read(&examples.join(name)).unwrap();
    }
}

#[test]
fn the_schema_has_the_keys_with_descriptions_and_no_null() {
    let schema: serde_json::Value = serde_json::from_str(&super::schema()).unwrap();
    let properties = &schema["properties"];
    for key in ["system", "duration", "phase", "final", "settings", "guess", "stick_figure", "constraint"] {
        assert!(properties[key]["description"].is_string(), "{key}: {}", properties[key]);
    }
    assert!(!super::schema().contains("null"));
    assert!(properties["source"].is_null() && schema["additionalProperties"] == false);
    let definitions = &schema["definitions"];
    let names = definitions["Settings"]["properties"]["transcription"]["enum"].as_array().unwrap();
    assert!(names.iter().eq(TRANSCRIPTIONS.map(|(name, _)| name).iter()), "{names:?}");
    assert_eq!(definitions["Settings"]["properties"]["start_with"]["items"]["$ref"], "#/definitions/Pass");
    assert_eq!(properties["constraint"]["items"]["allOf"][1]["required"][0], "terms");
    assert_eq!(properties["bounds"]["additionalProperties"]["allOf"][1]["properties"]["terms"], false);
    assert_eq!(definitions["CostKeys"]["oneOf"].as_array().unwrap().len(), 3);
}

#[test]
fn a_phase_may_begin_with_a_reset() {
    let text = "system = \"s.ssd\"\n[[phase]]\nduration = 1\n[[phase]]\nduration = 1\n[phase.reset]\nparameters = { map = 4 }\n\
                states = { v = \"after.v\" }\n[phase.reset.bounds]\nL = { min = 0 }\n";
    let found = statement(text).unwrap();
    assert!(found.phases[0].reset.is_none());
    let reset = found.phases[1].reset.as_ref().unwrap();
    assert_eq!((reset.states[0].0.text.as_str(), reset.states[0].1.text.as_str()), ("v", "after.v"));
    assert_eq!((reset.parameters[0].1.to_string(), reset.limits().count()), ("4".into(), 1));
    let message =
        wrong("system = \"s.ssd\"\n[[phase]]\nduration = 1\n[phase.reset]\nparameters = { map = 4 }\n");
    assert!(message.contains("states"), "{message}");
}

#[test]
fn forces_of_actuators_and_the_plant_behind_them_are_named() {
    let text = format!(
        "{SMALLEST}[variants]\nA = \"a.toml\"\n[feed_forward]\nactuator = \"toe.ssd\"\ncommand = \"u\"\noutput = \"F\"\n\
         sample_time = \"1 ms\"\nlargest = \"500 N\"\n[feed_forward.forces]\ntoe = {{ variable = \"F1\", factor = 0.5 }}\n\
         [feed_forward.plant]\nsystem = \"w.fmu\"\ninputs = {{ F1 = {{ force = \"toe\", factor = 2 }}, tau = {{ variable = \
         \"tau\" }} }}\nstates = {{ x = \"x\" }}\n"
    );
    let found = statement(&text).unwrap();
    assert_eq!(super::variant(&found, "A").unwrap(), std::path::Path::new("folder/a.toml"));
    assert!(super::variant(&found, "C").unwrap_err().to_string().contains("it has: A"));
    let section = found.feed_forward.as_ref().unwrap();
    assert_eq!((section.smoothness, section.forces[0].1.factor), (1e-2, 0.5));
    let inputs = &section.plant.as_ref().unwrap().inputs;
    assert!(
        matches!(&inputs[0].1, super::feed_forward::Drive::Force(name, factor) if name.text == "toe" && *factor == 2.0)
    );
    assert!(matches!(&inputs[1].1, super::feed_forward::Drive::Planned(planned) if planned.factor == 1.0));
    let message = wrong(&text.replace("smoothness = 1", "").replace("largest", "largets"));
    assert!(message.contains("largest"), "{message}");
}

#[test]
fn bounds_have_margins_between_the_points_of_the_mesh() {
    let text = format!("{SMALLEST}[bounds]\nx = {{ min = 0, margin = 0.01 }}\ny = {{ max = 1 }}\n");
    let found = statement(&text).unwrap();
    assert_eq!(found.phases[0].limits().map(|bound| bound.margin).collect::<Vec<_>>(), [0.01, 0.0]);
    let message = wrong(&text.replace("0.01", "-0.01"));
    assert!(message.contains("margin"), "{message}");
}

#[test]
fn forces_to_be_recomputed_come_with_coordinates_and_drives() {
    let text = format!(
        "{SMALLEST}[verification.balance]\nenergy = \"E\"\ncoordinates = {{ x = \"v\" }}\ndrives = {{ u = {{ x = 2 }} \
         }}\nforces = {{ f = \"p\" }}\n"
    );
    let found = statement(&text).unwrap().verification.balance.unwrap();
    assert_eq!((found.coordinates[0].1.text.as_str(), found.drives[0].1[0].1), ("v", 2.0));
    assert_eq!(found.forces[0].1.text, "p");
    let message = wrong(&text.replace("energy = \"E\"\n", ""));
    assert!(message.contains("energy"), "{message}");
}
