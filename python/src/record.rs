//! Signals from Python: arrays by column, or a CSV file.

use std::path::PathBuf;

use airloop::simulation::Data;
use airloop_series::{TimeSeries, csv, frame};
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;

use crate::error::raise;

/// Signals over time that a run takes as inputs or as measurement.
#[pyclass(frozen, module = "airloop._native")]
pub struct Record {
    /// Path of the file, or what stands for it in messages.
    pub label: PathBuf,
    /// Signals.
    pub series: TimeSeries,
}

#[pymethods]
impl Record {
    /// Reads a CSV file.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Record> {
        let series = py.detach(|| csv::read(&path)).map_err(raise)?;
        Ok(Record { label: path, series })
    }

    /// Columns in memory; `header` is the first line of the CSV file that they could be.
    #[staticmethod]
    fn table(label: PathBuf, header: &str, columns: Vec<PyReadonlyArray1<'_, f64>>) -> PyResult<Record> {
        let columns = columns.iter().map(|column| column.as_array().to_vec()).collect();
        let series = frame::series(header, columns, &label).map_err(raise)?;
        Ok(Record { label, series })
    }
}

impl Record {
    /// The record as the library takes it.
    pub fn data(&self) -> Data<'_> {
        Data { label: &self.label, series: &self.series }
    }
}
