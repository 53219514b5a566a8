//! Reading of problem files, and messages about wrong ones.

use super::statement::{Duration, Of, Where};
use super::{Place, Quantity, SCHEMA, Source, Statement, TRANSCRIPTIONS, parse};
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
    let time = Quantity { value: 2.0, unit: Some("s".into()), place: Place { line: 2, column: 12 } };
    assert_eq!(found.phases.len(), 1);
    assert_eq!(found.phases[0].duration, Duration::Fixed(time));
}

#[test]
fn conditions_bounds_rates_and_costs_keep_their_words() {
    let more = "[initial]\nx = \"free\"\ny = { min = -1 }\n[bounds]\nx = { min = \"-1 cm\", max = 2, name = \"stroke\", \
                at = \"everywhere\", during = [0.2, 1] }\n[rates]\nu = \"500 N/s\"\n[[cost]]\nintegral = \"u\"\nweight = 3\n\
                [[cost]]\nduration = 0.5\n[[constraint]]\nterms = { x = 1, y = -2.5 }\nmax = 1\n";
    let found = statement(&format!("{SMALLEST}{more}")).unwrap();
    let phase = &found.phases[0];
    assert!(phase.initial[0].range.min.is_none() && phase.initial[0].range.max.is_none());
    assert_eq!(phase.initial[1].range.min.as_ref().unwrap().value, -1.0);
    let bound = &phase.bounds[0];
    assert_eq!(
        (bound.name.as_deref(), bound.at, bound.during),
        (Some("stroke"), Some(Where::Everywhere), (0.2, 1.0))
    );
    assert_eq!(bound.range.min.as_ref().unwrap().unit.as_deref(), Some("cm"));
    assert_eq!(
        phase.bounds[1].terms.iter().map(|(name, factor)| (name.text.as_str(), *factor)).collect::<Vec<_>>(),
        [("x", 1.0), ("y", -2.5)]
    );
    let rate = &phase.rates[0].range;
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
    assert_eq!(found.phases[0].parameters[0].1, "2");
    assert!(matches!(found.phases[0].duration, Duration::Free { .. }));
    assert_eq!(found.phases[0].terminal[0].variable.text, "x");
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

/// Objects of the schema below the keys that lead to them.
fn properties<'a>(schema: &'a serde_json::Value, path: &[&str]) -> Vec<&'a str> {
    let at = path.iter().fold(schema, |at, key| &at[*key]);
    at.as_object().unwrap().keys().map(String::as_str).collect()
}

#[test]
fn the_schema_has_the_keys_that_are_read() {
    let schema: serde_json::Value = serde_json::from_str(SCHEMA).unwrap();
    // A key of the schema that the reader does not know would be refused with these words.
    let probes: [(&[&str], &str); 5] = [
        (&["properties", "stick_figure", "properties"], "[stick_figure]\n{KEY}"),
        (&["properties"], "{KEY}"),
        (&["properties", "settings", "properties"], "[settings]\n{KEY}"),
        (&["properties", "verification", "properties"], "[verification]\n{KEY}"),
        (&["properties", "animation", "properties"], "[animation]\ncart=\"x\"\nangle=\"a\"\nlength=1\n{KEY}"),
    ];
    for (path, text) in probes {
        for key in properties(&schema, path) {
            let message = wrong(&format!(
                "system = \"s\"\nduration = 2\n{}",
                text.replace("{KEY}", &format!("{key} = 1979-05-27"))
            ));
            assert!(!message.contains("has no key"), "{key}: {message}");
        }
    }
    let names: Vec<&str> = schema["definitions"]["transcription"]["enum"]
        .as_array()
        .unwrap()
        .iter()
        .map(|name| name.as_str().unwrap())
        .collect();
    assert_eq!(names, TRANSCRIPTIONS.map(|(name, _)| name));
}

#[test]
fn a_phase_may_begin_with_a_reset() {
    let text = "system = \"s.ssd\"\n[[phase]]\nduration = 1\n[[phase]]\nduration = 1\n[phase.reset]\nparameters = { map = 4 }\n\
                states = { v = \"after.v\" }\n[phase.reset.bounds]\nL = { min = 0 }\n";
    let found = statement(text).unwrap();
    assert!(found.phases[0].reset.is_none());
    let reset = found.phases[1].reset.as_ref().unwrap();
    assert_eq!((reset.states[0].0.text.as_str(), reset.states[0].1.text.as_str()), ("v", "after.v"));
    assert_eq!((reset.parameters[0].1.as_str(), reset.bounds.len()), ("4", 1));
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
    assert_eq!(found.phases[0].bounds.iter().map(|bound| bound.margin).collect::<Vec<_>>(), [0.01, 0.0]);
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
