//! Errors of deriving an FMU.

use std::path::PathBuf;

/// Reason why an FMU was not derived. Nothing was written.
#[derive(Debug, thiserror::Error)]
pub enum DeriveError {
    /// The template is not a readable FMU.
    #[error("the template cannot be used: {0}")]
    Template(#[source] Box<crate::Error>),
    /// A library that would not look at the start values.
    #[error(
        "{}: its generationTool is \"{tool}\", but only FMI 2.0 libraries made with {} read start values from their resources; \
         use one of the FMUs of `make fmu`, or set the values in a parameter set (.ssv) instead",
        path.display(), super::EXPORTER
    )]
    Exporter {
        /// The template.
        path: PathBuf,
        /// Generation tool that the FMU names.
        tool: String,
    },
    /// A name or description that an FMU cannot have.
    #[error("the {what} {text:?} of the derived FMU is refused: {reason}")]
    Text {
        /// Kind of text that was given.
        what: &'static str,
        /// Its text.
        text: String,
        /// Fault of the text.
        reason: &'static str,
    },
    /// A start value for nothing.
    #[error("{}: there is no variable `{variable}`; `airloop inspect` lists all{hint}", path.display())]
    Unknown {
        /// The template.
        path: PathBuf,
        /// Name that was given.
        variable: String,
        /// The same name in another spelling, where there is one.
        hint: String,
    },
    /// A start value for what the model computes.
    #[error("{}: `{variable}` is computed by the model and has no start value; give one of its inputs, parameters or states", path.display())]
    Computed {
        /// The template.
        path: PathBuf,
        /// Name that was given.
        variable: String,
    },
    /// Two start values for one variable.
    #[error("`{variable}` is given twice; keep one of the start values")]
    Twice {
        /// Name that was given.
        variable: String,
    },
    /// A value of another type or out of range.
    #[error("{}: `{variable}` = {value} is refused; allowed: {allowed}", path.display())]
    Value {
        /// The template.
        path: PathBuf,
        /// Variable.
        variable: String,
        /// Value that was given.
        value: String,
        /// Values that it accepts.
        allowed: String,
    },
    /// The start values inside a derived template.
    #[error("{}: resources/start_values.toml of the template cannot be used: {problem}", path.display())]
    StartValues {
        /// The template.
        path: PathBuf,
        /// Fault.
        problem: String,
    },
    /// The model description could be read but not rewritten.
    #[error("{}: modelDescription.xml cannot be rewritten: {problem}", path.display())]
    Xml {
        /// The template.
        path: PathBuf,
        /// Fault.
        problem: String,
    },
    /// A file that cannot be read or written.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Message of the operating system.
        source: std::io::Error,
    },
}
