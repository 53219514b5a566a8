//! From the declaration to a study that can be simulated: names resolved, records read, everything checked first.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Mutex;

use super::Problem;
use super::begin::begins;
use super::clipping::{MAX_SHARE, clipping};
use super::declaration::{Attachment, Declaration, File, Initial, Offset, Role, Value};
use super::identified;
use super::kinds;
use super::model::{Entry, Output, Study, Target, window_samples};
use super::names;
use super::noise::SensorNoise;
use super::numbers;
use super::plant::{self, Plant};
use super::ports;
use super::read::{self, Layout};
use super::taps;
use super::tolerance;
use crate::engine::fit::Free;
use crate::{Error, regime};
use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::order::check_loops;
use airloop_fmi::{Causality, InterfaceKind, template_folder};
use airloop_series::names::suggestion;

/// FMUs of this project in a study: `airloop:NAME`.
pub(super) const OWN: &str = "airloop:";

/// A system of two of them: piston force and friction in series.
const PISTON: &str = "piston-with-friction";

/// The declared system with the start values of its files.
///
/// # Errors
/// A system that is not there or does not hold together, with its place in the study.
pub fn system(file: &File) -> Result<SystemGraph, Error> {
    let spanned = &file.declaration.system;
    if spanned.get_ref().strip_prefix(OWN) == Some(PISTON) {
        return piston(file);
    }
    let path: PathBuf = match spanned.get_ref().strip_prefix(OWN) {
        Some(name) => template_folder::template(name, None).map_err(|error| file.refuse(spanned, error))?,
        None => file.folder.join(spanned.get_ref()),
    };
    // FMUs of Co-Simulation only are stepped.
    let graph = SystemGraph::open_to_read(&path).map_err(|error| file.refuse(spanned, error))?;
    check_loops(&graph, InterfaceKind::ModelExchange).map_err(|error| file.refuse(spanned, error))?;
    Ok(graph)
}

/// The system of a piston with friction, written where the FMUs are found.
fn piston(file: &File) -> Result<SystemGraph, Error> {
    let spanned = &file.declaration.system;
    let refuse = |error: &dyn std::fmt::Display| file.refuse(spanned, error);
    let mut text = include_str!("piston.ssd").to_owned();
    for (name, word) in [("piston-force", "PISTON_FORCE_FMU"), ("friction", "FRICTION_FMU")] {
        let found = template_folder::template(name, None).map_err(|error| refuse(&error))?;
        let found = found.canonicalize().map_err(|error| refuse(&error))?;
        let path = found.to_string_lossy().replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;");
        text = text.replace(word, &path);
    }
    let folder = airloop_series::scratch::folder().map_err(|error| refuse(&error))?;
    let path = folder.path().join("system.ssd");
    std::fs::write(&path, text).map_err(|error| refuse(&error))?;
    SystemGraph::open_for(&path, InterfaceKind::ModelExchange).map_err(|error| refuse(&error))
}

/// Signals and columns in the order of the system.
fn layout(file: &File, graph: &SystemGraph, plant: &Plant) -> Result<Layout, Error> {
    let declaration = &file.declaration;
    let mut inputs = vec![None; graph.inputs.len()];
    for (name, signal) in &declaration.inputs {
        let Some(index) = graph.inputs.iter().position(|input| input.name == *name) else {
            let known = names::known(graph, &[Causality::Input]);
            return Err(file.refuse(signal, Problem::Name { what: "input", name: name.clone(), known }));
        };
        inputs[index] = Some(signal.get_ref().clone());
    }
    let mut states = vec![None; plant.nx];
    let mut state_units = vec![None; plant.nx];
    for (name, signal) in &declaration.states {
        let Some(index) = plant.state(name) else {
            let known = plant.state_names();
            return Err(file.refuse(signal, Problem::Name { what: "state", name: name.clone(), known }));
        };
        states[index] = Some(signal.get_ref().clone());
        state_units[index] = read::unit(graph, name);
    }
    let outputs = declaration.outputs.values().map(|output| super::declaration::Signal {
        column: Some(output.get_ref().column.clone()),
        unit: output.get_ref().unit.clone(),
        scale: output.get_ref().scale,
        offset: output.get_ref().offset.and_then(Offset::known),
        ..Default::default()
    });
    let units = [
        graph.inputs.iter().map(|input| read::unit(graph, &input.name)).collect(),
        state_units,
        declaration.outputs.keys().map(|name| read::unit(graph, name)).collect(),
    ];
    let force = match &declaration.error.force {
        None => None,
        Some(rule) => {
            let Some(state) = plant.state(&rule.velocity) else {
                let (name, known) = (rule.velocity.clone(), plant.state_names());
                return Err(file.refuse_all(format!(
                    "error.force.velocity: {}",
                    Problem::Name { what: "state", name, known }
                )));
            };
            Some((rule.clone(), state))
        }
    };
    let extra = declaration.signals.values().map(|signal| signal.get_ref().clone()).collect();
    Ok(Layout { inputs, states, extra, outputs: outputs.collect(), units, force })
}

