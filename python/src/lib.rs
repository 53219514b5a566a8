//! The extension module `airloop._native`: systems, runs, instances and right-hand sides for Python.
//!
//! A thin layer: every function turns Python values into those of a library crate, calls it with the interpreter's
//! lock released, and turns the answer back. What users call, with its documentation, is in the Python files of
//! `airloop/`; commands that write folders (identify, refine, optimize ...) run the program that lies in the wheel.

mod batch;
mod error;
mod lane;
mod record;
mod rhs;
mod run;
mod simulation;
mod solver;
mod system;
mod text;

use pyo3::prelude::*;

#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<record::Record>()?;
    module.add_class::<system::System>()?;
    module.add_class::<simulation::Simulation>()?;
    module.add_class::<batch::Batch>()?;
    module.add_class::<rhs::Rhs>()?;
    module.add_class::<solver::Solver>()?;
    module.add_function(wrap_pyfunction!(text::to_toml, module)?)?;
    module.add_function(wrap_pyfunction!(text::from_toml, module)?)?;
    module.add_function(wrap_pyfunction!(text::duration, module)?)?;
    error::add(module)
}
