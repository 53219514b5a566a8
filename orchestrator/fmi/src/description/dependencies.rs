//! `dependencies` and `dependenciesKind` of an entry of `ModelStructure`.

use super::{DependencyKind, DescriptionError};
use crate::xml::Element;

/// The words of `dependencies` with their kinds; `None` where nothing is said. Errors are made by `error`.
pub(super) fn read(
    element: &Element,
    error: impl Fn(String) -> DescriptionError,
) -> Result<Option<Vec<(&str, DependencyKind)>>, DescriptionError> {
    let kinds = element.attribute("dependenciesKind");
    let Some(words) = element.attribute("dependencies") else {
        return match kinds {
            Some(_) => Err(error("it has dependenciesKind without dependencies".to_owned())),
            None => Ok(None),
        };
    };
    let words: Vec<&str> = words.split_whitespace().collect();
    let kinds = match kinds {
        Some(kinds) => {
            kinds.split_whitespace().map(|word| kind(word).map_err(&error)).collect::<Result<Vec<_>, _>>()?
        }
        None => vec![DependencyKind::default(); words.len()],
    };
    if kinds.len() != words.len() {
        let (kinds, words) = (kinds.len(), words.len());
        return Err(error(format!("it has {words} dependencies and {kinds} words in dependenciesKind")));
    }
    Ok(Some(words.into_iter().zip(kinds).collect()))
}

fn kind(word: &str) -> Result<DependencyKind, String> {
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