fn check(file: &File) -> Result<(), Error> {
    numbers::check(file)?;
    let declaration = &file.declaration;
    for role in [Role::Estimation, Role::Validation] {
        if !declaration.segment.iter().any(|segment| segment.get_ref().role == role) {
            return Err(file.refuse_all(format!(
                "no segment has the role `{}`: an effect is only reported when it was fitted on estimation records and lowers the error on validation records that the fit has not seen; give at least one segment each role",
                role.word()
            )));
        }
    }
    if declaration.outputs.is_empty() {
        return Err(file.refuse_all("no output is compared with a column; add [outputs.NAME] with `column`"));
    }
    for spanned in &declaration.attachment {
        let attachment = spanned.get_ref();
        for channel in &attachment.channels {
            if !kinds::CHANNELS.contains(&channel.as_str()) {
                return Err(file.refuse(
                    spanned,
                    format!("there is no channel `{channel}`; known are: {}", kinds::CHANNELS.join(", ")),
                ));
            }
        }
        let known = kinds::ids(&attachment.channels);
        let known = if attachment.channels.is_empty() { kinds::kinds_of_ports() } else { known };
        for id in attachment.effects.iter().flatten() {
            let kind = id.strip_suffix(&format!("@{}", attachment.input)).unwrap_or(id);
            if !known.contains(&kind) {
                return Err(file.refuse(
                    spanned,
                    format!(
                        "no effect `{id}` is known {}; {}",
                        if attachment.channels.is_empty() {
                            "at a port without channels".to_owned()
                        } else {
                            format!("in the channels {:?}", attachment.channels)
                        },
                        suggestion(kind, known.iter().copied())
                    ),
                ));
            }
        }
    }
    Ok(())
}

/// Text of a declared parameter as its FMU takes it: a Real in its own unit.
pub(crate) fn text_of(graph: &SystemGraph, name: &str, value: &Value) -> String {
    let is_real = Plant::parameter(graph, name).is_some();
    let number = is_real.then(|| value.real(names::unit_of(graph, name).as_deref()).ok()).flatten();
    number.map_or_else(|| value.to_string(), |number| number.to_string())
}

/// Fixed parameters with their values, and entries of the parameter vector.
type Values = (Vec<(plant::Parameter, f64)>, Vec<Entry>);

/// Declared parameters: fixed values and entries of the parameter vector.
fn parameters(file: &File, graph: &SystemGraph) -> Result<Values, Error> {
    let declaration = &file.declaration;
    let unknown = |name: &String| Problem::Name {
        what: "Real parameter",
        name: name.clone(),
        known: names::known(graph, &[Causality::Parameter]),
    };
    let mut fixed = Vec::new();
    for (name, value) in &declaration.parameters {
        // Those of other types are start values of the system.
        let Some((parameter, _, bounds)) = Plant::parameter(graph, name) else { continue };
        let unit = names::unit_of(graph, name);
        let number = value.get_ref().real(unit.as_deref());
        let number = number.map_err(|problem| file.refuse(value, format!("`{name}`: {problem}")))?;
        if !(bounds.0..=bounds.1).contains(&number) {
            return Err(file.refuse(
                value,
                format!(
                    "`{name}` = {number} is outside of what the FMU allows, {} to {}",
                    bounds.0, bounds.1
                ),
            ));
        }
        fixed.push((parameter, number));
    }
    let mut entries: Vec<Entry> = Vec::new();
    for spanned in &declaration.free {
        let free = spanned.get_ref();
        let (parameter, start, bounds) = Plant::parameter(graph, &free.parameter)
            .ok_or_else(|| file.refuse(spanned, unknown(&free.parameter)))?;
        let start = fixed.iter().find(|(own, _)| *own == parameter).map_or(start, |(_, value)| *value);
        let start = free.start.unwrap_or(start);
        let bounds = (
            free.min.unwrap_or(f64::NEG_INFINITY).max(bounds.0),
            free.max.unwrap_or(f64::INFINITY).min(bounds.1),
        );
        if !(bounds.0..=bounds.1).contains(&start) {
            return Err(file.refuse(
                spanned,
                format!("`{}` starts at {start}, outside of {} to {}", free.parameter, bounds.0, bounds.1),
            ));
        }
        entries.push(free_entry(graph, entries.len(), &free.parameter, (parameter, start, bounds)));
    }
    let held = |name: &String| {
        let free = || declaration.free.iter().any(|own| own.get_ref().parameter == *name);
        declaration.parameters.contains_key(name) || free()
    };
    let anew = identified::coefficients(graph).into_iter();
    let wanted = declaration.fit_identified.unwrap_or(declaration.free.is_empty());
    for name in anew.filter(|name| wanted && !held(name)) {
        let Some((parameter, start, bounds)) = Plant::parameter(graph, &name) else { continue };
        entries.push(free_entry(graph, entries.len(), &name, (parameter, start, bounds)));
    }
    fixed.retain(|(own, _)| {
        !entries.iter().any(|entry| matches!(entry.target, Target::Declared(free) if free == *own))
    });
    Ok((fixed, entries))
}

