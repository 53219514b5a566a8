//! The declared system of a study, and where the blocks of an answer go in it: at the attachments of its channels.

use std::path::{Path, PathBuf};

use super::Error;
use super::blocks::{self, COMMAND_ORDER, Sources};
use super::network::{Block, Network, end};
use super::own;
use crate::answer::{Answer, Effect};
use crate::case::Friction;
use crate::study::declaration::{Attachment, File, Signal};
use crate::study::open;
use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::graph::{Source, SystemOutput};
use airloop_cosim::system::ssp::{self, Endpoint};
use airloop_cosim::system::write::{self, Version};
use airloop_fmi::Variability;
use airloop_fmi::derive::Value;

/// Step of sampled blocks where the study states none \[s\].
const STEP: f64 = 1e-3;

/// The declared system with the selected effects of an answer, and with the values that its free parameters have beside
/// them. `work`: a folder for a passing file.
///
/// # Errors
/// A system whose files cannot be read again.
pub fn network(file: &File, answer: &Answer, work: &Path) -> Result<Network, Error> {
    let mut graph = open::system(file).map_err(Box::new)?;
    let declared =
        file.declaration.parameters.iter().map(|(name, value)| (name, value.get_ref().to_string()));
    let fitted = answer.fitted.iter().map(|(name, value)| (name, format!("{value:?}")));
    for (name, value) in declared.chain(fitted) {
        graph.set_start(name, &value, &format!("{name} of {}", file.path.display()))?;
    }
    let path = work.join(".declared.ssd");
    let written = write::write(&graph, &path, Version::V1_0).and_then(|()| ssp::read(&path));
    let _ = std::fs::remove_file(&path);
    let package = graph.package.clone();
    let columns = columns(file, &graph);
    let mut network =
        Network { structure: written?, parts: Vec::new(), copies: Vec::new(), package, columns };
    take_files(&mut network);
    let attachments: Vec<&Attachment> = file.declaration.attachment.iter().map(|a| a.get_ref()).collect();
    let mut selected: Vec<&Effect> = answer.effects.iter().filter(|effect| effect.selected).collect();
    // Effects of a command path act in a fixed order; all others add up.
    selected.sort_by_key(|effect| COMMAND_ORDER.iter().position(|id| *id == effect.id));
    let step = file.declaration.step_s.as_ref().map_or(STEP, |step| *step.get_ref());
    for effect in selected {
        if let Some(column) = &effect.signal {
            sense(&mut network, (file, &graph), column, effect, step);
            continue;
        }
        let own = attachments.iter().find(|attachment| {
            let named = effect.own.is_some()
                || attachment.effects.as_ref().is_none_or(|list| list.contains(&effect.id));
            named && attachment.channels.contains(&effect.channel)
        });
        if let Some(attachment) = own {
            place(&mut network, &graph, attachment, effect, step);
        }
    }
    if let Some(law) = &answer.law
        && let Some(attachment) = attachments.iter().find(|attachment| attachment.input == law.port)
    {
        place(&mut network, &graph, attachment, &law.effect, step);
    }
    Ok(network)
}

/// Inputs and outputs of the system with the columns that they are in the records as they stand.
fn columns(file: &File, graph: &SystemGraph) -> Vec<(String, String)> {
    let declaration = &file.declaration;
    let plain = |signal: &Signal| signal.scale.is_none() && signal.low_pass_hz.is_none();
    let inputs = declaration.inputs.iter().map(|(name, signal)| (name, signal.get_ref()));
    let inputs =
        inputs.filter(|(_, signal)| plain(signal)).filter_map(|(n, s)| Some((n, s.column.as_ref()?)));
    let shown = |name: &String| graph.outputs.iter().any(|output| output.name == *name);
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
        let Some(mut block) = blocks::sensor(effect, step, sampled, false).filter(|_| shown) else {
            continue;
        };
        if index > 0 {
            block.part.name += &format!("_{}", index + 1);
        }
        network.insert(&to, block, false);
    }
}

/// Whether an output changes at samples only.
fn is_sampled(graph: &SystemGraph, output: &SystemOutput) -> bool {
    let Source::Output { component, variable } = output.source else { return false };
    let description = &graph.components[component].fmu.description;
    description.variables[variable].variability == Variability::Discrete
}

/// Names the FMUs of the system as files beside the description.
fn take_files(network: &mut Network) {
    let mut known: Vec<(PathBuf, PathBuf)> = Vec::new();
    for component in &mut network.structure.components {
        let same = known.iter().find(|(source, _)| *source == component.source).map(|(_, name)| name.clone());
        let name = same.unwrap_or_else(|| {
            let name = PathBuf::from(format!("{}.fmu", component.name));
            known.push((component.source.clone(), name.clone()));
            name
        });
        component.source.clone_from(&name);
        component.shown = name;
    }
    network.copies = known;
}

/// Puts the block of an effect in front of every input that the attachment feeds.
fn place(network: &mut Network, graph: &SystemGraph, attachment: &Attachment, effect: &Effect, step: f64) {
    let targets = targets(network, graph, &attachment.input);
    let friction = Friction {
        c1: attachment.coulomb.as_ref().and_then(|name| start(network, graph, name)).unwrap_or(0.0),
        c2: 1.0 / attachment.vt.unwrap_or(1e-3),
        ..Friction::default()
    };
    let sources = Sources {
        x: source(network, graph, attachment.position.as_ref()),
        v: source(network, graph, attachment.velocity.as_ref()),
        theta: source(network, graph, attachment.position.as_ref()),
        omega: source(network, graph, attachment.velocity.as_ref()),
        f_hat: source(network, graph, attachment.pressure_force.as_ref()),
        p: source(network, graph, attachment.pressure.as_ref()),
    };
    let formula = effect.own.as_ref();
    let block = formula
        .map(|formula| own::block(formula, effect, &sources))
        .or_else(|| blocks::command(effect, step, &sources))
        .or_else(|| blocks::area(effect, &sources))
        .or_else(|| blocks::friction(effect, &friction, &sources))
        .or_else(|| blocks::cart(effect, 0.0, &sources))
        .or_else(|| blocks::pole(effect, 0.0, &sources));
    let Some(mut block) = block else { return };
    if block.part.template == "torque-effect" {
        block.part.start.push(("coulomb_rate".into(), Value::Real(attachment.vt.unwrap_or(0.05))));
    }
    for (index, target) in targets.iter().enumerate() {
        let mut own: Block = block.clone();
        if index > 0 {
            own.part.name += &format!("_{}", index + 1);
        }
        network.insert(target, own, false);
    }
}

/// Inputs of components that an attachment names: one of them, or those that an input of the system feeds.
fn targets(network: &Network, graph: &SystemGraph, name: &str) -> Vec<Endpoint> {
    if graph.inputs.iter().any(|input| input.name == name) {
        let fed =
            network.structure.connections.iter().filter(|c| first_source(network, &c.start) == end("", name));
        return fed.filter(|c| !is_block(network, &c.end)).map(|c| c.end.clone()).collect();
    }
    component(graph, name).into_iter().collect()
}

fn is_block(network: &Network, place: &Endpoint) -> bool {
    network.parts.iter().any(|part| place.element.as_ref() == Some(&part.name))
}

/// What stands in front of the blocks that are there already.
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

/// Where a signal comes from: a system output shows it, a component has it, or else it comes from outside.
fn source(network: &Network, graph: &SystemGraph, name: Option<&String>) -> Option<Endpoint> {
    let name = name?;
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
