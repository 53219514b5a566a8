//! The declared system of a study, and where the blocks of an answer go in it: at the attachments of its channels.

use std::path::{Path, PathBuf};

use super::Error;
use super::blocks::{self, Sources};
use super::network::{Baked, Block, Network, end};
use super::{own, port};
use crate::answer::{Answer, Effect, Parameter, Wiring};
use crate::study::declaration::{Attachment, File, Signal};
use crate::study::{names, open};
use crate::vocabulary::builtin::Builtin;
use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::graph::{Component, Conversion, Source, Start, StartValue, SystemOutput};
use airloop_cosim::system::ssp::{self, Endpoint};
use airloop_cosim::system::write::{self, Version};
use airloop_fmi::derive::{self, Derivation, Value};
use airloop_fmi::{Causality, Variability};

/// Step of sampled blocks where the study states none \[s\].
const STEP: f64 = 1e-3;
/// Samples of a delay at most, as the blocks keep them.
const MAX_DELAY_SAMPLES: f64 = 255.0;
/// Name of the velocity over which friction changes its sign, in formulas of the program.
const SIGN_CHANGE: &str = "vt";
/// Samples of a block that has to be sampled, on a signal that moves between those of the records.
const SAMPLES_PER_STEP: f64 = 10.0;

/// The declared system with the selected effects of an answer, and with the values that its free parameters have beside
/// them. `work`: a folder for a passing file.
///
/// # Errors
/// A system whose files cannot be read again.
pub fn network(file: &File, answer: &Answer, work: &Path) -> Result<Network, Error> {
    let mut graph = open::system(file).map_err(Box::new)?;
    let declared = file.declaration.parameters.iter();
    let declared = declared.map(|(name, value)| (name, open::text_of(&graph, name, value.get_ref())));
    let fitted = answer.fitted.iter().map(|(name, value)| (name, format!("{value:?}")));
    for (name, value) in declared.chain(fitted).collect::<Vec<_>>() {
        graph.set_start(name, &value, &format!("{name} of {}", file.path.display()))?;
    }
    let path = work.join(".declared.ssd");
    let written = write::write(&graph, &path, Version::V1_0).and_then(|()| ssp::read(&path));
    let _ = std::fs::remove_file(&path);
    let mut network = Network {
        structure: written?,
        parts: Vec::new(),
        copies: Vec::new(),
        baked: Vec::new(),
        rates: Vec::new(),
        package: graph.package.clone(),
        columns: columns(file, &graph),
    };
    convert(&mut network, &graph);
    for name in file.declaration.outputs.keys() {
        if let Some(place) = local(&graph, name) {
            network.connect(place, end("", name), None, 1.0);
        }
    }
    take_files(&mut network, &graph);
    let mut selected: Vec<&Effect> = answer.effects.iter().filter(|effect| effect.selected).collect();
    // Effects of a command path act in a fixed order; all others add up.
    let rank = |effect: &&Effect| port::ORDER.iter().position(|kind| *kind == effect.kind());
    // A sensor rounds what it has made of the signal.
    let rounds = |effect: &&Effect| effect.signal.is_some() && effect.kind() == "quantization";
    selected.sort_by_key(|effect| (rounds(effect), rank(effect).unwrap_or(usize::MAX)));
    let stated = file.declaration.step_s.as_ref().map_or(STEP, |step| *step.get_ref());
    let step = |effect: &Effect| sample_time(effect, stated, answer.sample_time);
    for effect in &selected {
        if let Some(column) = &effect.signal {
            sense(&mut network, (file, &graph), column, effect, step(effect));
        } else if let Some((input, wiring)) = wiring(file, &graph, &network, effect, &selected) {
            place(&mut network, (file, &graph), (&input, &wiring), (effect, &selected), step(effect));
        }
    }
    if let Some(law) = &answer.law
        && let Some((input, wiring)) = wiring(file, &graph, &network, &law.effect, &selected)
    {
        place(&mut network, (file, &graph), (&input, &wiring), (&law.effect, &selected), stated);
    }
    Ok(network)
}

/// Sample time of the block of an effect: `step`, or that of the records where a delay is too long for the samples that
/// a block keeps.
fn sample_time(effect: &Effect, step: f64, of_records: f64) -> f64 {
    let longest = MAX_DELAY_SAMPLES * step;
    let is_long = effect.kind() == "delay" && blocks::value(effect, "delay") > longest;
    // Differences of times are off in their last digits, and a block that is early by these sees the sample before.
    let rounded = format!("{of_records:.9e}").parse().unwrap_or(of_records);
    if is_long && of_records > step { rounded } else { step }
}