/// A parameter of the declared model that every fit is free to choose.
fn free_entry(
    graph: &SystemGraph,
    index: usize,
    name: &str,
    (parameter, start, bounds): (plant::Parameter, f64, (f64, f64)),
) -> Entry {
    let size = if start == 0.0 { 1.0 } else { start.abs().max(1e-6) };
    let free = Free { index, bounds, step: 1e-5 * size, prior: None };
    let unit = names::unit_of(graph, name).unwrap_or_else(|| "1".into());
    Entry { name: name.to_owned(), unit, target: Target::Declared(parameter), start, free }
}

/// Unit of the columns of an output by the headers of the files, where the signal of the system has none.
fn unit_of_columns(records: &[read::Record], output: usize, column: &str) -> Result<Option<String>, String> {
    let Some(first) = records.first() else { return Ok(None) };
    let unit = |record: &read::Record| record.units[output].clone();
    let Some(other) = records.iter().find(|other| unit(other) != unit(first)) else { return Ok(unit(first)) };
    let [own, its] = [first, other].map(|record| unit(record).unwrap_or_else(|| "no unit".into()));
    Err(format!(
        "column `{column}` is in {own} in {}, in {its} in {}, and the output of the system says no unit; give the files one unit",
        first.name, other.name
    ))
}

