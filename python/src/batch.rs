//! Many instances of a system side by side, stepped by several threads.

use std::sync::{Arc, Mutex};

use airloop_cosim::master::Settings;
use airloop_cosim::master::embedded::{Place, Reader};
use airloop_cosim::system::SystemGraph;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use rayon::prelude::*;

use crate::error::{AirloopError, ClosedError, SettingError, raise};
use crate::lane::{Lane, Names, Stop, checked};
use crate::system::started;

/// Instances of one system.
#[pyclass(frozen, module = "airloop._native")]
pub struct Batch {
    graph: Arc<SystemGraph>,
    settings: Settings,
    names: Names,
    lanes: Mutex<Vec<Lane>>,
    size: usize,
    pool: rayon::ThreadPool,
    threads: usize,
}

/// A stop and the number of the instance.
type LaneStop = (usize, Stop);

impl Batch {
    /// Makes `batch` instances.
    ///
    /// # Errors
    /// No instance wanted, or one that fails.
    pub fn open(
        py: Python<'_>,
        graph: Arc<SystemGraph>,
        settings: &Settings,
        batch: usize,
        threads: Option<usize>,
    ) -> PyResult<Batch> {
        if batch == 0 || threads == Some(0) {
            return Err(SettingError::new_err("batch and threads must be at least 1"));
        }
        let all = std::thread::available_parallelism().map_or(1, usize::from);
        let threads = threads.unwrap_or(all).min(batch);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool =
            pool.map_err(|error| AirloopError::new_err(format!("no threads for the batch: {error}")))?;
        let make = |_| Lane::new(&graph, settings);
        let lanes = py.detach(|| (0..batch).map(make).collect::<Result<Vec<_>, _>>()).map_err(raise)?;
        let names = Names::new(&graph);
        let (settings, lanes) = (*settings, Mutex::new(lanes));
        Ok(Batch { graph, settings, names, lanes, size: batch, pool, threads })
    }

    /// The instances, at least one, without the interpreter's lock and in the threads of the batch.
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut [Lane]) -> Result<T, LaneStop> + Send,
    ) -> PyResult<T> {
        let done = py.detach(|| {
            let mut lanes = self.lanes.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            (!lanes.is_empty()).then(|| work(&mut lanes))
        });
        let closed = "the batch is closed; make a new one with system.instantiate(batch=...)";
        let done = done.ok_or_else(|| ClosedError::new_err(closed))?;
        done.map_err(|(lane, stop)| {
            let error = stop.raise();
            let text = format!("instance {lane}: {}", error.value(py));
            PyErr::from_type(error.get_type(py), text)
        })
    }

    /// Does the same with every instance, chunk by chunk.
    fn each(
        &self,
        lanes: &mut [Lane],
        work: impl Fn(usize, &mut Lane) -> Result<(), Stop> + Sync,
    ) -> Result<(), LaneStop> {
        let length = lanes.len().div_ceil(self.threads);
        self.pool.install(|| {
            lanes.par_chunks_mut(length).enumerate().try_for_each(|(chunk, lanes)| {
                let numbered =
                    lanes.iter_mut().enumerate().map(|(index, lane)| (chunk * length + index, lane));
                for (number, lane) in numbered {
                    work(number, lane).map_err(|stop| (number, stop))?;
                }
                Ok(())
            })
        })
    }

    fn checked_column(&self, name: &str, values: &[f64]) -> PyResult<usize> {
        let input = self.names.input(name)?;
        values.iter().try_for_each(|value| checked(&self.graph, input, *value).map(drop))?;
        Ok(input)
    }
}

#[pymethods]
impl Batch {
    #[getter]
    fn size(&self) -> usize {
        self.size
    }

    #[getter]
    fn threads(&self) -> usize {
        self.threads
    }

