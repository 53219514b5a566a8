//! `ModelStructure` of FMI 3.0: by value reference, arrays as a whole.

use super::super::structure::kind;
use super::super::{Dependency, DependencyKind, DescriptionError, Unknown};
use super::variables::Read;
use crate::xml::Element;

/// All elements called `name`, one entry for each element of an array. An element of an array depends on every element
/// of the arrays that its variable depends on. Unread variables are left out.
pub(super) fn read(root: &Element, name: &str, read: &Read) -> Result<Vec<Unknown>, DescriptionError> {
    let Some(structure) = root.child("ModelStructure") else { return Ok(Vec::new()) };
    let mut unknowns = Vec::new();
    for element in structure.children(name) {
        let reference = element
            .integer("valueReference")?
            .ok_or_else(|| element.error("the attribute valueReference is missing"))?;
        let dependencies = dependencies(element, read)?;
        let positions = read.positions(reference).ok_or_else(|| unknown_reference(element, reference))?;
        for variable in positions {
            unknowns.push(Unknown { variable, dependencies: dependencies.clone() });
        }
    }
    Ok(unknowns)
}

fn unknown_reference(element: &Element, reference: u32) -> DescriptionError {
    element.error(format!("the value reference {reference} is that of no variable"))
}

fn dependencies(element: &Element, read: &Read) -> Result<Option<Vec<Dependency>>, DescriptionError> {
    let kinds = element.attribute("dependenciesKind");
    let Some(references) = element.attribute("dependencies") else {
        return match kinds {
            Some(_) => Err(element.error("it has dependenciesKind without dependencies")),
            None => Ok(None),
        };
    };
    let references = references
        .split_whitespace()
        .map(|word| {
            word.parse()
                .map_err(|_| element.error(format!("\"{word}\" in dependencies is not a value reference")))
        })
        .collect::<Result<Vec<u32>, _>>()?;
    let kinds = match kinds {
        Some(kinds) => kinds
            .split_whitespace()
            .map(|word| kind(word).map_err(|message| element.error(message)))
            .collect::<Result<Vec<_>, _>>()?,
        None => vec![DependencyKind::default(); references.len()],
    };
    if kinds.len() != references.len() {
        let (kinds, references) = (kinds.len(), references.len());
        return Err(
            element.error(format!("it has {references} dependencies and {kinds} words in dependenciesKind"))
        );
    }
    let mut dependencies = Vec::new();
    for (reference, kind) in references.into_iter().zip(kinds) {
        let positions = read.positions(reference).ok_or_else(|| unknown_reference(element, reference))?;
        dependencies.extend(positions.map(|variable| Dependency { variable, kind }));
    }
    Ok(Some(dependencies))
}
