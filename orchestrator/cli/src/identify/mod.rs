//! `airloop identify`: models from measured data.
//!
//! | module | what |
//! |--------|------|
//! | [`arx`] | `identify arx` |
//! | [`state_space`] | `identify state-space` |
//! | [`compare`] | `identify compare` |
//! | [`data`] | the options that say which data, shared by all |
//! | [`friction`] | `identify friction` |
//! | [`linear_fmu`] | the FMU of a linear model |
//! | [`output`] | the folder of the results, shared by all |

pub mod arx;
pub mod compare;
pub mod data;
pub mod friction;
pub mod linear_fmu;
pub mod output;
mod report;
pub mod state_space;

use std::process::ExitCode;

use clap::Subcommand;

use airloop::Error;

/// `airloop identify ...`
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Fit an ARX model with full matrices and direct term by least squares (eq. 6 to 8).
    ///
    /// A(z) y(k) = B(z) u(k) + e(k) about an operating point: every output depends on the past of all outputs and on
    /// all inputs, from u(k - nk) on (nk = 0: direct term). Several files are several experiments; no equation looks
    /// across their border. Simulated fits start from the first measured samples.
    ///
    /// Writes summary.json (fits under `estimation` and `validation`, coefficients with intervals), model.toml, CSV
    /// files with measured, simulated and predicted outputs, figures as SVG, and index.html with all of them.
    Arx(Box<arx::Args>),
    /// Fit Coulomb and viscous friction (eq. 2) to records of force and motion.
    ///
    /// Position and velocity are smoothed first (a Kalman smoother that looks ahead as far as back); the spread that is
    /// left of the velocity enters the fit, so that its noise does not flatten the sign change. c1, c2 and c4 are never
    /// negative. With validation records, what might be added to eq. 2 (Stribeck, pressure, position, asymmetry,
    /// presliding) is tried and offered where it helps clearly.
    ///
    /// Writes summary.json (parameters with intervals, fits under `estimation` and `validation`, flags, alternatives),
    /// friction.toml, CSV files with the smoothed motion and forces, figures as SVG, index.html, and with --fmu an FMU.
    Friction(Box<friction::Args>),
    /// Fit a state-space model by subspace methods (N4SID, MOESP, CVA), refined by output error.
    ///
    /// x(k+1) = A x(k) + B u(k) + K e(k), y(k) = C x(k) + D u(k) + e(k) about an operating point. Several files are
    /// several experiments, each with its own initial state, which is fitted also for the validation. Weighting and
    /// horizon are those with the least simulation error on the estimation data.
    ///
    /// Writes the same model, tables and page as `identify arx`, with figures of singular values, orders, and the
    /// correlation of residuals (residuals.svg, residuals_and_inputs.svg).
    StateSpace(Box<state_space::Args>),
    /// Compare ARX and state-space models of rising order on validation data (Fig. 5): which order is enough?
    ///
    /// ARX models by least squares, state-space models as by `identify state-space`. Unstable models are marked and
    /// have no simulated fit.
    ///
    /// Writes compare.csv, summary.json, figures as SVG, and index.html.
    Compare(Box<compare::Args>),
}

/// Runs one of the commands.
///
/// # Errors
/// Fails if there is no result.
pub fn run(command: &mut Command) -> Result<ExitCode, Error> {
    let data = match command {
        Command::Arx(args) => Some(&mut args.data),
        Command::StateSpace(args) => Some(&mut args.data),
        Command::Compare(args) => Some(&mut args.data),
        Command::Friction(_) => None,
    };
    // The files on a grid are there until the command ends.
    let _scratch = data.map(data::DataArgs::resample_files).transpose()?;
    match command {
        Command::Arx(args) => arx::run(args),
        Command::Friction(args) => friction::run(args),
        Command::StateSpace(args) => state_space::run(args),
        Command::Compare(args) => compare::run(args),
    }
}
