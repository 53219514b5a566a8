//! Folder of the FMUs of this project from which others are derived.

use std::path::{Path, PathBuf};

use airloop_series::names;

/// Environment variable that names the folder.
pub const VARIABLE: &str = "AIRLOOP_FMUS";

/// An FMU that is in none of the places.
#[derive(Debug, thiserror::Error)]
#[error("the FMU {name}.fmu is not in {}; {}", places(tried), remedy(name, there))]
pub struct TemplateNotFound {
    /// Name of the FMU.
    pub name: String,
    /// Folders that were looked into, in their order.
    pub tried: Vec<PathBuf>,
    /// Names of the FMUs that are there.
    pub there: Vec<String>,
}

fn remedy(name: &str, there: &[String]) -> String {
    if there.is_empty() {
        return format!(
            "run `make fmu`, or name the folder that holds it in the environment variable {VARIABLE}"
        );
    }
    names::suggestion(name, there.iter().map(String::as_str))
}

/// Names of the FMUs in folders.
fn names_in(folders: &[PathBuf]) -> Vec<String> {
    let files = folders.iter().filter_map(|folder| std::fs::read_dir(folder).ok()).flatten().flatten();
    let fmus = files.map(|file| file.path()).filter(|path| path.extension().is_some_and(|own| own == "fmu"));
    let mut names: Vec<String> =
        fmus.filter_map(|path| Some(path.file_stem()?.to_string_lossy().into_owned())).collect();
    names.sort();
    names.dedup();
    names
}

fn places(tried: &[PathBuf]) -> String {
    tried.iter().map(|folder| folder.display().to_string()).collect::<Vec<_>>().join(", ")
}

/// Path of the FMU `name` of this project (without `.fmu`), such as `arx-actuator`.
///
/// A folder that the user names is the only one looked into: `folder`, else that of the environment variable
/// [`VARIABLE`]. Without either it is the first of `fmu` next to the executable, `fmu` next to its folder, and
/// `target/fmu` of the working directory that has the FMU.
///
/// # Errors
/// [`TemplateNotFound`] with all places that were tried.
pub fn template(name: &str, folder: Option<&Path>) -> Result<PathBuf, TemplateNotFound> {
    let variable = std::env::var_os(VARIABLE).filter(|value| !value.is_empty()).map(PathBuf::from);
    let executable = std::env::current_exe().ok();
    first(name, places_to_try(folder, variable.as_deref(), executable.as_deref()))
}

fn places_to_try(folder: Option<&Path>, variable: Option<&Path>, executable: Option<&Path>) -> Vec<PathBuf> {
    if let Some(folder) = folder.or(variable) {
        return vec![folder.to_owned()];
    }
    let beside = executable.and_then(Path::parent);
    let above = beside.and_then(Path::parent);
    let mut places: Vec<PathBuf> = [beside, above].into_iter().flatten().map(|f| f.join("fmu")).collect();
    places.push(Path::new("target").join("fmu"));
    places
}

fn first(name: &str, places: Vec<PathBuf>) -> Result<PathBuf, TemplateNotFound> {
    let file = format!("{name}.fmu");
    match places.iter().map(|folder| folder.join(&file)).find(|path| path.is_file()) {
        Some(path) => Ok(path),
        None => Err(TemplateNotFound { name: name.to_owned(), there: names_in(&places), tried: places }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_that_the_user_names_is_the_only_place() {
        let [given, variable, executable] = ["given", "variable", "target/release/airloop"].map(Path::new);
        let places = |folder, variable| places_to_try(folder, variable, Some(executable));
        assert_eq!(places(Some(given), Some(variable)), [Path::new("given")]);
        assert_eq!(places(None, Some(variable)), [Path::new("variable")]);
        let own = ["target/release/fmu", "target/fmu", "target/fmu"].map(PathBuf::from);
        assert_eq!(places(None, None), own);
    }

    #[test]
    fn the_first_folder_that_has_the_fmu_wins_and_else_all_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let (empty, full) = (folder.path().join("empty"), folder.path().join("full"));
        std::fs::create_dir(&full).unwrap();
        std::fs::write(full.join("friction.fmu"), "").unwrap();
        let places = || vec![empty.clone(), full.clone()];
        assert_eq!(first("friction", places()).unwrap(), full.join("friction.fmu"));
        let message = first("other", places()).unwrap_err().to_string();
        for part in ["other.fmu", "empty", "full", "known are: friction"] {
            assert!(message.contains(part), "{part}: {message}");
        }
        let message = first("other", vec![empty]).unwrap_err().to_string();
        for part in ["make fmu", VARIABLE] {
            assert!(message.contains(part), "{part}: {message}");
        }
    }
}
