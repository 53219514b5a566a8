//! Search for effects missing from any declared system: a `study.toml` names a system of FMUs, records and places where
//! effects may act.
//!
//! [`declaration`] is the file, [`dataset`] reads folders of measured data that come without one, [`read`] makes
//! records, `odd_record` finds one that does not go with the others, [`plant`] evaluates the FMUs, [`ports`] finds
//! where something may be missing, [`plan`] lists that, [`simulate`] integrates them, `linear` along with their
//! derivatives, [`remembered`] keeps what was simulated, `predicted` gives both to the engine, [`fits`] fits,
//! [`catalog`] lists the candidates, [`exact`] asks the engine for the fewest of them that leave nothing but noise.
//! Where there are none, [`search`] chooses by the error on held-out records. [`physical`] refuses models without
//! physical sense, [`noise`] carries the noise of the sensors to the error, [`smoothed`] has the errors of filtered
//! derivatives, [`explain`] finds the variables that the residual depends on.
//!
//! Where that search ends above the noise, [`by_share`] asks the engine's forward selection for the effects that matter
//! in addition to corrections of declared parameters ([`tolerance`]); [`whole`] is the study as one system of the
//! engine. [`answer`] leads through all of it, `assembled` puts the result together, [`replay`] simulates another
//! system on the same records, [`redrawn`] makes records of it. The rig of
//! the vocabulary, whose sensors are known, has a search of its own in `rig`.

pub mod answer;
pub(crate) mod assembled;
mod begin;
pub mod beside;
mod blocks;
pub mod by_share;
pub mod catalog;
pub mod changed;
pub(crate) mod clipping;
pub(crate) mod colored;
mod columns;
pub mod command;
pub mod dataset;
pub mod declaration;
mod driven;
pub mod effects;
pub mod errors;
pub mod exact;
pub mod explain;
pub mod fits;
pub mod force;
mod horizon;
pub mod identified;
pub mod influence;
pub mod initial_guesses;
pub(crate) mod integration;
pub mod kinds;
pub mod law;
mod linear;
mod memory;
mod mistaken;
pub mod model;
pub mod names;
pub mod noise;
mod numbers;
mod observability;
mod odd_record;
mod one_part;
pub mod open;
mod periods;
pub mod physical;
pub mod plan;
pub mod plant;
pub mod ports;
mod predicted;
pub mod prepared;
pub mod read;
pub mod redrawn;
mod remarks;
pub mod remembered;
pub mod replay;
mod rescaled;
mod resolution;
pub(crate) mod ruling;
mod scale;
pub mod search;
pub(crate) mod sensors;
mod settled;
mod sign;
mod sign_change;
pub mod signal;
pub mod simulate;
pub mod smoothed;
mod sparse;
mod spiked;
mod starts;
pub(crate) mod steps;
mod stiffness;
mod taps;
mod time_grid;
pub mod tolerance;
pub mod whole;
mod windowed_periods;
mod with_corrections;

use std::path::Path;

use super::Error;

/// Name of a study in a folder.
pub const STUDY: &str = "study.toml";

/// Problem with a study, without the place in its file.
#[derive(Debug, thiserror::Error)]
pub enum Problem {
    /// The system cannot be studied.
    #[error("{0}")]
    System(String),
    /// A name that is not there.
    #[error("there is no {what} `{name}`; known are: {known}")]
    Name {
        /// Kind of thing that was looked for.
        what: &'static str,
        /// Name as written.
        name: String,
        /// Names that exist.
        known: String,
    },
    /// An FMU fails.
    #[error(transparent)]
    Fmu(Box<airloop_fmi::Error>),
}

impl Problem {
    fn fmu(error: airloop_fmi::Error) -> Problem {
        Problem::Fmu(Box::new(error))
    }

    /// Whether an FMU only refused values, as it does where a model diverges.
    fn is_refusal(&self) -> bool {
        use airloop_fmi::{Error::Call, Status::Discard};
        matches!(self, Problem::Fmu(error) if matches!(&**error, Call(call) if call.status == Discard))
    }

    /// Whether the process of an FMU is gone.
    fn is_loss(&self) -> bool {
        use airloop_fmi::Error::{Dead, Lost};
        matches!(self, Problem::Fmu(error) if matches!(&**error, Lost(_) | Dead { .. }))
    }
}

/// The study that a path means: a `study.toml` (or another `.toml` file), a folder with one, or a folder of measured
/// data with `dataset.toml`; none if it is something else.
///
/// # Errors
/// A file that is no study.
pub fn find(path: &Path) -> Result<Option<declaration::File>, Error> {
    if path.is_file() {
        let toml = path.extension().is_some_and(|ending| ending == "toml");
        let name = path.file_name().and_then(|name| name.to_str());
        return match (toml, name) {
            (true, Some("case.toml")) | (false, _) => Ok(None),
            (true, Some(dataset::NAME)) => dataset::read(path.parent().unwrap_or(Path::new(""))).map(Some),
            (true, _) => declaration::File::read(path).map(Some),
        };
    }
    if path.join(STUDY).is_file() {
        return declaration::File::read(&path.join(STUDY)).map(Some);
    }
    let other = path.join("case.toml").is_file() || !path.join(dataset::NAME).is_file();
    if other { Ok(None) } else { dataset::read(path).map(Some) }
}
