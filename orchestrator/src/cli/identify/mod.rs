//! `airloop identify`: models from measured data.
//!
//! | module | what |
//! |--------|------|
//! | [`arx`] | `identify arx` |
//! | [`data`] | the options that say which data, shared by all |
//! | [`output`] | the folder of the results, shared by all |

pub mod arx;
pub mod data;
pub mod output;
mod report;

use std::process::ExitCode;

use clap::Subcommand;

use crate::Error;

/// `airloop identify ...`
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Fit an ARX model with full matrices and direct term by least squares (eq. 6 to 8).
    ///
    /// A(z) y(k) = B(z) u(k) + e(k) about an operating point: every output depends on the past of all outputs and on
    /// all inputs, from u(k - nk) on (nk = 0: direct term). Several files are several experiments; no equation looks
    /// across their border. Simulated fits start from the first measured samples.
    ///
    /// Writes summary.json (fits under `estimation` and `validation`, coefficients with intervals), model.toml, CSV files
    /// with measured, simulated and predicted outputs, figures as SVG, and index.html with all of them.
    Arx(Box<arx::Args>),
}

/// Runs one of the commands.
///
/// # Errors
/// What keeps it from a result.
pub fn run(command: &Command) -> Result<ExitCode, Error> {
    match command {
        Command::Arx(args) => arx::run(args),
    }
}