/// Opens a study: its candidates are not there yet, as they depend on what a simulation shows.
///
/// # Errors
/// A name, unit, column or value that does not fit, with file, line and column.
pub fn open(file: &File) -> Result<(Study, Vec<Attachment>), Error> {
    check(file)?;
    let declaration: &Declaration = &file.declaration;
    let mut graph = system(file)?;
    for (name, value) in &declaration.parameters {
        if Plant::parameter(&graph, name).is_none() {
            let text = value.get_ref().to_string();
            graph.set_start(name, &text, "[parameters]").map_err(|error| file.refuse(value, error))?;
        }
    }
    tolerance::check(file, &graph)?;
    let stated = declaration.attachment.iter().map(|spanned| spanned.get_ref());
    let mut shown: Vec<String> =
        stated.flat_map(Attachment::signals).chain(declaration.outputs.keys()).cloned().collect();
    // One attachment after the other, so that an unknown input is reported with its place.
    for spanned in &declaration.attachment {
        Plant::new(&graph, std::slice::from_ref(&spanned.get_ref().input), &[], &[])
            .map_err(|problem| file.refuse(spanned, problem))?;
    }
    let attachments =
        ports::attachments(file, &graph).map_err(|problem| file.refuse(&declaration.system, problem))?;
    shown.extend(attachments.iter().flat_map(Attachment::signals).cloned());
    let names: Vec<String> = attachments.iter().map(|attachment| attachment.input.clone()).collect();
    let extra: Vec<String> = declaration.signals.keys().cloned().collect();
    let mut plant = Plant::new(&graph, &names, &extra, &shown)
        .map_err(|problem| file.refuse(&declaration.system, problem))?;
    let mut states = vec![0.0; plant.nx];
    plant
        .initialize(&[], &[], 0.0, &mut states, &|_, value, _| value)
        .map_err(|problem| file.refuse(&declaration.system, problem))?;
    let sampled = plant.next_event().is_some();
    let slaves = slaves(file, &plant)?;
    let layout = layout(file, &graph, &plant)?;
    let mut notes = file.notes.clone();
    notes.extend(slaves.clone());
    notes.extend(ports::hints(&attachments, &graph));
    let mut records = read::records(file, &layout, slaves.is_some(), &mut notes)?;
    if let Some(window) = declaration.error.windows_s {
        for record in &mut records {
            let samples = window_samples(window, record.step);
            if record.n < samples {
                return Err(
                    file.refuse_all(format!("error.windows_s = {window} s, but {} is shorter", record.name))
                );
            }
            record.n -= record.n % samples;
        }
    }
    let (fixed, mut entries) = parameters(file, &graph)?;
    let anew: Vec<String> =
        entries[declaration.free.len()..].iter().map(|entry| entry.name.clone()).collect();
    notes.extend(identified::note(&anew));
    let mut known = BTreeMap::new();
    for spanned in declaration.outputs.values() {
        let output = spanned.get_ref();
        match output.noise {
            Some(noise) if !(noise > 0.0 && noise.is_finite()) => {
                return Err(file.refuse(spanned, format!("noise = {noise} must be above zero")));
            }
            Some(noise) => drop(known.insert(output.column.clone(), noise)),
            None => {}
        }
    }
    let sensors = SensorNoise::new(&records, &layout, &known);
    let mut outputs = Vec::new();
    for (o, (name, spanned)) in declaration.outputs.iter().enumerate() {
        let Some(slot) = plant.slot(name) else {
            let known = plant.signal_names();
            return Err(file.refuse(spanned, Problem::Name { what: "output", name: name.clone(), known }));
        };
        let output = spanned.get_ref();
        let unit = match layout.units[2][o].clone().or(output.unit.clone()) {
            None => {
                unit_of_columns(&records, o, &output.column).map_err(|error| file.refuse(spanned, error))?
            }
            stated => stated,
        };
        let unit = unit.unwrap_or_else(|| "1".into());
        let mut size = 0.0f64;
        for record in records.iter().filter(|record| record.role == Role::Estimation) {
            let values = &record.outputs[o];
            size = values.iter().fold(size, |a, b| a.max(b.abs()));
            if values.iter().all(|value| Some(value) == values.first()) {
                let problem = "the column never changes; nothing can be learned from it";
                return Err(file.refuse(spanned, format!("{}: {problem}", record.name)));
            }
            let Some(own) = clipping(values) else { continue };
            let limit = format!(
                "{}: the column stands at {} again and again, in {} of {} samples, as if the sensor were saturated or the machine at its limit there",
                record.name,
                own.at,
                own.samples,
                values.len()
            );
            if own.share > MAX_SHARE {
                return Err(
                    file.refuse(spanned, format!("{limit}; cut these spans out with from_s and to_s"))
                );
            }
            notes.push(format!(
                "{} {limit}. They count as measured; cut them out with from_s and to_s if the sensor is.",
                output.column
            ));
        }
        let factor = records.first().map_or(1.0, |record| record.factors[3][o].abs())
            * output.scale.unwrap_or(1.0).abs();
        let noise = (factor * sensors.of(&output.column).rms()).max(1e-12);
        let offset = output.offset.filter(|offset| offset.known().is_none()).map(|_| {
            let index = entries.len();
            let bounds = (f64::NEG_INFINITY, f64::INFINITY);
            let free = Free { index, bounds, step: 1e-4 * size.max(1e-9), prior: None };
            let name = format!("offset of {}", output.column);
            entries.push(Entry { name, unit: unit.clone(), target: Target::Offset, start: 0.0, free });
            index
        });
        let (column, port) = (output.column.clone(), name.clone());
        let noise_is_stated = output.noise.is_some();
        outputs.push(Output { name: column, port, slot, unit, noise, noise_is_stated, offset });
    }
    notes.extend(regimes(&graph, &records, &outputs, &layout).map_err(|problem| file.refuse_all(problem))?);
    if layout.inputs.iter().any(Option::is_some) {
        notes.push("Before the first sample of a segment a command counts as that sample: effects on it with a memory begin settled there.".into());
    }
    let taps = taps::taps(file, &attachments, &graph, &plant, &entries, &fixed)?;
    let force = match &layout.force {
        None => None,
        Some((rule, state)) => {
            let Some(tap) = taps.iter().position(|tap| tap.name == rule.attachment) else {
                return Err(file.refuse_all(format!(
                    "error.force.attachment: there is no [[attachment]] with input `{}`",
                    rule.attachment
                )));
            };
            let driven = declaration.inputs.iter().find_map(|(_, signal)| signal.get_ref().column.clone());
            Some((
                rule.clone(),
                *state,
                tap,
                driven.unwrap_or_else(|| format!("force at {}", rule.attachment)),
            ))
        }
    };
    for record in &mut records {
        let Initial::Given(values) = &record.initial else { continue };
        for (name, value) in values.iter().filter(|(name, _)| plant.state(name).is_none()) {
            let Some((parameter, ..)) = Plant::parameter(&graph, name) else {
                let known = match plant.nx {
                    0 => names::known(&graph, &[Causality::Parameter]),
                    _ => plant.state_names(),
                };
                let problem = Problem::Name { what: "state or Real parameter", name: name.clone(), known };
                return Err(file.refuse_all(format!("initial of {}: {problem}", record.name)));
            };
            record.parameters.push((parameter, *value));
        }
    }
    let held = declaration_holds(file, &graph);
    let mut study = Study {
        name: declaration.name.clone(),
        records,
        extra,
        shown,
        held,
        substeps: 1,
        unobservable: Vec::new(),
        begins: Vec::new(),
        outputs,
        declared: entries.len(),
        entries,
        fixed,
        taps,
        own: Vec::new(),
        motion: Vec::new(),
        surfaces: Vec::new(),
        candidates: Vec::new(),
        ranges: Vec::new(),
        positions: Vec::new(),
        windows: declaration.error.windows_s,
        starts: Vec::new(),
        force,
        sampled,
        steps_alone: slaves.is_some(),
        sensors,
        notes,
        not_testable: Vec::new(),
        pool: Mutex::new(vec![plant]),
        failure: Mutex::default(),
        graph,
    };
    if let Some(redrawn) = &file.redrawn {
        redrawn.replace(&mut study);
    }
    study.begins = begins(&study);
    Ok((study, attachments))
}