    /// Times of the instances \[s\].
    fn time<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let times = self.with(py, |lanes| Ok(lanes.iter().map(Lane::time).collect::<Vec<_>>()))?;
        Ok(PyArray1::from_vec(py, times))
    }

    /// Whether a component has ended the simulation, by instance.
    fn ended<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let ended =
            self.with(py, |lanes| Ok(lanes.iter().map(|lane| lane.ended().is_some()).collect::<Vec<_>>()))?;
        Ok(PyArray1::from_vec(py, ended))
    }

    /// Sets an input, one value per instance.
    fn set(&self, py: Python<'_>, name: &str, values: PyReadonlyArray1<'_, f64>) -> PyResult<()> {
        let values = values.as_array().to_vec();
        if values.len() != self.size {
            let (found, size) = (values.len(), self.size);
            return Err(SettingError::new_err(format!(
                "`{name}` has {found} values; give one for each of the {size} instances, or a number"
            )));
        }
        let input = self.checked_column(name, &values)?;
        self.with(py, |lanes| {
            lanes.iter_mut().zip(&values).for_each(|(lane, value)| lane.set(input, *value));
            Ok(())
        })
    }

    /// Steps all instances on; those that have ended stay where they are.
    #[pyo3(signature = (step=None, count=1))]
    fn step(&self, py: Python<'_>, step: Option<f64>, count: u64) -> PyResult<()> {
        self.with(py, |lanes| {
            self.each(lanes, |_, lane| if lane.ended().is_some() { Ok(()) } else { lane.step(step, count) })
        })?;
        py.check_signals()
    }

    /// Values of one name, one per instance.
    fn get<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let place = self.names.place(name)?;
        let values = self.with(py, |lanes| {
            let reader = lanes[0].reader(&self.graph, place);
            let one = |(index, lane): (usize, &mut Lane)| {
                lane.number(reader).map_err(|error| (index, Stop::Failed(error)))
            };
            lanes.iter_mut().enumerate().map(one).collect::<Result<Vec<_>, _>>()
        })?;
        Ok(PyArray1::from_vec(py, values))
    }

    /// Steps all instances under inputs `[steps, batch]` and returns the values of `names` at the start and after
    /// every step, each `[steps + 1, batch]`.
    fn rollout<'py>(
        &self,
        py: Python<'py>,
        inputs: Vec<(String, PyReadonlyArray2<'py, f64>)>,
        names: Vec<String>,
        steps: usize,
    ) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
        let mut columns = Vec::new();
        for (name, values) in &inputs {
            let values = values.as_array();
            if values.dim() != (steps, self.size) {
                let (shape, wanted) = (values.dim(), (steps, self.size));
                return Err(SettingError::new_err(format!(
                    "`{name}` has the shape {shape:?}; it must be {wanted:?}: steps, instances"
                )));
            }
            let values: Vec<f64> = values.iter().copied().collect();
            columns.push((self.checked_column(name, &values)?, values));
        }
        let places = names.iter().map(|name| self.names.place(name)).collect::<PyResult<Vec<Place>>>()?;
        let (rows, size) = (steps + 1, self.size);
        let per_lane = self.with(py, |lanes| {
            let slots: Vec<Mutex<Vec<f64>>> = (0..size).map(|_| Mutex::default()).collect();
            let readers: Vec<Reader> =
                places.iter().map(|&place| lanes[0].reader(&self.graph, place)).collect();
            self.each(lanes, |number, lane| {
                let mut values = Vec::with_capacity(rows * places.len());
                for row in 0..rows {
                    if row > 0 && lane.ended().is_none() {
                        for (input, column) in &columns {
                            lane.set(*input, column[(row - 1) * size + number]);
                        }
                        lane.step(None, 1)?;
                    }
                    for &reader in &readers {
                        values.push(lane.number(reader).map_err(Stop::Failed)?);
                    }
                }
                *slots[number].lock().unwrap_or_else(std::sync::PoisonError::into_inner) = values;
                Ok(())
            })?;
            Ok(slots.into_iter().map(|slot| slot.into_inner().unwrap_or_default()).collect::<Vec<_>>())
        })?;
        let table = |value: usize| {
            let cell = |row: usize, lane: usize| per_lane[lane][row * places.len() + value];
            let flat: Vec<f64> = (0..rows)
                .flat_map(|row| (0..size).map(move |lane| (row, lane)))
                .map(|(row, lane)| cell(row, lane))
                .collect();
            PyArray1::from_vec(py, flat).reshape([rows, size])
        };
        use numpy::PyArrayMethods;
        (0..places.len()).map(table).collect()
    }

    /// Times and states of the instances `which` as bytes.
    fn save<'py>(&self, py: Python<'py>, which: Vec<usize>) -> PyResult<Vec<(f64, Bound<'py, PyBytes>)>> {
        let saved = self.with(py, |lanes| {
            let one = |&number: &usize| lanes[number].save().map_err(|error| (number, Stop::Failed(error)));
            which.iter().map(one).collect::<Result<Vec<_>, _>>()
        })?;
        Ok(saved.into_iter().map(|(time, bytes)| (time, PyBytes::new(py, &bytes))).collect())
    }

    /// Returns the instances `which` to saved states, one for each; those before a state that is refused have theirs.
    fn restore(&self, py: Python<'_>, which: Vec<usize>, saved: Vec<(f64, Vec<u8>)>) -> PyResult<()> {
        let done = self.with(py, |lanes| {
            for (&number, (time, bytes)) in which.iter().zip(&saved) {
                let failed = |error| (number, Stop::Failed(error));
                if !lanes[number].restore(*time, bytes).map_err(failed)? {
                    return Ok(false);
                }
            }
            Ok(true)
        })?;
        let refused =
            || SettingError::new_err("this state is not one of this system; give what save() returned");
        done.then_some(()).ok_or_else(refused)
    }

    /// Makes the instances `which` anew, at the start time and with the start values `set`, one for each of them; all
    /// stay as they are if one cannot be made.
    fn reset(&self, py: Python<'_>, which: Vec<usize>, set: Vec<(String, Vec<f64>)>) -> PyResult<()> {
        let graphs = (0..which.len()).map(|k| {
            let own: Vec<(String, String)> =
                set.iter().map(|(name, values)| (name.clone(), values[k].to_string())).collect();
            if own.is_empty() {
                Ok(Arc::clone(&self.graph))
            } else {
                started(&self.graph, &own).map(Arc::new)
            }
        });
        let graphs = graphs.collect::<PyResult<Vec<_>>>()?;
        self.with(py, |lanes| {
            let make = |(&number, graph): (&usize, &Arc<SystemGraph>)| {
                Lane::new(graph, &self.settings).map_err(|error| (number, Stop::Failed(error)))
            };
            let made = self.pool.install(|| {
                which.par_iter().zip(&graphs).map(make).collect::<Result<Vec<Lane>, LaneStop>>()
            })?;
            which.iter().zip(made).for_each(|(&number, lane)| lanes[number] = lane);
            Ok(())
        })
    }

    /// Frees the instances.
    fn close(&self, py: Python<'_>) {
        py.detach(|| self.lanes.lock().unwrap_or_else(std::sync::PoisonError::into_inner).clear());
    }
}
