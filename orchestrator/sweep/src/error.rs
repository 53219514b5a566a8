//! Reasons why a sweep cannot be planned, run or merged.

use std::path::PathBuf;

/// Reason why a sweep cannot be planned, run or merged.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "file, place and value, as in each message")]
pub enum Error {
    /// The plan is no TOML, or has unknown names.
    #[error("{}: {problem}", file.display())]
    File { file: PathBuf, problem: String },
    /// A value of the plan cannot be used.
    #[error("plan, {place}: {problem}")]
    Plan { place: String, problem: String },
    /// A file cannot be read or written.
    #[error("{}: {source}{}", path.display(), advice(source))]
    Io { path: PathBuf, source: std::io::Error },
    /// The folder is no sweep.
    #[error("{}: there is no manifest.json; make the folder with `airloop sweep plan PLAN.toml -o {}`", folder.display(), folder.display())]
    NoManifest { folder: PathBuf },
    /// A file of the user has the name of a result.
    #[error("{}: it is there and is not of airloop: it would be replaced; move it away", path.display())]
    Present { path: PathBuf },
    /// A sweep of another plan stands in the folder.
    #[error("{}: it holds another sweep (plan {found}, this is {wanted}); give another folder with -o, or delete it", folder.display())]
    OtherSweep { folder: PathBuf, found: String, wanted: String },
    /// An input is no longer what was planned.
    #[error("{}: its content has changed since the plan was made (SHA-256 was {planned}, is {found}); put the old file back, or plan again into another folder", path.display())]
    Changed { path: PathBuf, planned: String, found: String },
    /// Another program runs the tasks than the one that planned them.
    #[error(
        "this program ({found}) is another than the one that made the plan ({planned}); run with that one, or plan again into another folder"
    )]
    Program { planned: String, found: String },
    /// Another process runs the same tasks.
    #[error("{}: another process runs these tasks; it is left to it", path.display())]
    Busy { path: PathBuf },
    /// A shard that does not exist.
    #[error("--shard {shard}: write i/n with 1 <= i <= n, e.g. 2/8")]
    Shard { shard: String },
    /// Finished shards do not hold all tasks.
    #[error("{missing} of {all} tasks are missing, the first is task {first}; run `airloop sweep run {}`", folder.display())]
    Incomplete { folder: PathBuf, missing: u64, all: u64, first: u64 },
    /// A shard that does not hold what it says.
    #[error("{}: {problem}; delete it and run its tasks again", path.display())]
    Damaged { path: PathBuf, problem: String },
    /// The run was interrupted.
    #[error("interrupted; finished shards are kept")]
    Interrupted,
    /// A table cannot be written as Parquet.
    #[error("{}: {source}", path.display())]
    Parquet { path: PathBuf, source: parquet::errors::ParquetError },
    /// An engine refused.
    #[error("{engine}: {problem}")]
    Engine { engine: &'static str, problem: String },
    /// A simulation cannot begin.
    #[error(transparent)]
    Airloop(#[from] airloop::Error),
}

/// Remedy for what the file system says.
fn advice(source: &std::io::Error) -> &'static str {
    match source.kind() {
        std::io::ErrorKind::StorageFull => {
            "; make room and run again: finished shards are kept, nothing half-written is left"
        }
        _ => "",
    }
}

impl Error {
    /// With the file of the plan, where the error is one of its values.
    pub fn in_file(self, file: &std::path::Path) -> Error {
        match self {
            Error::Plan { place, problem } => {
                Error::File { file: file.into(), problem: format!("{place}: {problem}") }
            }
            other => other,
        }
    }

    /// An error of the file system at a path.
    pub fn io(path: &std::path::Path) -> impl FnOnce(std::io::Error) -> Error {
        let path = path.to_owned();
        move |source| Error::Io { path, source }
    }
}
