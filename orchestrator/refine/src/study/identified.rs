//! Coefficients of identified linear models, which the records have to choose anew with every effect: the effect acted
//! in the data of the identification, and the coefficients took some of it.

use super::names;
use super::plant::Plant;
use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::graph::{Component, Start};
use airloop_fmi::{Causality, VariableKind};

/// Coefficients that are fitted anew at most; a model with more stays as it is.
const MAX_COEFFICIENTS: usize = 12;

/// Row and column of an element of the matrix `letter`.
fn element(name: &str, letter: char) -> Option<(usize, usize)> {
    let inside = name.strip_prefix(letter)?.strip_prefix('[')?.strip_suffix(']')?;
    let (row, column) = inside.split_once(',')?;
    Some((row.trim().parse().ok()?, column.trim().parse().ok()?))
}

/// Value of an Integer parameter of a component.
fn integer(component: &Component, index: usize) -> Option<usize> {
    let set = component.start_values.iter().find(|own| own.variable == index).map(|own| &own.value);
    let own = match (set, &component.fmu.description.variables[index].kind) {
        (Some(Start::Integer(value)), _) => *value,
        (_, VariableKind::Integer { start, .. }) => (*start)?,
        _ => return None,
    };
    usize::try_from(own).ok()
}

/// Parameters `A[i,i]` and `C[j,i]` of components that are a state space, if they are not zero, and `y_offset[j]`, as a
/// study names them. They move its poles, how much each shows, and the values at rest; the other elements add
/// directions that mostly change the coordinates alone.
pub fn coefficients(graph: &SystemGraph) -> Vec<String> {
    let mut found = Vec::new();
    for component in &graph.components {
        let variables = &component.fmu.description.variables;
        let named = |letter: char| {
            let own = variables.iter().enumerate().filter(move |(_, own)| {
                matches!(own.kind, VariableKind::Real(_)) && own.causality == Causality::Parameter
            });
            own.filter_map(move |(index, own)| Some((index, element(&own.name, letter)?)))
        };
        if named('B').next().is_none() {
            continue;
        }
        // Elements beyond the numbers of states and outputs in use are ignored.
        let used = |count: &str| {
            let own = variables.iter().position(|own| own.name == count);
            own.and_then(|index| integer(component, index)).unwrap_or(usize::MAX)
        };
        let (states, outputs) = (used("n_x"), used("n_y"));
        let inside = |&(_, (row, column)): &(usize, (usize, usize))| row <= outputs && column <= states;
        let path = |(index, _): (usize, (usize, usize))| names::name_of(graph, component, index);
        let poles = named('A').filter(|(_, (row, column))| row == column && *row <= states).map(path);
        let shown = named('C').filter(inside).map(path);
        let rest = (1..=outputs.min(variables.len())).filter_map(|output| {
            let index = variables.iter().position(|own| own.name == format!("y_offset[{output}]"))?;
            Some(path((index, (output, output))))
        });
        let acts = |name: &String| Plant::parameter(graph, name).is_some_and(|(_, value, _)| value != 0.0);
        let own: Vec<String> = poles.chain(shown).filter(acts).chain(rest).collect();
        if own.len() <= MAX_COEFFICIENTS {
            found.extend(own);
        }
    }
    found
}

/// Note of the report about refitted coefficients; none without any.
pub fn note(names: &[String]) -> Option<String> {
    (!names.is_empty()).then(|| {
        format!(
            "Coefficients of the identified model, {}, are fitted anew beside every effect; `fit_identified = false` in the study, or values in [parameters], hold them.",
            names.join(", ")
        )
    })
}
