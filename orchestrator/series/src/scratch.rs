//! Temporary folders that do not outlive their process for long: each is removed with its owner, and what a process
//! left behind that was killed is removed by the next one.
//!
//! Files and folders that a process begins elsewhere are [`pending`] until they are complete. A process that has to end
//! at once can [`abandon`] them.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, Once, PoisonError};

use tempfile::TempDir;

/// Begin of the names of all temporary folders.
const PREFIX: &str = "airloop-";

/// A new temporary folder, which is removed when it is dropped.
///
/// The first call in a process also removes the folders of processes that were killed.
///
/// # Errors
/// An error of the file system.
pub fn folder() -> std::io::Result<TempDir> {
    static SWEPT: Once = Once::new();
    SWEPT.call_once(|| sweep(&std::env::temp_dir()));
    tempfile::Builder::new().prefix(&format!("{PREFIX}{}-", owner())).tempdir()
}

/// Files and folders that were begun and are not complete.
static PENDING: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());
/// Folders that were made.
static MADE: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// A file or a folder was begun that means nothing before it is complete.
pub fn pending(path: &Path) {
    PENDING.lock().unwrap_or_else(PoisonError::into_inner).push(path.to_owned());
}

/// A folder was made that is worth nothing while it is empty.
pub fn pending_while_empty(folder: &Path) {
    MADE.lock().unwrap_or_else(PoisonError::into_inner).push(folder.to_owned());
}

/// It is complete, or gone.
pub fn settled(path: &Path) {
    PENDING.lock().unwrap_or_else(PoisonError::into_inner).retain(|own| own != path);
}

/// Removes the temporary folders of this process and all that is pending, as its destructors would; for a process that
/// ends without them.
pub fn abandon() {
    let own = format!("{PREFIX}{}-", owner());
    let entries = std::fs::read_dir(std::env::temp_dir()).into_iter().flatten().flatten();
    let folders = entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(&own));
    remove(&folders.map(|entry| entry.path()).collect::<Vec<_>>(), &[]);
    let [pending, made] = [&PENDING, &MADE].map(|own| own.lock().unwrap_or_else(PoisonError::into_inner));
    remove(&pending, &made);
}

/// Removes files and folders, the latest first, then the folders of `made` that are empty.
fn remove(begun: &[PathBuf], made: &[PathBuf]) {
    for path in begun.iter().rev() {
        let _ = std::fs::remove_file(path).or_else(|_| std::fs::remove_dir_all(path));
    }
    for folder in made.iter().rev() {
        // Only an empty folder can be removed this way.
        let _ = std::fs::remove_dir(folder);
    }
}

/// This process in the name of a folder: the name space of its number, then the number, so that a process never takes
/// the folder of a process in another container for an abandoned one.
fn owner() -> String {
    format!("{}-{}", name_space(), std::process::id())
}

#[cfg(target_os = "linux")]
fn name_space() -> u64 {
    use std::os::unix::fs::MetadataExt;
    std::fs::metadata("/proc/self/ns/pid").map_or(0, |space| space.ino())
}

#[cfg(not(target_os = "linux"))]
fn name_space() -> u64 {
    0
}

/// Removes the folders in `place` whose process is gone. What cannot be removed stays.
fn sweep(place: &Path) {
    let Ok(entries) = std::fs::read_dir(place) else { return };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let Some(parts) = name.to_str().and_then(|name| name.strip_prefix(PREFIX)) else { continue };
        let mut parts = parts.split('-');
        let (Some(space), Some(process)) = (parts.next(), parts.next()) else { continue };
        let (Ok(space), Ok(process)) = (space.parse::<u64>(), process.parse::<u32>()) else { continue };
        if space == name_space() && is_gone(process) {
            let _ = std::fs::remove_dir_all(entry.path());
        }
    }
}

/// Whether no process has this number; where that cannot be known, there is one.
fn is_gone(process: u32) -> bool {
    Path::new("/proc/self").exists() && !Path::new("/proc").join(process.to_string()).exists()
}

#[cfg(test)]
mod tests {
    use super::*;

    // Not by `abandon`, which would take the files of other tests in this process.
    #[test]
    fn what_was_begun_is_removed_and_folders_with_files_of_others_stay() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        for name in ["stage", "empty", "full"] {
            std::fs::create_dir(at(name)).unwrap();
        }
        for name in ["begun", "stage/file", "full/theirs"] {
            std::fs::write(at(name), "text").unwrap();
        }
        remove(&[at("begun"), at("stage"), at("gone")], &[at("empty"), at("full")]);
        let stays = ["begun", "stage", "empty", "full", "full/theirs"].map(|name| at(name).exists());
        assert_eq!(stays, [false, false, false, true, true]);
    }

    #[test]
    fn a_file_is_pending_until_it_has_its_name() {
        let place = tempfile::tempdir().unwrap();
        let is_pending = |path: &Path| PENDING.lock().unwrap().iter().any(|own| own == path);
        let file = crate::file::temporary(place.path()).unwrap();
        let begun = file.path().to_owned();
        assert!(is_pending(&begun));
        crate::file::persist(file, &place.path().join("complete")).unwrap();
        assert!(!is_pending(&begun));
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn folders_of_killed_processes_are_removed_and_others_stay() {
        let place = tempfile::tempdir().unwrap();
        let mut child = std::process::Command::new("true").spawn().unwrap();
        let gone = child.id();
        child.wait().unwrap();
        let make = |name: String| {
            let folder = place.path().join(name);
            std::fs::create_dir_all(folder.join("binaries")).unwrap();
            folder
        };
        let space = name_space();
        let abandoned = make(format!("{PREFIX}{space}-{gone}-abc"));
        let stay = [
            make(format!("{PREFIX}{}-abc", owner())),
            make(format!("{PREFIX}{}-{gone}-abc", space + 1)),
            make(format!("{PREFIX}notes")),
            make("other".to_owned()),
        ];
        sweep(place.path());
        assert!(!abandoned.exists());
        assert!(stay.iter().all(|folder| folder.exists()));
    }
}
