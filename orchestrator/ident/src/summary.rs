//! Summary of an identification, for `summary.json`.

use std::path::Path;

use nalgebra::DMatrix;
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::model::file::rows;
use super::model::{Linear, NamedModel};
use super::record::Experiments;
use super::score::{Score, score};

/// Version of the layout of this file; grows when a field changes its meaning.
pub const SCHEMA_VERSION: u32 = 1;

/// Result of one identification of a linear model.
#[derive(Debug, Clone, Default, Serialize)]
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
    pub structure: Value,
    /// Whether all poles are inside the unit circle.
    pub stable: bool,
    /// Fits on the records that the model was estimated from.
    pub estimation: Score,
    /// Fits on records that were not used for the estimation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub validation: Option<Score>,
    /// Coefficients: `A1`.., `B0`.. as rows, or `A`, `B`, `C`, `D`, `K`; with `input_offset`, `output_offset`.
    pub coefficients: Value,
    /// Standard deviations and 95 % intervals of the coefficients, residual tests, poles and zeros.
    #[serde(skip_serializing_if = "Value::is_null")]
    pub diagnostics: Value,
    /// Findings in the data, one sentence each.
    pub verdict: Vec<String>,
    /// Warnings that the user should know before trusting the result, one sentence each.
    pub warnings: Vec<String>,
    /// Files of the figures in the folder of the summary.
    pub figures: Vec<String>,
    /// Other files in the folder of the summary.
    pub files: Vec<String>,
}

impl Summary {
    /// A summary that knows what was identified from what, and how well it fits; the rest is left empty.
    pub fn of(method: &str, model: &NamedModel, data: &Experiments) -> Summary {
        let as_model = model.model.as_model();
        let outputs = &data.outputs;
        Summary {
            schema_version: SCHEMA_VERSION,
            airloop_version: env!("CARGO_PKG_VERSION").into(),
            method: method.into(),
            inputs: data.inputs.clone(),
            outputs: outputs.clone(),
            sample_time: data.sample_time,
            stable: as_model.is_stable(),
            estimation: score(as_model, &data.estimation, outputs),
            validation: (!data.validation.is_empty()).then(|| score(as_model, &data.validation, outputs)),
            coefficients: coefficients(&model.model),
            warnings: data.notes.clone(),
            ..Summary::default()
        }
    }
}

/// All matrices by their names, as rows, and the operating point.
pub fn coefficients(model: &Linear) -> Value {
    let mut values = Map::new();
    let (input_offset, output_offset) = match model {
        Linear::Arx(arx) => {
            values.extend(numbered("A", 1, &arx.a).chain(numbered("B", 0, &arx.b)));
            (&arx.input_offset, &arx.output_offset)
        }
        Linear::StateSpace(space) => {
            let named = [("A", &space.a), ("B", &space.b), ("C", &space.c), ("D", &space.d)];
            let gain = space.gain.as_ref().map(|gain| ("K", gain));
            values.extend(named.into_iter().chain(gain).map(|(name, m)| (name.to_owned(), json!(rows(m)))));
            (&space.input_offset, &space.output_offset)
        }
    };
    values.insert("input_offset".into(), json!(input_offset));
    values.insert("output_offset".into(), json!(output_offset));
    Value::Object(values)
}

/// Matrices as `A1`, `A2` .. or `B0`, `B1` ..: `name` with a number from `first` on, each matrix a list of its rows.
pub fn numbered<'a>(
    name: &'a str,
    first: usize,
    matrices: &'a [DMatrix<f64>],
) -> impl Iterator<Item = (String, Value)> + 'a {
    matrices.iter().enumerate().map(move |(k, matrix)| (format!("{name}{}", k + first), json!(rows(matrix))))
}

/// Writes `summary.json`.
///
/// # Errors
/// An error of the file system.
pub fn write(summary: &Summary, path: &Path) -> std::io::Result<()> {
    airloop_series::file::write_json(path, summary)
}
