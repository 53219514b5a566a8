//! Causality, variability and initialization of a variable: the words of both versions of FMI.

use super::{Causality, DescriptionError, Initial, Variability, allowed_initials};
use crate::xml::Element;

/// The words for a causality; the last one is of FMI 3.0 only.
const CAUSALITIES: [(&str, Causality); 7] = [
    ("parameter", Causality::Parameter),
    ("calculatedParameter", Causality::CalculatedParameter),
    ("input", Causality::Input),
    ("output", Causality::Output),
    ("local", Causality::Local),
    ("independent", Causality::Independent),
    ("structuralParameter", Causality::Parameter),
];

/// The causality of a variable.
pub(super) fn causality(element: &Element, is_fmi3: bool) -> Result<Causality, DescriptionError> {
    let words = if is_fmi3 { &CAUSALITIES[..] } else { &CAUSALITIES[..6] };
    Ok(element.word("causality", words)?.unwrap_or(Causality::Local))
}

/// The variability that the file gives.
pub(super) fn variability(element: &Element) -> Result<Option<Variability>, DescriptionError> {
    let words = [
        ("constant", Variability::Constant),
        ("fixed", Variability::Fixed),
        ("tunable", Variability::Tunable),
        ("discrete", Variability::Discrete),
        ("continuous", Variability::Continuous),
    ];
    element.word("variability", &words)
}

/// The attribute `initial` as written.
pub(super) fn declared_initial(element: &Element) -> Result<Option<Initial>, DescriptionError> {
    let words = [("exact", Initial::Exact), ("approx", Initial::Approx), ("calculated", Initial::Calculated)];
    element.word("initial", &words)
}

/// The initialization that holds, given the attribute as written.
pub(super) fn initial(
    causality: Causality,
    variability: Variability,
    declared: Option<Initial>,
) -> Option<Initial> {
    let allowed = allowed_initials(causality, variability).unwrap_or_default();
    declared.filter(|initial| allowed.contains(initial)).or(allowed.first().copied())
}
