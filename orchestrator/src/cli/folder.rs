//! The folder of the results: it never holds files of two runs.

use std::io::ErrorKind;
use std::path::Path;

use crate::Error;

/// Makes the folder; whether it was not there before.
///
/// # Errors
/// [`Error::OutputFolder`] says what is in the way.
pub fn make(folder: &Path) -> Result<bool, Error> {
    let refused = |problem: String| Error::OutputFolder { folder: folder.into(), problem };
    let made = match folder.metadata() {
        Ok(found) if found.is_dir() => false,
        Ok(_) => return Err(refused("a file of that name is there; choose another folder".into())),
        Err(_) => true,
    };
    std::fs::create_dir_all(folder).map_err(|error| refused(error.to_string()))?;
    Ok(made)
}

/// Removes what an earlier run or identification wrote into the folder: result, model, summary, page, and the figures
/// and files that its summary lists. Files of others stay.
///
/// # Errors
/// [`Error::OutputFolder`] names a file that cannot be removed.
pub fn clear(folder: &Path) -> Result<(), Error> {
    let summary = std::fs::read(folder.join("summary.json")).unwrap_or_default();
    let summary: serde_json::Value = serde_json::from_slice(&summary).unwrap_or_default();
    let listed = ["figures", "files"].into_iter().filter_map(|list| summary[list].as_array()).flatten();
    let plain = |name: &&str| {
        let ending = Path::new(name).extension().and_then(|ending| ending.to_str());
        Path::new(name).file_name() == Some(name.as_ref())
            && ending.is_some_and(|ending| ["svg", "csv", "toml", "fmu"].contains(&ending))
    };
    let listed = listed.filter_map(|name| name.as_str()).filter(plain);
    // The summary goes last: until then it lists what is left.
    for name in listed.chain(["result.csv", "index.html", "summary.json"]) {
        match std::fs::remove_file(folder.join(name)) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                let problem = format!("{name} of an earlier run cannot be removed: {error}");
                return Err(Error::OutputFolder { folder: folder.into(), problem });
            }
            _ => {}
        }
    }
    Ok(())
}
