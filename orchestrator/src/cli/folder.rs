//! The folder of the results: it never holds files of two runs.

use std::io::ErrorKind;
use std::path::Path;

use crate::Error;
use crate::results::summary;

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

/// Removes what an earlier run wrote into the folder: result, summary, page, and the figures that its summary lists.
/// Files of others stay.
///
/// # Errors
/// [`Error::OutputFolder`] names a file that cannot be removed.
pub fn clear(folder: &Path) -> Result<(), Error> {
    let listed = summary::read(&folder.join("summary.json")).map_or_else(|_| Vec::new(), |old| old.figures);
    let plain = |name: &String| name.ends_with(".svg") && Path::new(name).file_name() == Some(name.as_ref());
    let figures = listed.into_iter().filter(plain);
    // The summary goes last: until then it lists what is left.
    let own = ["result.csv", "index.html", "summary.json"].map(str::to_owned);
    for name in figures.chain(own) {
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
