//! Faults that make a model description unusable.

/// A defect of `modelDescription.xml` that makes the FMU unusable.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("modelDescription.xml, line {line}, {element}: {message}")]
pub struct DescriptionError {
    /// Line in the file, from 1.
    pub line: usize,
    /// Element, with the variable's name where it has one.
    pub element: String,
    /// Fault, allowed values and remedy.
    pub message: String,
}
