//! What an identification reports, for `summary.json`.

use serde::Serialize;

use super::score::Score;

/// Version of the layout of this file; grows when a field changes its meaning.
pub const SCHEMA_VERSION: u32 = 1;

/// Result of one identification of a linear model.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    /// [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// Version of airloop.
    pub airloop_version: String,
    /// `arx` or `state-space`, and how it was estimated, e.g. `arx, least squares`.
    pub method: String,
    /// Input names, shape \[n_u\].
    pub inputs: Vec<String>,
    /// Output names, shape \[n_y\].
    pub outputs: Vec<String>,
    /// Sample time \[s\].
    pub sample_time: f64,
    /// Structure: `na`, `nb`, `nk`, or `order`.
    pub structure: serde_json::Value,
    /// Whether all poles are inside the unit circle.
    pub stable: bool,
    /// Fits on the records that the model was estimated from.
    pub estimation: Score,
    /// Fits on records that were not used for the estimation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub validation: Option<Score>,
    /// Coefficients: `A1`.., `B0`.. as rows, or `A`, `B`, `C`, `D`, `K`; with `input_offset`, `output_offset`.
    pub coefficients: serde_json::Value,
    /// Standard deviations and 95 % intervals of the coefficients, residual tests, poles and zeros.
    #[serde(skip_serializing_if = "serde_json::Value::is_null")]
    pub diagnostics: serde_json::Value,
    /// What the data say, one sentence each.
    pub verdict: Vec<String>,
    /// What the user should know before trusting the result, one sentence each.
    pub warnings: Vec<String>,
    /// Files of the figures in the folder of the summary.
    pub figures: Vec<String>,
}