/// Attachment of an effect: that of its port, or the first that may have it.
fn attachment(file: &File, effect: &Effect) -> Option<Attachment> {
    let all = || file.declaration.attachment.iter().map(|attachment| attachment.get_ref());
    let may = |attachment: &&Attachment| {
        let named = attachment.effects.as_ref().is_none_or(|list| list.contains(&effect.id));
        named && attachment.channels.contains(&effect.channel)
    };
    let at = |attachment: &&Attachment| effect.port.as_ref().is_none_or(|port| *port == attachment.input);
    all().find(|own| at(own) && may(own)).or_else(|| all().find(may)).cloned()
}

/// Input and wiring of an effect: its own, or those of its attachment.
fn wiring(
    file: &File,
    graph: &SystemGraph,
    network: &Network,
    effect: &Effect,
    selected: &[&Effect],
) -> Option<(String, Wiring)> {
    if let (Some(port), Some(wiring)) = (&effect.port, &effect.wiring) {
        return Some((port.clone(), wiring.clone()));
    }
    let attachment = attachment(file, effect)?;
    let here = |other: &&&Effect| other.port == effect.port && other.kind() == "coulomb";
    let added: f64 =
        selected.iter().filter(here).filter_map(|other| Some(other.parameters.first()?.value)).sum();
    let declared = attachment.coulomb.as_ref().and_then(|name| start(network, graph, name)).unwrap_or(0.0);
    let (vt, v0, level) = (attachment.sign_velocity(), attachment.v0.unwrap_or(0.0), declared + added);
    let Attachment { input, velocity, position, pressure_force: load, pressure, .. } = attachment;
    Some((input, Wiring { velocity, position, load, pressure, vt, v0, sign: 1.0, level, into: None }))
}

/// Writes what connections convert between units into them: blocks have none.
fn convert(network: &mut Network, graph: &SystemGraph) {
    for own in &graph.connections {
        let component = &graph.components[own.component];
        let name = &component.fmu.description.variables[own.variable].name;
        let to = end(&component.name, name);
        let found = network.structure.connections.iter_mut().find(|connection| connection.end == to);
        if let Some(connection) = found.filter(|_| own.conversion != Conversion::IDENTITY) {
            connection.transformation = Some((own.conversion.factor, own.conversion.offset));
            connection.suppress_unit_conversion = true;
        }
    }
}

/// Inputs and outputs of the system with the columns that they are in the records as they stand.
fn columns(file: &File, graph: &SystemGraph) -> Vec<(String, String)> {
    let declaration = &file.declaration;
    let plain = |signal: &Signal| signal.scale.is_none() && signal.low_pass_hz.is_none();
    let inputs = declaration.inputs.iter().map(|(name, signal)| (name, signal.get_ref()));
    let inputs =
        inputs.filter(|(_, signal)| plain(signal)).filter_map(|(n, s)| Some((n, s.column.as_ref()?)));
    let shown = |name: &String| {
        graph.outputs.iter().any(|output| output.name == *name) || local(graph, name).is_some()
    };
    let outputs = declaration.outputs.iter().map(|(name, output)| (name, &output.get_ref().column));
    let all = inputs.chain(outputs.filter(|(name, _)| shown(name)));
    all.map(|(name, column)| (name.clone(), column.clone())).collect()
}

/// Puts the block of a sensor effect in front of the outputs of the system that are compared with its column.
fn sense(
    network: &mut Network,
    (file, graph): (&File, &SystemGraph),
    column: &str,
    effect: &Effect,
    step: f64,
) {
    let named = file.declaration.outputs.iter().filter(|(_, output)| output.get_ref().column == column);
    for (index, (name, _)) in named.enumerate() {
        let to = end("", name);
        let shown = network.structure.connections.iter().any(|connection| connection.end == to);
        let sampled = graph.outputs.iter().any(|output| output.name == *name && is_sampled(graph, output));
        let lagging = || {
            let wiring = Wiring { vt: 1.0, sign: 1.0, ..Wiring::default() };
            port::block(effect, blocks::name(effect), &wiring, step, &Sources::default())
        };
        if let Some(own) = effect.own.as_ref().filter(|_| shown) {
            let name = numbered(blocks::name(effect), index);
            own::insert(network, &to, own, (effect, name), (1.0, &Sources::default()));
            continue;
        }
        let block = match effect.kind() {
            "lag" => lagging(),
            "drift" | "nonlinearity" | "quantization" => Builtin::formula(&effect.id).map(|formula| {
                own::block(&formula, (effect, blocks::name(effect)), 1.0, &Sources::default())
            }),
            _ => blocks::sensor(effect, step, sampled, false),
        };
        let Some(mut block) = block.filter(|_| shown) else { continue };
        block.part.name = numbered(block.part.name, index);
        network.insert(&to, block, false);
    }
}

