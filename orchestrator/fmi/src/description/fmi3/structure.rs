//! `ModelStructure` of FMI 3.0: by value reference, arrays as a whole.

use super::super::{Dependency, DescriptionError, Unknown, dependencies};
use super::variables::Read;
use crate::xml::Element;

/// All elements called `name`, one entry for each element of an array. An element of an array depends on every element
/// of the arrays that its variable depends on. Unread variables are left out.
pub(super) fn read(root: &Element, name: &str, read: &Read) -> Result<Vec<Unknown>, DescriptionError> {
    let Some(structure) = root.child("ModelStructure") else { return Ok(Vec::new()) };
    let mut unknowns = Vec::new();
    for element in structure.children(name) {
        let reference = element.value_reference()?;
        let dependencies = of(element, read)?;
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

fn of(element: &Element, read: &Read) -> Result<Option<Vec<Dependency>>, DescriptionError> {
    let Some(words) = dependencies::read(element, |message| element.error(message))? else { return Ok(None) };
    let mut dependencies = Vec::new();
    for (word, kind) in words {
        let reference = word
            .parse()
            .map_err(|_| element.error(format!("\"{word}\" in dependencies is not a value reference")))?;
        let positions = read.positions(reference).ok_or_else(|| unknown_reference(element, reference))?;
        dependencies.extend(positions.map(|variable| Dependency { variable, kind }));
    }
    Ok(Some(dependencies))
}
