//! Candidates of the sensors: what the column of an output may show beside the output.

use super::catalog::{Candidate, entries};
use super::declaration::{Initial, InitialWord};
use super::model::{Action, Sensor, Study};
use super::read::Record;
use super::resolution;

/// Why a wrong sensor is not looked for.
pub(crate) const NOT_TOLD: &str = "a wrong sensor cannot be told from other parameters and initial states: these come from its column or are fitted without a measured input that drives the system, or outputs follow inputs at once and no other output shows the difference";

/// Whether a wrong sensor of an output can be distinguished from other initial states and parameters.
pub(crate) fn told(study: &Study, output: usize) -> bool {
    let driven = study.records.iter().any(|record| record.inputs.iter().any(Option::is_some));
    let beside = study.outputs.len() > 1;
    if study.records.iter().all(|record| record.states.is_empty()) {
        return driven && beside;
    }
    let column = Some(&study.outputs[output].name);
    let begins = study.sensors.signals[1].iter().flatten().any(|signal| signal.source() == column);
    let of = |record: &Record| match &record.initial {
        Initial::Given(_) => true,
        Initial::Word(InitialWord::Measured) => !begins,
        Initial::Word(InitialWord::Fit) => false,
    };
    if study.windows.is_some() { !begins } else { driven || study.records.iter().all(of) }
}

/// Adds the candidates of all sensors, and says of which a wrong one would not show.
pub(super) fn fill(study: &mut Study) {
    let open: Vec<usize> = (0..study.outputs.len()).filter(|&output| !told(study, output)).collect();
    let names: Vec<String> = if open.len() == study.outputs.len() {
        vec!["sensor".into()]
    } else {
        open.iter().map(|&output| format!("sensor({})", study.outputs[output].name)).collect()
    };
    study.not_testable.extend(names.into_iter().map(|name| (name, NOT_TOLD.to_owned())));
    if study.windows.is_some() && !open.is_empty() {
        let columns: Vec<String> = open.iter().map(|&o| format!("`{}`", study.outputs[o].name)).collect();
        study.notes.push(format!(
            "Windows start from {}: a wrong gain, offset or delay of such a sensor is not looked for, and an effect may stand for it. It would show without windows, or where the states have columns of their own.",
            columns.join(", ")
        ));
    }
    let step = study.records.first().map_or(1e-3, |record| record.step);
    let all = (f64::NEG_INFINITY, f64::INFINITY);
    for output in (0..study.outputs.len()).filter(|output| !open.contains(output)) {
        let (name, unit) = (study.outputs[output].name.clone(), study.outputs[output].unit.clone());
        let (per_second, per_unit) = (format!("{unit}/s"), format!("1/({unit})"));
        // These are asked for where the ports were found, not where channels of the rig are stated.
        let found = study.taps.iter().all(|tap| !tap.stated);
        let kinds = [
            (
                "sensor.lag",
                Sensor::Lag,
                ("tau", "s"),
                vec![vec![3.0 * step], vec![15.0 * step]],
                (0.0, 500.0 * step),
            ),
            ("sensor.drift", Sensor::Drift, ("slope", per_second.as_str()), vec![vec![0.0]], all),
            ("sensor.nonlinearity", Sensor::Nonlinearity, ("coef", per_unit.as_str()), vec![vec![0.0]], all),
            ("sensor.offset", Sensor::Offset, ("value", unit.as_str()), vec![vec![0.0]], all),
            ("sensor.gain", Sensor::Gain, ("gain", "1"), vec![vec![0.0]], all),
            (
                "sensor.delay",
                Sensor::Delay,
                ("delay", "s"),
                vec![vec![step], vec![6.0 * step]],
                (0.0, 100.0 * step),
            ),
        ];
        for (id, kind, parameter, starts, bounds) in kinds {
            let of_ports = matches!(kind, Sensor::Lag | Sensor::Drift | Sensor::Nonlinearity);
            if kind == Sensor::Offset && study.outputs[output].offset.is_some() || of_ports && !found {
                continue;
            }
            let parameter = (parameter.0, parameter.1.to_owned());
            let entries = entries(study, id, &[parameter], |_| bounds);
            let action = Action::Sensor { kind, output };
            let signal = Some(name.clone());
            let own = Candidate {
                id: id.to_owned(),
                channel: "sensor",
                port: study.outputs[output].port.clone(),
                twin: false,
                signal,
                action,
                entries,
                starts,
                complexity: 1,
                probe: false,
                into: None,
                needs: None,
            };
            study.candidates.push(own);
        }
    }
    // Also where another wrong sensor would not be told.
    if study.taps.iter().all(|tap| !tap.stated) {
        (0..study.outputs.len()).for_each(|output| resolution::fill(study, output));
    }
}