/// A note on components that have Co-Simulation only, if there are some.
fn slaves(file: &File, plant: &Plant) -> Result<Option<String>, Error> {
    let names = plant.slaves();
    let Some(first) = names.first() else { return Ok(None) };
    if file.declaration.error.windows_s.is_some() {
        return Err(file.refuse_all(format!(
            "error.windows_s restarts the simulation from measured states, which `{first}` does not take: its FMU has Co-Simulation only; leave windows_s out, or export the FMU with Model Exchange"
        )));
    }
    let list = names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    Ok(Some(format!(
        "{list}: Co-Simulation only. Every simulation steps it from the start of the record, with its inputs and outputs held between samples, from the start values of its parameters; `initial` of a segment may give other values. A search takes longer than with Model Exchange."
    )))
}

/// Whether records are of one regime, and show more than noise: inputs by their columns, and outputs.
fn regimes(
    graph: &SystemGraph,
    records: &[read::Record],
    outputs: &[Output],
    layout: &Layout,
) -> Result<Vec<String>, String> {
    fn of<'a>(
        records: &'a [read::Record],
        role: Role,
        values: impl Fn(&'a read::Record) -> Option<&'a Vec<f64>>,
    ) -> Vec<regime::Values<'a>> {
        let own = records.iter().filter(|record| record.role == role);
        own.filter_map(|record| {
            Some(regime::Values { name: &record.name, step: record.step, values: values(record)? })
        })
        .collect()
    }
    let input = |i: usize| {
        let column = layout.inputs[i].as_ref().and_then(super::declaration::Signal::source)?;
        let [estimation, validation] = [Role::Estimation, Role::Validation]
            .map(|role| of(records, role, |record| record.inputs[i].as_ref()));
        Some(regime::Signal { name: column, driven: true, noise: 0.0, estimation, validation })
    };
    let mut signals: Vec<regime::Signal> = (0..graph.inputs.len()).filter_map(input).collect();
    for (o, output) in outputs.iter().enumerate() {
        let [estimation, validation] = [Role::Estimation, Role::Validation]
            .map(|role| of(records, role, |record| Some(&record.outputs[o])));
        signals.push(regime::Signal {
            name: &output.name,
            driven: false,
            noise: output.noise,
            estimation,
            validation,
        });
    }
    regime::check(&signals)
}

fn declaration_holds(file: &File, graph: &SystemGraph) -> Vec<bool> {
    let hold = |(index, input): (usize, &airloop_cosim::system::graph::SystemInput)| {
        graph.input_is_held(index)
            || file.declaration.inputs.get(&input.name).is_some_and(|signal| signal.get_ref().hold)
    };
    graph.inputs.iter().enumerate().map(hold).collect()
}
