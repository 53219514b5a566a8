//! Files of a stabilized system.

use std::path::{Path, PathBuf};

use crate::Error;

/// Settings of the controller, in a folder of `airloop stabilize`.
pub const SETTINGS: &str = "settings.toml";
/// Closed loop, in a folder of `airloop stabilize`: with the FMUs where they were, or with them inside.
pub const SYSTEMS: [&str; 2] = ["closed_loop.ssd", "closed_loop.ssp"];

/// The closed loop and the settings: of a folder of `airloop stabilize`, or a system with settings of its own.
///
/// # Errors
/// A path that is not there, a folder without closed loop, or a system without settings.
pub fn sources(system: &Path, settings: Option<&Path>) -> Result<(PathBuf, PathBuf), Error> {
    let refused =
        |problem: &str| Error::Place { place: system.display().to_string(), problem: problem.to_owned() };
    if !system.exists() {
        return Err(refused("there is no such file or folder"));
    }
    if !system.is_dir() {
        let missing = "a system alone does not say what is perturbed; give --settings FILE";
        return Ok((system.into(), settings.ok_or_else(|| refused(missing))?.into()));
    }
    let found = SYSTEMS.iter().map(|name| system.join(name)).find(|file| file.exists());
    let found = found
        .ok_or_else(|| refused("there is no closed loop in it; give a folder of `airloop stabilize`"))?;
    Ok((found, settings.map_or_else(|| system.join(SETTINGS), Path::to_owned)))
}
