//! Temporary folders that do not outlive their process for long: each is removed with its owner, and what a process
//! left behind that was killed is removed by the next one.

use std::path::Path;
use std::sync::Once;

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
