//! The folder of the results: it never holds files of two runs, files of the user stay, and an earlier result is there
//! until the new one is complete.
//!
//! Results are written into a hidden folder and moved when all are there. Only what the summary of an earlier result
//! lists may be replaced. A command that is killed leaves the earlier result, or a move that the next command
//! completes.

use std::collections::BTreeSet;
use std::fs::{File, TryLockError};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use airloop::Error;
use airloop_series::scratch;
use serde::{Deserialize, Serialize};
use tempfile::TempDir;

/// Begin of the name of the hidden folder.
const STAGE: &str = ".airloop-new-";
/// File in the hidden folder that says that all is there: the list of what is moved.
const COMPLETE: &str = ".complete.json";
/// Begin of the names of single files that are being written.
const WRITING: &str = ".writing-";
/// These go first and come last: who sees them sees a result that belongs to them.
const HEADS: [&str; 3] = ["summary.json", "report.json", "index.html"];
/// A single file that nobody went on with for this long is of a command that was killed.
const ABANDONED: Duration = Duration::from_secs(24 * 3600);
/// Time to wait for another command that writes into the folder.
const MAX_WAIT_FOR_OTHER_COMMAND: Duration = Duration::from_secs(3);

/// Results that are all there: what is moved, and what goes.
#[derive(Debug, Serialize, Deserialize)]
struct Move {
    files: BTreeSet<String>,
    earlier: BTreeSet<String>,
}

impl Move {
    /// Whether all names lie inside of the folder, as those that a command wrote do.
    fn is_inside(&self) -> bool {
        let inside = |name: &String| {
            let mut parts = Path::new(name).components().peekable();
            parts.peek().is_some() && parts.all(|part| matches!(part, std::path::Component::Normal(_)))
        };
        self.files.iter().chain(&self.earlier).all(inside)
    }
}

/// New results of a command on their way into its folder. Dropped without [`Results::commit`], nothing changes.
#[derive(Debug)]
pub struct Results {
    folder: PathBuf,
    made: bool,
    stage: Option<TempDir>,
    ours: BTreeSet<String>,
    /// Files of the stage that are worth keeping if the results never become complete, and where.
    rescued: Vec<(&'static str, PathBuf)>,
    // Held until the command ends; the system frees it whatever the end is.
    _lock: Option<File>,
}

impl Results {
    /// Makes the folder where it is not there, takes it for this command, completes or removes what a killed command
    /// left, and refuses what [`check()`] refuses.
    ///
    /// # Errors
    /// [`Error::OutputFolder`] says what is in the way.
    pub fn open(folder: &Path, inputs: &[PathBuf], names: &[String]) -> Result<Results, Error> {
        Results::open_in(folder, folder, inputs, names, earlier)
    }

    /// Same as [`Results::open`], for results with paths relative to the folder: they are written into a folder beside
    /// it.
    ///
    /// # Errors
    /// Same as [`Results::open`].
    pub fn open_beside(folder: &Path, inputs: &[PathBuf], names: &[String]) -> Result<Results, Error> {
        let parent = folder.parent().filter(|parent| !parent.as_os_str().is_empty());
        Results::open_in(folder, parent.unwrap_or(Path::new(".")), inputs, names, earlier)
    }

    /// Same as [`Results::open`], where what may be replaced is known otherwise than by a summary: `earlier` tells.
    ///
    /// # Errors
    /// Same as [`Results::open`].
    pub fn open_where(
        folder: &Path,
        inputs: &[PathBuf],
        names: &[String],
        earlier: impl Fn(&Path) -> BTreeSet<String>,
    ) -> Result<Results, Error> {
        Results::open_in(folder, folder, inputs, names, earlier)
    }

