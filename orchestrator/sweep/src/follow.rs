//! Files behind those that a plan names: all files under a folder, and what descriptions and settings name in turn.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use airloop_cosim::system::ssp;
use airloop_series::file::read_to_string;

use crate::manifest::Manifest;
use crate::{Error, digest};

/// Texts of a file with more bytes are not looked at as paths.
const MAX_BYTES: u64 = 16 << 20;

/// Everything that is reached from some files and folders, each once: the folders themselves, so that files that are
/// added or removed are seen, and single files, so that one that changes can be named. Relative paths in JSON files may
/// also begin at `base`, the working directory of commands.
///
/// # Errors
/// [`Error::Io`] for a folder or a file of settings that cannot be read.
pub fn follow(roots: impl IntoIterator<Item = PathBuf>, base: &Path) -> Result<Vec<PathBuf>, Error> {
    let (mut found, mut seen) = (Vec::new(), HashSet::new());
    let mut open: Vec<PathBuf> = roots.into_iter().collect();
    open.reverse();
    while let Some(path) = open.pop() {
        if !seen.insert(path.canonicalize().unwrap_or_else(|_| path.clone())) {
            continue;
        }
        open.extend(match path.is_dir() {
            true => files_under(&path)?,
            false => named_by(&path, base)?,
        });
        found.push(path);
    }
    Ok(found)
}

/// Files under a folder in the order of their names, without hidden ones and those of sweeps, which tasks write.
///
/// # Errors
/// [`Error::Io`] for a folder that cannot be read.
pub fn files_under(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let (mut files, mut seen, mut open) = (Vec::new(), HashSet::new(), vec![folder.to_owned()]);
    while let Some(folder) = open.pop() {
        // A link to a folder above would never end.
        if !seen.insert(folder.canonicalize().map_err(Error::io(&folder))?) {
            continue;
        }
        let (folders, own): (Vec<_>, Vec<_>) =
            digest::entries(&folder)?.into_iter().partition(|path| path.is_dir());
        files.extend(own);
        open.extend(folders.into_iter().filter(|folder| Manifest::read(folder).is_err()));
    }
    files.sort();
    Ok(files)
}

/// Files and folders that a file names and that are there.
fn named_by(file: &Path, base: &Path) -> Result<Vec<PathBuf>, Error> {
    let folder = file.parent().unwrap_or(Path::new(""));
    let kind = file.extension().and_then(|kind| kind.to_str()).unwrap_or_default();
    let mut named = match kind {
        // One that cannot be read names nothing; the tasks will say what is wrong with it.
        "ssd" => ssp::sources(file).unwrap_or_default(),
        "toml" => {
            let value = text(file)?.and_then(|text| text.parse::<toml::Table>().ok());
            let mut texts = Vec::new();
            value.iter().for_each(|table| table.values().for_each(|value| of_toml(value, &mut texts)));
            texts.iter().map(|text| folder.join(text)).collect()
        }
        "json" => {
            let value = text(file)?.and_then(|text| serde_json::from_str(&text).ok());
            let mut texts = Vec::new();
            value.iter().for_each(|value| of_json(value, &mut texts));
            texts.iter().flat_map(|text| [folder.join(text), base.join(text)]).collect()
        }
        _ => Vec::new(),
    };
    // A folder that holds the file itself is a name by chance, such as "." or "..".
    let above = |path: &Path| {
        path.canonicalize().is_ok_and(|path| file.canonicalize().is_ok_and(|file| file.starts_with(path)))
    };
    named.retain(|path| path.exists() && !above(path));
    Ok(named)
}

/// Text of a file of settings; none if it is too long to be one.
fn text(file: &Path) -> Result<Option<String>, Error> {
    let Ok(metadata) = file.metadata() else { return Ok(None) };
    match metadata.len() <= MAX_BYTES {
        true => Ok(Some(read_to_string(file).map_err(Error::io(file))?)),
        false => Ok(None),
    }
}

fn of_toml(value: &toml::Value, texts: &mut Vec<String>) {
    match value {
        toml::Value::String(text) => texts.push(text.clone()),
        toml::Value::Array(values) => values.iter().for_each(|value| of_toml(value, texts)),
        toml::Value::Table(table) => table.values().for_each(|value| of_toml(value, texts)),
        _ => {}
    }
}

fn of_json(value: &serde_json::Value, texts: &mut Vec<String>) {
    match value {
        serde_json::Value::String(text) => texts.push(text.clone()),
        serde_json::Value::Array(values) => values.iter().for_each(|value| of_json(value, texts)),
        serde_json::Value::Object(table) => table.values().for_each(|value| of_json(value, texts)),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_lead_to_systems_and_these_to_their_parts() {
        let place = tempfile::tempdir().unwrap();
        let base = place.path().join("plan");
        let write = |name: &str, text: &str| {
            let path = place.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        };
        write(
            "plan/study.toml",
            "name = \"..\"\nsystem = \"../rig/a%20system.ssd\"\n[[segment]]\nfile = \"swing.csv\"\nrole = \"missing.csv\"\n",
        );
        write("plan/swing.csv", "time,x");
        write(
            "rig/a%20system.ssd",
            "<a source=\"https://example.org/x.fmu\"><b source=\"../fmu/one%20two.fmu\"/><c source=\"far/set.ssv\"/><d source=\"gone.fmu\"/></a>",
        );
        write("fmu/one two.fmu", "");
        write("rig/far/set.ssv", "");
        write("rig/other.ssv", "");
        let follow = |root: &str| {
            let found = follow([base.join(root)], &base).unwrap();
            let names = found.iter().map(|path| path.canonicalize().unwrap());
            let root = place.path().canonicalize().unwrap();
            let mut names: Vec<String> =
                names.map(|path| path.strip_prefix(&root).unwrap().to_string_lossy().into_owned()).collect();
            names.sort();
            names
        };
        let expected =
            ["fmu/one two.fmu", "plan/study.toml", "plan/swing.csv", "rig/a%20system.ssd", "rig/far/set.ssv"];
        assert_eq!(follow("study.toml"), expected);
        // A folder is one more: what is added to it counts.
        let mut folder = expected.to_vec();
        folder.insert(1, "plan");
        assert_eq!(follow("."), folder);
        // JSON files may name places from the working directory, which is the folder of the plan.
        write("out/summary.json", "{\"problem_file\": [\"../rig/other.ssv\", 3]}");
        assert_eq!(follow("../out"), ["out", "out/summary.json", "rig/other.ssv"]);
    }

    #[cfg(unix)]
    #[test]
    fn links_to_folders_above_end() {
        let place = tempfile::tempdir().unwrap();
        std::fs::write(place.path().join("a.csv"), "").unwrap();
        std::os::unix::fs::symlink(place.path(), place.path().join("again")).unwrap();
        assert_eq!(files_under(place.path()).unwrap(), [place.path().join("a.csv")]);
    }
}
