//! Mistakes in the columns of records, undone one at a time to see whether the declared model follows then: another
//! sign or unit, another zero, two columns exchanged.

use super::model::Study;
use super::read::Record;
use super::rescaled::{self, Place, columns, groups, multiply};

/// Zeros that are mistaken for one another, by the unit of the signal: ice and absolute zero, vacuum and the air
/// around; words for a column that begins above that of the model, and below.
const ZEROS: [(&str, f64, [&str; 2]); 4] = [
    ("K", 273.15, ["degC in place of K", "273.15 K added twice"]),
    ("degC", 273.15, ["273.15 K taken off twice", "K in place of degC"]),
    ("Pa", 101_325.0, ["gauge in place of absolute pressure", "absolute in place of gauge pressure"]),
    ("bar", 1.013_25, ["gauge in place of absolute pressure", "absolute in place of gauge pressure"]),
];
/// Outputs up to which columns are exchanged in pairs.
const MAX_EXCHANGED_OUTPUTS: usize = 6;

/// Step \[s\] from which on times may be in milliseconds.
pub const MIN_STEP_OF_MILLISECONDS: f64 = 0.5;

/// A mistake in the columns of a record.
#[derive(Debug, Clone, PartialEq)]
pub enum Mistake {
    /// Signals that need a factor.
    Factor(Vec<Place>, f64),
    /// Signals that need an addend \[unit of the signal\].
    Zero(Vec<Place>, f64),
    /// Columns of two outputs, each in the place of the other, and those of the two states that they show.
    Exchange {
        /// Outputs.
        outputs: [usize; 2],
        /// States, where both columns show one.
        states: Option<[usize; 2]>,
    },
    /// Times in milliseconds that were taken for seconds.
    Milliseconds,
}

impl Mistake {
    /// Undoes the mistake in records.
    pub fn undo(&self, records: &mut [Record]) {
        match self {
            Mistake::Milliseconds => records.iter_mut().for_each(|record| record.step *= 1e-3),
            Mistake::Factor(places, factor) => multiply(records, places, *factor),
            Mistake::Zero(places, by) => {
                for record in records {
                    for place in places {
                        values(record, *place).into_iter().flatten().for_each(|value| *value += by);
                    }
                }
            }
            Mistake::Exchange { outputs, states } => {
                for record in records {
                    record.outputs.swap(outputs[0], outputs[1]);
                    states.iter().for_each(|states| record.states.swap(states[0], states[1]));
                }
            }
        }
    }

    /// Words for the mistake.
    pub fn words(&self, study: &Study) -> String {
        let named = |places: &[Place]| columns(study, places);
        match self {
            Mistake::Milliseconds => {
                let step = study.records.first().map_or(0.0, |record| record.step);
                format!("the times of the records, samples {step} s apart, are in milliseconds")
            }
            Mistake::Factor(places, factor) => rescaled::cause(&named(places), *factor),
            Mistake::Zero(places, by) => {
                let unit = places.first().and_then(|place| unit(study, *place)).unwrap_or_default();
                let names: Vec<String> = named(places).iter().map(|name| format!("`{name}`")).collect();
                let (many, are) = if names.len() > 1 { ("s", "are") } else { ("", "is") };
                let known = ZEROS.iter().find(|(name, ..)| *name == unit);
                let cause = known.map_or("", |(.., words)| words[usize::from(*by < 0.0)]);
                let side = if *by > 0.0 { "small" } else { "large" };
                format!("column{many} {} {are} {} {unit} too {side} ({cause})", names.join(" and "), by.abs())
            }
            Mistake::Exchange { outputs, .. } => {
                let [one, other] = outputs.map(|output| &study.outputs[output].name);
                format!("columns `{one}` and `{other}` are exchanged")
            }
        }
    }
}

/// Remedy for a mistake.
pub fn remedy(mistake: &Mistake) -> &'static str {
    match mistake {
        Mistake::Factor(..) | Mistake::Zero(..) => {
            "Another unit? A column says it behind its name, as in `x [mm]`, or `unit`, `scale` or `offset` where it is declared; else correct the model"
        }
        Mistake::Milliseconds => {
            "A column says its unit behind its name, as in `time [ms]`; else correct the model"
        }
        Mistake::Exchange { .. } => "Name each column at its own output and state; else correct the model",
    }
}

/// Words for mistakes that may each be the one.
pub fn causes<'a>(study: &Study, mistakes: impl Iterator<Item = &'a Mistake>) -> String {
    let mut found: Vec<String> = Vec::new();
    for mistake in mistakes {
        let own = mistake.words(study);
        if !found.contains(&own) {
            found.push(own);
        }
    }
    found.join(", or ")
}

/// Other units of one signal or column after the other, as `factors` gives them for signals that drive the system or
/// are measured; other zeros; exchanged columns.
pub fn mistakes(study: &Study, factors: &dyn Fn(bool) -> Vec<f64>) -> Vec<Mistake> {
    let mut found = Vec::new();
    for places in groups(study) {
        let drives = places.iter().any(|place| place.0 == 0);
        found.extend(factors(drives).into_iter().map(|factor| Mistake::Factor(places.clone(), factor)));
    }
    for (name, zero, _) in ZEROS {
        let measured = groups(study).into_iter().flatten().filter(|place| place.0 == 1 || place.0 == 3);
        let mut places: Vec<Place> =
            measured.filter(|place| unit(study, *place).as_deref() == Some(name)).collect();
        places.sort_unstable();
        places.dedup();
        let outputs: Vec<Place> = places.iter().copied().filter(|place| place.0 == 3).collect();
        // All sensors of a kind, or one of them with the state that its column shows.
        let mut together = vec![places.clone()];
        if outputs.len() > 1 {
            for output in outputs {
                let own = columns(study, &[output]);
                together.push(places.iter().copied().filter(|at| columns(study, &[*at]) == own).collect());
            }
        }
        together.retain(|places| !places.is_empty());
        found.extend(
            together.into_iter().flat_map(|own| [zero, -zero].map(|by| Mistake::Zero(own.clone(), by))),
        );
    }
    let count = study.outputs.len();
    if count <= MAX_EXCHANGED_OUTPUTS {
        for one in 0..count {
            found.extend((one + 1..count).filter_map(|other| exchanged(study, one, other)));
        }
    }
    found
}

/// The columns of two outputs in the place of each other; none where they share a column.
fn exchanged(study: &Study, one: usize, other: usize) -> Option<Mistake> {
    let [a, b] = [one, other].map(|output| &study.outputs[output].name);
    let state = |column: &String| {
        let signals = &study.sensors.signals[1];
        signals.iter().position(|own| own.as_ref().is_some_and(|own| own.column.as_ref() == Some(column)))
    };
    let states = state(a).zip(state(b)).map(|(a, b)| [a, b]);
    (a != b).then_some(Mistake::Exchange { outputs: [one, other], states })
}

/// Unit of a state or an output.
fn unit(study: &Study, (list, index): Place) -> Option<String> {
    match list {
        3 => Some(study.outputs[index].unit.clone()),
        1 => {
            let name = &study.sensors.signals[1][index].as_ref()?.column;
            let own = study.outputs.iter().find(|output| Some(&output.name) == name.as_ref());
            own.map(|output| output.unit.clone())
        }
        _ => None,
    }
}

/// Values of a state or an output of a record.
fn values(record: &mut Record, (list, index): Place) -> Option<&mut Vec<f64>> {
    match list {
        1 => record.states[index].as_mut(),
        3 => Some(&mut record.outputs[index]),
        _ => None,
    }
}