    fn open_in(
        folder: &Path,
        place: &Path,
        inputs: &[PathBuf],
        names: &[String],
        earlier: impl Fn(&Path) -> BTreeSet<String>,
    ) -> Result<Results, Error> {
        let refused = |problem: String| Error::OutputFolder { folder: folder.into(), problem };
        let made = make(folder)?;
        if made {
            scratch::pending_while_empty(folder);
        }
        let lock = lock(folder)?;
        let prefix = stage_prefix(folder, place);
        finish_or_sweep(folder, place, &prefix)?;
        let ours = earlier(folder);
        check_against(folder, inputs, names, &ours)?;
        let stage = tempfile::Builder::new().prefix(&prefix).tempdir_in(place);
        let stage = stage.map_err(|error| {
            let error = airloop_series::file::without_path(error);
            refused(format!("nothing can be written there: {error}"))
        })?;
        scratch::pending(stage.path());
        Ok(Results {
            folder: folder.into(),
            made,
            stage: Some(stage),
            ours,
            rescued: Vec::new(),
            _lock: lock,
        })
    }

    /// Folder that the files are written into.
    pub fn path(&self) -> &Path {
        self.stage.as_ref().expect("there until the results are moved").path()
    }

    /// Moves a file into the results; it returns to its place if they are never put into their folder.
    ///
    /// # Errors
    /// The file cannot be moved.
    pub fn adopt(&mut self, file: &Path, name: &'static str) -> std::io::Result<()> {
        // What the user would miss is worth a folder that stays.
        scratch::settled(self.path());
        std::fs::rename(file, self.path().join(name))?;
        self.rescued.push((name, file.into()));
        Ok(())
    }

    /// Returns the files of [`Results::adopt`].
    fn rescue(&self, stage: &Path) {
        for (name, file) in &self.rescued {
            if std::fs::rename(stage.join(name), file).is_ok() {
                super::output::to_stderr(&format!("{name} is kept as {}", file.display()));
            }
        }
    }

