//! Reading `ModelStructure`.

use super::{Dependency, DescriptionError, Unknown, dependencies};
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
    let Some(words) = dependencies::read(element, error)? else {
        return Ok(Unknown { variable, dependencies: None });
    };
    let dependency = |(word, kind): (&str, _)| {
        let number =
            word.parse().map_err(|_| error(format!("\"{word}\" in dependencies is not a number")))?;
        Ok(Dependency { variable: position(number, "the dependency")?, kind })
    };
    Ok(Unknown { variable, dependencies: Some(words.into_iter().map(dependency).collect::<Result<_, _>>()?) })
}