/// Whether an output changes at samples only.
fn is_sampled(graph: &SystemGraph, output: &SystemOutput) -> bool {
    let Source::Output { component, variable } = output.source else { return false };
    let description = &graph.components[component].fmu.description;
    description.variables[variable].variability == Variability::Discrete
}

/// Names the FMUs of the system as files beside the description; those of this project get the values of their
/// parameters as start values.
fn take_files(network: &mut Network, graph: &SystemGraph) {
    let mut known: Vec<(PathBuf, PathBuf)> = Vec::new();
    for component in &mut network.structure.components {
        let name = PathBuf::from(format!("{}.fmu", component.name));
        let declared = graph.components.iter().find(|own| own.name == component.name);
        let start = declared.map_or_else(Vec::new, baked);
        if !start.is_empty() {
            let (source, file) = (component.source.clone(), name.clone());
            let derivation = Derivation { name: component.name.clone(), start, ..Derivation::default() };
            network.baked.push(Baked { source, file, derivation });
        } else if let Some((_, same)) = known.iter().find(|(source, _)| *source == component.source) {
            (component.source, component.shown) = (same.clone(), same.clone());
            continue;
        } else {
            known.push((component.source.clone(), name.clone()));
        }
        component.source.clone_from(&name);
        component.shown = name;
    }
    network.copies = known;
}

/// Values that the system gives the parameters of a component, where its FMU can have start values of its own.
fn baked(component: &Component) -> Vec<(String, Value)> {
    let description = &component.fmu.description;
    if !derive::is_template(description) {
        return Vec::new();
    }
    let one = |start: &StartValue| {
        let variable = &description.variables[start.variable];
        let value = match &start.value {
            Start::Real(value) => Value::Real(*value),
            Start::Integer(value) => Value::Integer(*value),
            Start::Boolean(value) => Value::Boolean(*value),
            Start::String(value) => Value::String(value.clone()),
        };
        (variable.causality == Causality::Parameter).then(|| (variable.name.clone(), value))
    };
    component.start_values.iter().filter_map(one).collect()
}

/// Puts the block of an effect in front of every input that the attachment feeds.
fn place(
    network: &mut Network,
    (file, graph): (&File, &SystemGraph),
    (input, wiring): (&str, &Wiring),
    (effect, selected): (&Effect, &[&Effect]),
    step: f64,
) {
    let sources = Sources {
        x: source(network, graph, wiring.position.as_ref()),
        v: source(network, graph, wiring.velocity.as_ref()),
        f_hat: source(network, graph, wiring.load.as_ref()),
        p: source(network, graph, wiring.pressure.as_ref()),
        ..Sources::default()
    };
    let index = graph.inputs.iter().position(|own| own.name == input);
    let held = index.is_some_and(|index| {
        let stated = file.declaration.inputs.get(input).is_some_and(|own| own.get_ref().hold);
        stated || graph.input_is_held(index)
    });
    // A signal inside of the system moves between the samples of the records.
    let inner = index.is_none() && effect.kind() == "hysteresis";
    let sampling = if inner { step / SAMPLES_PER_STEP } else { step };
    let twin = selected.iter().filter(|other| other.id == effect.id).count() > 1;
    let mut name = blocks::name(effect).split('@').next().unwrap_or("effect").to_owned();
    if twin || effect.id.contains('@') {
        name += &format!("_{}", plain(input));
    }
    let targets = targets(network, graph, input);
    if let Some(own) = &effect.own {
        for (index, target) in targets.iter().enumerate() {
            own::insert(
                network,
                target,
                own,
                (effect, numbered(name.clone(), index)),
                (wiring.sign, &sources),
            );
        }
        return;
    }
    let block = blocks::memory(effect, &name, sampling, held)
        .or_else(|| port::block(effect, name.clone(), wiring, step, &sources))
        .or_else(|| {
            let formula = Builtin::formula(effect.kind())?;
            let mut effect = effect.clone();
            if formula.parameters.iter().any(|p| p.name == SIGN_CHANGE)
                && !effect.parameters.iter().any(|p| p.name == SIGN_CHANGE)
            {
                let (name, value) = (SIGN_CHANGE.to_owned(), wiring.vt);
                effect.parameters.push(Parameter {
                    name,
                    unit: String::new(),
                    value,
                    interval: (value, value),
                });
            }
            Some(own::block(&formula, (&effect, name.clone()), wiring.sign, &sources))
        });
    let Some(block) = block else { return };
    insert_all(network, &targets, &block);
    if let Some((into, all)) = &wiring.into {
        let targets = self::targets(network, graph, into);
        insert_all(network, &targets, &port::caught(effect, format!("{name}_caught"), *all, &sources));
    }
}

