//! The folder of the results: it never holds files of two runs, and files of the user stay.

use std::collections::BTreeSet;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use airloop::Error;

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

/// Refuses a folder in which the files `names` would replace something that is not an earlier result, or in which an
/// input lies that would be replaced or removed with the earlier result.
///
/// # Errors
/// [`Error::OutputFolder`] names the file.
pub fn check(folder: &Path, inputs: &[PathBuf], names: &[String]) -> Result<(), Error> {
    check_against(folder, inputs, names, &earlier(folder))
}

/// Same as [`check()`], where what may be replaced is known otherwise than by a summary.
///
/// # Errors
/// Same as [`check()`].
pub fn check_against(
    folder: &Path,
    inputs: &[PathBuf],
    names: &[String],
    ours: &BTreeSet<String>,
) -> Result<(), Error> {
    let refused = |problem: String| Err(Error::OutputFolder { folder: folder.into(), problem });
    let inputs: Vec<PathBuf> = inputs.iter().filter_map(|input| input.canonicalize().ok()).collect();
    for name in names.iter().chain(ours) {
        if folder.join(name).canonicalize().is_ok_and(|path| inputs.contains(&path)) {
            return refused(format!(
                "`{name}` in it is read by this command, and its results would replace it; choose another folder"
            ));
        }
    }
    for name in names.iter().filter(|name| !ours.contains(*name)) {
        if folder.join(name).symlink_metadata().is_ok() {
            return refused(format!(
                "`{name}` is there, is not part of an earlier result, and would be replaced; choose another folder"
            ));
        }
    }
    Ok(())
}

/// Files of the earlier result in the folder: result, summary, page, and what the summary lists.
fn earlier(folder: &Path) -> BTreeSet<String> {
    let summary = std::fs::read(folder.join("summary.json")).unwrap_or_default();
    let summary: serde_json::Value = serde_json::from_slice(&summary).unwrap_or_default();
    if !summary["airloop_version"].is_string() {
        return BTreeSet::new();
    }
    let listed = ["figures", "files"].into_iter().filter_map(|list| summary[list].as_array()).flatten();
    let plain = |name: &&str| {
        let ending = Path::new(name).extension().and_then(|ending| ending.to_str());
        Path::new(name).file_name() == Some(name.as_ref())
            && ending.is_some_and(|ending| ["svg", "csv", "toml", "fmu", "ssd", "ssp"].contains(&ending))
    };
    let listed = listed.filter_map(|name| name.as_str()).filter(plain);
    listed.chain(["result.csv", "index.html", "summary.json"]).map(str::to_owned).collect()
}

/// Removes what an earlier run or identification wrote into the folder: result, model, summary, page, and the figures
/// and files that its summary lists. Files of others stay.
///
/// # Errors
/// [`Error::OutputFolder`] names a file that cannot be removed.
pub fn clear(folder: &Path) -> Result<(), Error> {
    let mut names: Vec<String> = earlier(folder).into_iter().collect();
    // The summary goes last: until then it lists what is left.
    names.sort_by_key(|name| name == "summary.json");
    for name in names {
        match std::fs::remove_file(folder.join(&name)) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                let problem = format!("{name} of an earlier run cannot be removed: {error}");
                return Err(Error::OutputFolder { folder: folder.into(), problem });
            }
            _ => {}
        }
    }
    Ok(())
}
