//! Reading `modelDescription.xml`.

use super::{DescriptionError, ModelDescription};

impl ModelDescription {
    /// Reads the bytes of a `modelDescription.xml`.
    ///
    /// # Errors
    /// The first defect that makes the FMU unusable, with line and element.
    pub fn parse(xml: &[u8]) -> Result<ModelDescription, DescriptionError> {
        let _ = xml;
        Err(DescriptionError { line: 1, element: "fmiModelDescription".into(), message: "not read".into() })
    }
}
