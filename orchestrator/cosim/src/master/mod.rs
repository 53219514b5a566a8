//! Co-simulation masters with a fixed communication step: Gauss-Seidel (serial), Jacobi (parallel) and
//! interface-Jacobian (linearly implicit, with rollback); and the [`monolithic`] coupling through Model Exchange.
//!
//! [`Master`] owns the slaves of a [`SystemGraph`](crate::system::SystemGraph) and steps them; [`simulate::run`] drives
//! any master over a time span with inputs from a series and a recorder (modules `driver`, `fixed`, `adaptive`). What
//! is optimized, plotted or compared is left to the modules above.
//!
//! Values are made consistent at the start by module `propagation`. The co-simulation masters keep to the strict
//! reading of FMI 2.0.5 section 4.2.4: between setting an input and reading an output of a slave there is always a
//! step. Algebraic loops (module `loops`) are the exception, through slaves that were found to allow it.
//!
//! Modules import downward only: this one declares and re-exports.

mod adaptive;
mod driver;
pub mod embedded;
mod error;
mod exchange;
mod extrapolation;
mod fixed;
mod gauss_seidel;
mod grid;
mod initialize;
#[allow(clippy::needless_range_loop, reason = "small matrices are read by row and column")]
mod interface_jacobian;
mod jacobi;
mod loops;
pub mod monolithic;
mod propagation;
mod restart;
mod settings;
pub mod simulate;
mod stepping;
mod stimulus;
mod stop;
mod values;

pub use error::Error;
pub use grid::Grid;
pub use settings::{Adaptive, Algorithm, Coupling, Settings};
pub use stepping::{Effort, Master, Progress};
pub use values::Values;
