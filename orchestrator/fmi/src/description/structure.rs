//! Reading `ModelStructure`.

use super::{Dependency, DependencyKind, DescriptionError, Unknown};
use crate::xml::Element;

/// The list called `name` (Outputs, Derivatives, InitialUnknowns) of a model with `count` variables.
pub(super) fn read(root: &Element, name: &str, count: usize) -> Result<Vec<Unknown>, DescriptionError> {
    let list = root.child("ModelStructure").and_then(|structure| structure.child(name));
    let Some(list) = list else { return Ok(Vec::new()) };
    list.children("Unknown").map(|element| unknown(name, element, count)).collect()
}

fn unknown(list: &str, element: &Element, count: usize) -> Result<Unknown, DescriptionError> {
    let error = |message: String| DescriptionError {
        line: element.line,
        element: format!(
            "ModelStructure/{list}, Unknown index=\"{}\"",
            element.attribute("index").unwrap_or_default()
        ),
        message,
    };
    let position = |number: usize, what: &str| match number {
        0 => Err(error(format!("{what} 0 where variables count from 1 to {count}"))),
        number if number > count => Err(error(format!("{what} {number} is beyond the {count} variables"))),
        number => Ok(number - 1),
    };
    let index =
        element.integer("index")?.ok_or_else(|| error("the attribute index is missing".to_owned()))?;
    let variable = position(index, "the index")?;
    let kinds = element.attribute("dependenciesKind");
    let Some(numbers) = element.attribute("dependencies") else {
        if kinds.is_some() {
            return Err(error("it has dependenciesKind without dependencies".to_owned()));
        }
        return Ok(Unknown { variable, dependencies: None });
    };
    let numbers = numbers
        .split_whitespace()
        .map(|word| {
            let number =
                word.parse().map_err(|_| error(format!("\"{word}\" in dependencies is not a number")))?;
            position(number, "the dependency")
        })
        .collect::<Result<Vec<_>, _>>()?;
    let kinds = match kinds {
        Some(kinds) => {
            kinds.split_whitespace().map(|word| kind(word).map_err(error)).collect::<Result<Vec<_>, _>>()?
        }
        None => vec![DependencyKind::default(); numbers.len()],
    };
    if kinds.len() != numbers.len() {
        let (kinds, numbers) = (kinds.len(), numbers.len());
        return Err(error(format!("it has {numbers} dependencies and {kinds} words in dependenciesKind")));
    }
    let dependencies = numbers.into_iter().zip(kinds).map(|(variable, kind)| Dependency { variable, kind });
    Ok(Unknown { variable, dependencies: Some(dependencies.collect()) })
}

/// The kind of a dependence by its word.
pub(super) fn kind(word: &str) -> Result<DependencyKind, String> {
    match word {
        "dependent" => Ok(DependencyKind::Dependent),
        "constant" => Ok(DependencyKind::Constant),
        "fixed" => Ok(DependencyKind::Fixed),
        "tunable" => Ok(DependencyKind::Tunable),
        "discrete" => Ok(DependencyKind::Discrete),
        _ => Err(format!(
            "\"{word}\" in dependenciesKind where one of dependent, constant, fixed, tunable, discrete is needed"
        )),
    }
}
