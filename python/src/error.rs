//! Exceptions: one class per kind of trouble, with the texts of the command line.

use airloop::Error;
use airloop_cosim::master;
use airloop_plan as plan;
use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;

create_exception!(airloop, AirloopError, PyException, "Any error of airloop.");
create_exception!(
    airloop,
    FmuError,
    AirloopError,
    "An FMU cannot be opened, or one of its functions failed."
);
create_exception!(
    airloop,
    SystemFileError,
    AirloopError,
    "A system cannot be read, or a name in it is unknown."
);
create_exception!(
    airloop,
    RecordError,
    AirloopError,
    "Data that cannot be used: columns, units, times, values."
);
create_exception!(airloop, SettingError, AirloopError, "A setting that is out of range or does not exist.");
create_exception!(airloop, SimulationError, AirloopError, "A simulation that failed after it began.");
create_exception!(airloop, ClosedError, AirloopError, "A simulation that was closed or has ended.");

/// Adds the classes to the module.
pub fn add(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add("AirloopError", py.get_type::<AirloopError>())?;
    module.add("FmuError", py.get_type::<FmuError>())?;
    module.add("SystemFileError", py.get_type::<SystemFileError>())?;
    module.add("RecordError", py.get_type::<RecordError>())?;
    module.add("SettingError", py.get_type::<SettingError>())?;
    module.add("SimulationError", py.get_type::<SimulationError>())?;
    module.add("ClosedError", py.get_type::<ClosedError>())
}

/// The exception of an error of the library.
pub fn raise(error: impl Into<Error>) -> PyErr {
    let error = error.into();
    let text = error.to_string();
    match error {
        Error::Fmu(_) | Error::Master(master::Error::Fmu(_)) => FmuError::new_err(text),
        Error::System(_)
        | Error::Coupled(_)
        | Error::Plan(plan::Error::System(_) | plan::Error::Coupled(_)) => SystemFileError::new_err(text),
        Error::Plan(plan::Error::File { .. } | plan::Error::Place { .. } | plan::Error::Transcription(_)) => {
            SettingError::new_err(text)
        }
        Error::Csv(_) | Error::Series(_) | Error::Discrepancy(_) | Error::Fit(_) => {
            RecordError::new_err(text)
        }
        Error::Duration(_)
        | Error::Master(master::Error::Setting { .. } | master::Error::OptionOfOther { .. }) => {
            SettingError::new_err(text)
        }
        Error::Master(_) => SimulationError::new_err(text),
        _ => AirloopError::new_err(text),
    }
}