    /// Puts the results into their folder, in place of the earlier ones. Files of the user stay.
    ///
    /// # Errors
    /// [`Error::OutputFolder`] if a file of the user has the name of a new one (the results are then left in a folder
    /// beside it, which the message names), or a file cannot be moved.
    pub fn commit(mut self) -> Result<(), Error> {
        let refused = |problem: String| Error::OutputFolder { folder: self.folder.clone(), problem };
        let stage = self.stage.take().expect("there until the results are moved");
        let names = files(stage.path()).map_err(|error| refused(error.to_string()))?;
        let theirs = names.iter().find(|name| {
            let there = self.folder.join(name);
            !self.ours.contains(*name) && there.symlink_metadata().is_ok() && !is_figure(&there)
        });
        if let Some(name) = theirs {
            let kept = (1..).map(|number| self.folder.join(format!("new-results-{number}")));
            let kept = kept.into_iter().find(|kept| kept.symlink_metadata().is_err()).unwrap_or_default();
            let moved = std::fs::rename(stage.path(), &kept);
            let kept = moved.map_or_else(|error| error.to_string(), |()| kept.display().to_string());
            return Err(refused(format!(
                "`{name}` is there and is not part of an earlier result; the new results are in {kept}"
            )));
        }
        let change = Move { files: names, earlier: std::mem::take(&mut self.ours) };
        // From here on the next command completes the move.
        scratch::settled(stage.path());
        if let Err(error) = airloop_series::file::write_json(&stage.path().join(COMPLETE), &change) {
            self.rescue(stage.path());
            return Err(refused(format!("the new results cannot be put there: {error}")));
        }
        place(&self.folder, stage.path(), &change).map_err(|error| {
            // Complete, and perhaps moved in part: the next command goes on with it.
            let stage = stage.keep();
            refused(format!(
                "the new results cannot be put there: {error}; they are in {}, and the next command with this folder moves them",
                stage.display()
            ))
        })
    }
}

impl Drop for Results {
    fn drop(&mut self) {
        if let Some(stage) = self.stage.take() {
            self.rescue(stage.path());
        }
        if self.made {
            // Only an empty folder can be removed this way.
            let _ = std::fs::remove_dir(&self.folder);
        }
    }
}

/// Moves complete results from `stage`; of the earlier ones nothing stays. Also completes a move that was begun.
fn place(folder: &Path, stage: &Path, change: &Move) -> std::io::Result<()> {
    let head = |name: &&String| HEADS.contains(&name.as_str());
    let gone = |outcome: std::io::Result<()>| match outcome {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    };
    // A head that is no longer in the stage is the new one already.
    let old = |name: &&String| !change.files.contains(*name) || stage.join(name).exists();
    for name in change.earlier.iter().filter(head).filter(old) {
        gone(std::fs::remove_file(folder.join(name)))?;
    }
    let (last, first): (Vec<&String>, Vec<&String>) = change.files.iter().partition(head);
    for name in first.into_iter().chain(last) {
        let to = folder.join(name);
        if let Some(parent) = to.parent() {
            std::fs::create_dir_all(parent)?;
        }
        gone(std::fs::rename(stage.join(name), to))?;
    }
    for name in change.earlier.iter().filter(|name| !change.files.contains(*name) && !head(name)) {
        gone(std::fs::remove_file(folder.join(name)))?;
        // Folders that are empty now.
        for parent in Path::new(name).ancestors().skip(1).filter(|parent| !parent.as_os_str().is_empty()) {
            let _ = std::fs::remove_dir(folder.join(parent));
        }
    }
    std::fs::remove_dir_all(stage)
}

/// Completes the move of a command that was killed while it moved, and removes what others left.
fn finish_or_sweep(folder: &Path, stages: &Path, prefix: &str) -> Result<(), Error> {
    let refused = |error: std::io::Error| Error::OutputFolder {
        folder: folder.into(),
        problem: format!("the results of an earlier command cannot be completed: {error}"),
    };
    for entry in std::fs::read_dir(stages).into_iter().flatten().flatten() {
        let (path, name) = (entry.path(), entry.file_name());
        let name = name.to_string_lossy();
        let age = || path.metadata().and_then(|file| file.modified()).ok()?.elapsed().ok();
        if name.starts_with(WRITING) && stages == folder && age().is_some_and(|age| age > ABANDONED) {
            let _ = std::fs::remove_file(&path).or_else(|_| std::fs::remove_dir_all(&path));
        } else if name.starts_with(prefix) {
            let complete = std::fs::read(path.join(COMPLETE)).ok();
            match complete.and_then(|text| serde_json::from_slice::<Move>(&text).ok()) {
                Some(change) if !change.is_inside() => {
                    let problem = format!(
                        "{} names files outside of the folder, which no command does; remove it",
                        path.join(COMPLETE).display()
                    );
                    return Err(Error::OutputFolder { folder: folder.into(), problem });
                }
                Some(change) => place(folder, &path, &change).map_err(refused)?,
                None => drop(std::fs::remove_dir_all(&path)),
            }
        }
    }
    Ok(())
}

/// Begin of the names of the hidden folders of a result folder; beside it, they have its name, too.
fn stage_prefix(folder: &Path, stages: &Path) -> String {
    let name = folder.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    if stages == folder { STAGE.into() } else { format!("{STAGE}{name}~") }
}

/// All files in a folder and below, by their path inside.
fn files(folder: &Path) -> std::io::Result<BTreeSet<String>> {
    let mut found = BTreeSet::new();
    let mut open = vec![String::new()];
    while let Some(inner) = open.pop() {
        for entry in std::fs::read_dir(folder.join(&inner))? {
            let entry = entry?;
            let name = format!("{inner}{}", entry.file_name().to_string_lossy());
            if entry.file_type()?.is_dir() {
                open.push(name + "/");
            } else {
                found.insert(name);
            }
        }
    }
    Ok(found)
}

/// Takes the folder for this command; `None` where the file system cannot lock.
fn lock(folder: &Path) -> Result<Option<File>, Error> {
    // Not every system opens folders.
    let Ok(lock) = File::open(folder) else { return Ok(None) };
    let began = Instant::now();
    loop {
        match lock.try_lock() {
            Ok(()) => return Ok(Some(lock)),
            Err(TryLockError::WouldBlock) if began.elapsed() < MAX_WAIT_FOR_OTHER_COMMAND => {
                std::thread::sleep(Duration::from_millis(50));
            }
            Err(TryLockError::WouldBlock) => {
                let problem =
                    "another airloop writes into it; wait until it has ended, or choose another folder";
                return Err(Error::OutputFolder { folder: folder.into(), problem: problem.into() });
            }
            Err(TryLockError::Error(_)) => return Ok(None),
        }
    }
}

/// Makes the folder; whether it was not there before.
fn make(folder: &Path) -> Result<bool, Error> {
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
pub fn check_where(
    folder: &Path,
    inputs: &[PathBuf],
    names: &[String],
    earlier: impl Fn(&Path) -> BTreeSet<String>,
) -> Result<(), Error> {
    check_against(folder, inputs, names, &earlier(folder))
}

fn check_against(
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
    listed
        .chain(["result.csv", "result.states.json", "index.html", "summary.json"])
        .map(str::to_owned)
        .collect()
}

/// Refuses to replace a file that airloop did not write, or that the command reads.
///
/// # Errors
/// [`Error::OutputFile`] names it.
pub fn check_file(file: &Path, inputs: &[&Path]) -> Result<(), Error> {
    let refused = |problem: &str| Err(Error::OutputFile { file: file.into(), problem: problem.into() });
    if file.symlink_metadata().is_err() {
        return Ok(());
    }
    if let Err(problem) = airloop_series::file::check_place(file) {
        return refused(&problem.to_string());
    }
    let own = file.canonicalize().ok();
    if inputs.iter().any(|input| own.is_some() && input.canonicalize().ok() == own) {
        return refused("this command reads it; choose another name");
    }
    if !made_by_airloop(file) {
        return refused("it is there and is not of airloop: it would be replaced; choose another name");
    }
    Ok(())
}

/// Whether this is a figure as airloop draws them, of a result whose summary does not name it any more.
fn is_figure(file: &Path) -> bool {
    const BEGIN: &str = "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 ";
    const ROLE: &str = "role=\"img\">\n<title>";
    let drawn = |text: String| text.starts_with(BEGIN) && text.contains(ROLE);
    file.extension().is_some_and(|ending| ending == "svg") && std::fs::read_to_string(file).is_ok_and(drawn)
}

/// Whether a system or an FMU says that airloop wrote it.
fn made_by_airloop(file: &Path) -> bool {
    // Descriptions and systems, and reports of the checker as JUnit and SARIF.
    const MARKS: [&str; 3] =
        ["generationTool=\"airloop", "<testsuites name=\"airloop inspect\"", "\"name\": \"airloop\""];
    let marked = |path: &Path| {
        std::fs::read_to_string(path).is_ok_and(|text| MARKS.iter().any(|mark| text.contains(mark)))
    };
    match file.extension().and_then(|ending| ending.to_str()) {
        Some("ssp") => airloop_fmi::unpack_package(file)
            .is_ok_and(|package| marked(&package.path().join("SystemStructure.ssd"))),
        Some("fmu") => airloop_fmi::Fmu::open(file)
            .is_ok_and(|fmu| fmu.description.generation_tool.starts_with("airloop")),
        Some("svg") => is_figure(file),
        _ => marked(file),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        files(folder).unwrap().into_iter().collect()
    }

    fn write(folder: &Path, names: &[&str], text: &str) -> Result<(), Error> {
        let results = Results::open_where(folder, &[], &[], |folder| {
            let list = std::fs::read_to_string(folder.join("summary.json")).unwrap_or_default();
            list.lines().skip(1).map(str::to_owned).collect()
        })?;
        for name in names {
            let path = results.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        let list = format!("{text}\n{}\nsummary.json\n", names.join("\n"));
        std::fs::write(results.path().join("summary.json"), list).unwrap();
        results.commit()
    }

    #[test]
    fn a_result_replaces_the_earlier_one_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        write(folder, &["result.csv", "a.svg", "system/x.fmu"], "1").unwrap();
        std::fs::write(folder.join("system/mine.txt"), "mine").unwrap();
        write(folder, &["result.csv", "system/y.fmu"], "2").unwrap();
        assert_eq!(names(folder), ["result.csv", "summary.json", "system/mine.txt", "system/y.fmu"]);
        assert_eq!(std::fs::read_to_string(folder.join("result.csv")).unwrap(), "2");
    }

    #[test]
    fn what_the_user_put_there_is_refused_by_name_and_the_new_result_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        write(folder, &["result.csv"], "1").unwrap();
        std::fs::write(folder.join("x.svg"), "mine").unwrap();
        let message = write(folder, &["result.csv", "x.svg"], "2").unwrap_err().to_string();
        assert!(message.contains("`x.svg`") && message.contains("new-results-1"), "{message}");
        assert_eq!(std::fs::read_to_string(folder.join("x.svg")).unwrap(), "mine");
        assert_eq!(std::fs::read_to_string(folder.join("result.csv")).unwrap(), "1");
        assert_eq!(std::fs::read_to_string(folder.join("new-results-1/x.svg")).unwrap(), "2");
        assert!(check(folder, &[], &["x.svg".into()]).is_err());
    }

    #[test]
    fn a_move_that_leads_out_of_the_folder_is_refused() {
        let parent = tempfile::tempdir().unwrap();
        let (folder, theirs) = (parent.path().join("out"), parent.path().join("thesis.txt"));
        let stage = folder.join(".airloop-new-1");
        std::fs::create_dir_all(&stage).unwrap();
        std::fs::write(&theirs, "theirs").unwrap();
        for name in ["../thesis.txt", "", "a/../../thesis.txt", theirs.to_str().unwrap()] {
            let list = || std::iter::once(name.to_owned()).collect();
            for (files, earlier) in [(list(), BTreeSet::new()), (BTreeSet::new(), list())] {
                airloop_series::file::write_json(&stage.join(COMPLETE), &Move { files, earlier }).unwrap();
                let message = write(&folder, &["result.csv"], "1").unwrap_err().to_string();
                assert!(message.contains("outside of the folder"), "{name}: {message}");
                assert_eq!(std::fs::read_to_string(&theirs).unwrap(), "theirs");
            }
        }
    }

    #[test]
    fn a_move_that_was_begun_is_completed_and_one_that_was_not_is_forgotten() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        write(folder, &["result.csv", "old.svg"], "1").unwrap();
        let stage = folder.join(".airloop-new-1");
        std::fs::create_dir(&stage).unwrap();
        for name in ["result.csv", "summary.json"] {
            std::fs::write(stage.join(name), "2").unwrap();
        }
        let set = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        let files = set(&["result.csv", "summary.json"]);
        let change = Move { files, earlier: set(&["result.csv", "old.svg", "summary.json"]) };
        airloop_series::file::write_json(&stage.join(COMPLETE), &change).unwrap();
        // Killed after the first file.
        std::fs::remove_file(folder.join("summary.json")).unwrap();
        std::fs::rename(stage.join("result.csv"), folder.join("result.csv")).unwrap();
        std::fs::create_dir(folder.join(".airloop-new-2")).unwrap();
        std::fs::write(folder.join(".airloop-new-2/result.csv"), "half").unwrap();
        drop(Results::open(folder, &[], &[]).unwrap());
        assert_eq!(names(folder), ["result.csv", "summary.json"]);
        assert_eq!(std::fs::read_to_string(folder.join("result.csv")).unwrap(), "2");
        assert_eq!(std::fs::read_to_string(folder.join("summary.json")).unwrap(), "2");
    }

    #[test]
    fn a_folder_is_taken_by_one_command_at_a_time() {
        let folder = tempfile::tempdir().unwrap();
        let first = Results::open(folder.path(), &[], &[]).unwrap();
        let message = Results::open(folder.path(), &[], &[]).unwrap_err().to_string();
        assert!(message.contains("another airloop writes into it"), "{message}");
        drop(first);
        Results::open(folder.path(), &[], &[]).unwrap();
    }
}
