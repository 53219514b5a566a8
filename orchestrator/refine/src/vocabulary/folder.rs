//! A folder of effects: every `.toml` in it is one.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::own::{Own, Problem};

/// Effects of a folder, and the files that are none.
#[derive(Debug, Clone, Default)]
pub struct Folder {
    /// File and effect.
    pub effects: Vec<(PathBuf, Arc<Own>)>,
    /// File and what is wrong with it.
    pub refused: Vec<(PathBuf, Problem)>,
}

impl Folder {
    /// Reads a folder, or one file. Files are taken in the order of their names; of two with the same kind the second
    /// is refused.
    ///
    /// # Errors
    /// A folder or file that cannot be read, or that holds no `.toml`.
    pub fn read(path: &Path) -> Result<Folder, crate::Error> {
        let io = |problem: String| crate::Error::Case { path: path.to_owned(), problem };
        let mut files = Vec::new();
        if path.is_file() {
            files.push(path.to_owned());
        } else {
            for entry in std::fs::read_dir(path).map_err(|error| io(error.to_string()))? {
                files.push(entry.map_err(|error| io(error.to_string()))?.path());
            }
            files.retain(|file| file.extension().is_some_and(|ending| ending == "toml"));
            files.sort();
        }
        if files.is_empty() {
            return Err(io(
                "no effect is in this folder; an effect is a .toml file, see `airloop effects --help`".into(),
            ));
        }
        let mut found = Folder::default();
        for file in files {
            let text = airloop_series::file::read_to_string(&file);
            let own = text.map_err(|error| Problem { place: String::new(), problem: error.to_string() });
            // Of a link, where the file itself is.
            let whole = file.canonicalize().unwrap_or_else(|_| file.clone());
            let beside = whole.parent().unwrap_or(Path::new(""));
            match own.and_then(|text| Own::read_in(&text, beside)) {
                Ok(own) if found.effects.iter().any(|(_, other)| other.kind == own.kind) => {
                    let problem = format!("the kind `{}` is given twice; choose another name", own.kind);
                    found.refused.push((file, Problem { place: String::new(), problem }));
                }
                Ok(own) => found.effects.push((file, Arc::new(own))),
                Err(problem) => found.refused.push((file, problem)),
            }
        }
        Ok(found)
    }

    /// One sentence for each file that is no effect.
    pub fn problems(&self) -> Vec<String> {
        self.refused.iter().map(|(file, problem)| format!("{}: {problem}", file.display())).collect()
    }
}