/// Puts a block in front of each of these inputs.
fn insert_all(network: &mut Network, targets: &[Endpoint], block: &Block) {
    for (index, target) in targets.iter().enumerate() {
        let mut own = block.clone();
        own.part.name = numbered(own.part.name, index);
        network.insert(target, own, false);
    }
}

/// The name of a block where an effect needs several: from the second on with its number.
fn numbered(name: String, index: usize) -> String {
    if index == 0 { name } else { format!("{name}_{}", index + 1) }
}

/// A name as part of that of a component.
fn plain(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect()
}

/// Inputs of components that an attachment names: one of them, or those that an input of the system feeds.
fn targets(network: &mut Network, graph: &SystemGraph, name: &str) -> Vec<Endpoint> {
    if graph.inputs.iter().any(|input| input.name == name) {
        let network = &*network;
        let fed =
            network.structure.connections.iter().filter(|c| first_source(network, &c.start) == end("", name));
        return fed.filter(|c| !is_block(network, &c.end)).map(|c| c.end.clone()).collect();
    }
    component(graph, name).map(|place| input_of(network, graph, place)).into_iter().collect()
}

/// The input that a block feeds at a variable: itself, or the one that its FMU gets where it is the rate of a state.
fn input_of(network: &mut Network, graph: &SystemGraph, place: Endpoint) -> Endpoint {
    let owner = graph.components.iter().find(|own| Some(&own.name) == place.element.as_ref());
    let is_rate = owner.is_some_and(|own| {
        let variable = own.fmu.description.index_of(&place.connector);
        variable.is_some_and(|variable| names::state_of_rate(own, variable).is_some())
    });
    if !is_rate {
        return place;
    }
    let name = place.element.unwrap_or_default();
    let own = (name.clone(), place.connector.clone());
    if !network.rates.contains(&own) {
        network.rates.push(own);
    }
    end(&name, &airloop_system::added_to(&place.connector))
}

fn is_block(network: &Network, place: &Endpoint) -> bool {
    network.parts.iter().any(|part| place.element.as_ref() == Some(&part.name))
}

/// Source at the head of the chain of blocks that already act on an input.
fn first_source(network: &Network, place: &Endpoint) -> Endpoint {
    if !is_block(network, place) {
        return place.clone();
    }
    let way = ["F_in", "tau_in", "f_in", "u"];
    let into = network.structure.connections.iter().find(|connection| {
        connection.end.element == place.element && way.contains(&connection.end.connector.as_str())
    });
    into.map_or_else(|| place.clone(), |connection| first_source(network, &connection.start))
}

/// `component.variable`, or a variable of the only component.
fn component(graph: &SystemGraph, name: &str) -> Option<Endpoint> {
    let (component, variable) = match name.split_once('.') {
        Some((component, variable)) if !graph.single => {
            (graph.components.iter().find(|c| c.name == component)?, variable)
        }
        _ => (graph.components.first().filter(|_| graph.single)?, name),
    };
    component.fmu.description.index_of(variable)?;
    Some(end(&component.name, variable))
}

/// A local variable of an FMU that the system does not show.
fn local(graph: &SystemGraph, name: &str) -> Option<Endpoint> {
    if graph.outputs.iter().any(|output| output.name == name) {
        return None;
    }
    let place = component(graph, name)?;
    let own = graph.components.iter().find(|own| Some(&own.name) == place.element.as_ref())?;
    let variable = own.fmu.description.variable(&place.connector)?;
    (variable.causality == Causality::Local).then_some(place)
}

/// Where a signal comes from: a system output shows it, a component has it, or else it comes from outside.
fn source(network: &Network, graph: &SystemGraph, name: Option<&String>) -> Option<Endpoint> {
    let name = name?;
    if graph.inputs.iter().any(|input| input.name == *name) {
        return Some(end("", name));
    }
    let shown = network.structure.connections.iter().find(|connection| connection.end == end("", name));
    let found = shown.map(|connection| connection.start.clone()).or_else(|| component(graph, name));
    Some(found.unwrap_or_else(|| end("", name)))
}

/// Start value of a Real parameter in the amended system.
fn start(network: &Network, graph: &SystemGraph, name: &str) -> Option<f64> {
    let place = component(graph, name)?;
    let own = network.structure.components.iter().find(|c| Some(&c.name) == place.element.as_ref())?;
    let set = own.parameters.iter().rev().find(|parameter| parameter.name == place.connector);
    if let Some(airloop_cosim::system::ssv::Value::Real(value)) = set.map(|parameter| &parameter.value) {
        return Some(*value);
    }
    let component = graph.components.iter().find(|c| c.name == own.name)?;
    let index = component.fmu.description.index_of(&place.connector)?;
    match &component.fmu.description.variables[index].kind {
        airloop_fmi::VariableKind::Real(real) => real.start,
        _ => None,
    }
}
