//! Texts of the command line: TOML files from dictionaries, durations.

use pyo3::prelude::*;

use crate::error::{AirloopError, SettingError, raise};

/// TOML text of a table that is given as JSON.
#[pyfunction]
pub fn to_toml(json: &str) -> PyResult<String> {
    let refuse =
        |problem: String| SettingError::new_err(format!("this table cannot be written as TOML: {problem}"));
    let table: toml::Table = serde_json::from_str(json).map_err(|error| refuse(error.to_string()))?;
    toml::to_string(&table).map_err(|error| refuse(error.to_string()))
}

/// JSON text of a TOML file.
#[pyfunction]
pub fn from_toml(text: &str) -> PyResult<String> {
    let refuse = |problem: String| AirloopError::new_err(format!("this is no TOML: {problem}"));
    let table: toml::Table = text.parse().map_err(|error: toml::de::Error| refuse(error.to_string()))?;
    serde_json::to_string(&table).map_err(|error| refuse(error.to_string()))
}

/// Seconds of a duration as the command line writes it, such as `1ms`.
#[pyfunction]
pub fn duration(text: &str) -> PyResult<f64> {
    airloop_series::units::parse_time(text).map_err(raise)
}
