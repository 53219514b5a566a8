//! The model descriptions that are kept in the repository, to be read in reviews.

use crate::Error;
use airloop_models::registry::Entry;
use std::path::{Path, PathBuf};

const FOLDER: &str = "modelDescriptions";

/// Path of every shipped model description and its text.
fn expected(root: &Path, entries: &[Entry]) -> Vec<(PathBuf, String)> {
    let path = |e: &Entry| root.join(FOLDER).join(format!("{}.xml", e.identity.model_name));
    entries.iter().filter(|e| e.shipped).map(|e| (path(e), (e.xml)())).collect()
}

/// Writes those that differ from what is there.
///
/// # Errors
/// A file that cannot be written.
pub fn write(root: &Path, entries: &[Entry]) -> Result<(), Error> {
    let folder = root.join(FOLDER);
    std::fs::create_dir_all(&folder).map_err(Error::file(&folder))?;
    for (path, text) in expected(root, entries) {
        if std::fs::read_to_string(&path).ok().as_deref() != Some(text.as_str()) {
            std::fs::write(&path, text).map_err(Error::file(&path))?;
        }
    }
    Ok(())
}

/// All differences between the files and the models.
pub fn check(root: &Path, entries: &[Entry]) -> Vec<Error> {
    let expected = expected(root, entries);
    let mut errors: Vec<Error> = expected
        .iter()
        .filter(|(path, text)| std::fs::read_to_string(path).ok().as_deref() != Some(text.as_str()))
        .map(|(path, _)| Error::Stale { path: path.clone() })
        .collect();
    let mut present: Vec<PathBuf> = std::fs::read_dir(root.join(FOLDER))
        .map(|folder| folder.filter_map(|file| Some(file.ok()?.path())).collect())
        .unwrap_or_default();
    present.sort();
    errors.extend(
        present
            .into_iter()
            .filter(|path| path.extension().is_some_and(|e| e == "xml"))
            .filter(|path| !expected.iter().any(|(known, _)| known == path))
            .map(|path| Error::Leftover { path }),
    );
    errors
}

#[cfg(test)]
mod tests {
    use super::*;
    use airloop_models::registry;

    #[test]
    fn check_names_what_is_missing_changed_or_left_over() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let root = folder.path();
        // Models with few parameters, for the sake of time.
        let few = |e: &Entry| ["friction", "cart-pole", "test-copy"].contains(&e.identity.model_name);
        let entries: Vec<Entry> = registry::all().into_iter().filter(few).collect();
        let shipped = entries.iter().filter(|e| e.shipped).count();
        assert_eq!(check(root, &entries).len(), shipped);
        write(root, &entries).expect("writable");
        assert!(check(root, &entries).is_empty());

        let friction = root.join(FOLDER).join("friction.xml");
        let text = std::fs::read_to_string(&friction).expect("written above").replace("1.5145", "1.6");
        std::fs::write(&friction, text).expect("writable");
        std::fs::write(root.join(FOLDER).join("gone.xml"), "").expect("writable");
        let errors: Vec<String> = check(root, &entries).iter().map(ToString::to_string).collect();
        assert_eq!(errors.len(), 2);
        assert!(errors[0].contains("friction.xml") && errors[0].contains("cargo run -p packager"));
        assert!(errors[1].contains("gone.xml"));
    }
}
