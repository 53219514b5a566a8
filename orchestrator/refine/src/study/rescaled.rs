//! Signals of records taken with another factor, to see whether a column has another sign or another unit.

use super::model::Study;
use super::read::Record;

/// A signal: its list (inputs, states, further signals, outputs) and its place there.
pub type Place = (usize, usize);

/// Ratios between units that are mistaken for one another: milli, centi, degree, minute, bar, mega.
pub const UNITS: [f64; 6] = [1e3, 1e2, 180.0 / std::f64::consts::PI, 60.0, 1e5, 1e6];
/// Ratio of the errors with another unit or sign and as it is up to which records are told to have it.
pub const MAX_RATIO_OF_MENDED: f64 = 0.3;
/// Ratio of errors up to which two columns may equally be the one.
pub const MAX_RATIO_OF_EQUALS: f64 = 1.05;

/// Signals that change together: all of a column, or one alone where a column makes several.
pub fn by_column(study: &Study) -> Vec<Vec<Place>> {
    let mut columns: Vec<(&String, Vec<Place>)> = Vec::new();
    for (list, signals) in study.sensors.signals.iter().enumerate() {
        for (index, signal) in signals.iter().enumerate() {
            let Some(column) = signal.as_ref().and_then(|signal| signal.source()) else { continue };
            match columns.iter_mut().find(|(own, _)| *own == column) {
                Some((_, places)) => places.push((list, index)),
                None => columns.push((column, vec![(list, index)])),
            }
        }
    }
    let alone = |places: &[Place]| if places.len() > 1 { places.to_vec() } else { Vec::new() };
    let one = |places: Vec<Place>| {
        let single = alone(&places).into_iter().map(|place| vec![place]);
        single.chain([places]).collect::<Vec<_>>()
    };
    columns.into_iter().flat_map(|(_, places)| one(places)).collect()
}

/// Names of the columns that signals come from, each once.
pub fn columns(study: &Study, places: &[Place]) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    for &(list, index) in places {
        let column = study.sensors.signals[list][index].as_ref().and_then(|signal| signal.source());
        found.extend(column.filter(|column| !found.contains(column)).cloned());
    }
    found
}

/// Multiplies signals of records by a factor.
pub fn multiply(records: &mut [Record], places: &[Place], factor: f64) {
    let times = |values: &mut Vec<f64>| values.iter_mut().for_each(|value| *value *= factor);
    for record in records {
        for &(list, index) in places {
            match list {
                0 => {
                    record.inputs[index].iter_mut().for_each(times);
                    record.past[index].iter_mut().for_each(times);
                }
                1 => record.states[index].iter_mut().for_each(times),
                2 => times(&mut record.extra[index]),
                _ => times(&mut record.outputs[index]),
            }
        }
    }
}

/// The sign, and units in either direction.
pub fn factors() -> impl Iterator<Item = f64> {
    [-1.0].into_iter().chain(UNITS.into_iter().flat_map(|unit| [unit, 1.0 / unit]))
}

/// Signals that may be wrong together: those of a column, or all that is measured of states and outputs.
pub fn groups(study: &Study) -> Vec<Vec<Place>> {
    let mut found = by_column(study);
    let measured = found.iter().flatten().filter(|place| place.0 == 1 || place.0 == 3);
    let mut measured: Vec<Place> = measured.copied().collect();
    measured.sort_unstable();
    measured.dedup();
    let known = |own: &Vec<Place>| {
        let mut own = own.clone();
        own.sort_unstable();
        own == measured
    };
    if !measured.is_empty() && !found.iter().any(known) {
        found.push(measured);
    }
    found
}

/// Words for the fault of columns that are right with a factor: sign or size.
pub fn cause(columns: &[String], factor: f64) -> String {
    let names: Vec<String> = columns.iter().map(|name| format!("`{name}`")).collect();
    let (many, are, have) = if names.len() > 1 { ("s", "are", "have") } else { ("", "is", "has") };
    let times =
        |factor: f64| if factor.fract() < 1e-6 { format!("{factor:.0}") } else { format!("{factor:.1}") };
    let what = match factor {
        sign if sign < 0.0 => format!("{have} the other sign"),
        unit if unit < 1.0 => format!("{are} {} times too large", times(1.0 / unit)),
        unit => format!("{are} {} times too small", times(unit)),
    };
    format!("column{many} {} {what}", names.join(" and "))
}
