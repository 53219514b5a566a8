//! Shared libraries: built here by cargo, found in a folder, or built on other platforms.

use crate::Error;
use crate::contents::Library;
use crate::glibc;
use airloop_models::registry::Entry;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// FMI names of the platforms and the file extension of their libraries.
const PLATFORMS: [(&str, &str); 3] = [("darwin64", "dylib"), ("linux64", "so"), ("win64", "dll")];

/// FMI name of the platform that this program runs on.
fn host_platform() -> &'static str {
    if cfg!(target_os = "windows") {
        "win64"
    } else if cfg!(target_os = "macos") {
        "darwin64"
    } else {
        "linux64"
    }
}

/// Builds the libraries of all entries with cargo, without symbols and debug information.
///
/// # Errors
/// Cargo that does not start or does not succeed.
pub fn build(root: &Path, entries: &[Entry]) -> Result<Vec<Library>, Error> {
    let named: Vec<(&str, &str)> =
        entries.iter().map(|entry| (entry.package, entry.identity.model_identifier)).collect();
    build_named(root, &named, "release")
}

/// Builds the libraries of packages, given with their names, in a profile of cargo, without symbols and debug
/// information.
///
/// # Errors
/// Same as [`build`].
pub fn build_named(root: &Path, packages: &[(&str, &str)], profile: &str) -> Result<Vec<Library>, Error> {
    let link = glibc::link_arguments(&root.join("target").join("glibc")).unwrap_or_else(|reason| {
        eprintln!("note: the FMUs will need the glibc of this computer: {reason}");
        Vec::new()
    });
    let one = |(package, identifier): &(&str, &str)| build_one(root, package, identifier, profile, &link);
    packages.iter().map(one).collect()
}

/// Builds one library; arguments for the linker concern it alone, so that nothing that others use is built again.
fn build_one(
    root: &Path,
    package: &str,
    identifier: &str,
    profile: &str,
    link: &[String],
) -> Result<Library, Error> {
    // Set by `cargo run`, so that the same toolchain is used.
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(&cargo);
    command.current_dir(root).args([
        "rustc",
        "--profile",
        profile,
        "--lib",
        "--message-format=json-render-diagnostics",
    ]);
    command.args(["-p", package, "--quiet"]);
    command.arg("--config").arg(format!("profile.{profile}.package.{package}.strip='symbols'"));
    command.arg("--").args(link.iter().map(|argument| format!("-Clink-arg={argument}")));
    let output = command
        .stderr(Stdio::inherit())
        .output()
        .map_err(|e| Error::Build(format!("{} did not start: {e}", cargo.to_string_lossy())))?;
    if !output.status.success() {
        return Err(Error::Build(format!("cargo ended with {}", output.status)));
    }
    let messages = String::from_utf8_lossy(&output.stdout);
    let path = messages.lines().find_map(|line| artifact(line, identifier));
    let path = path.ok_or_else(|| Error::Build(format!("cargo names no library `{identifier}`")))?;
    Ok(library(identifier, path))
}

/// Path of the `cdylib` with this target name in one JSON message of cargo.
fn artifact(line: &str, target: &str) -> Option<PathBuf> {
    let message: serde_json::Value = serde_json::from_str(line).ok()?;
    let is_wanted = message["reason"] == "compiler-artifact"
        && message["target"]["name"] == target
        && message["target"]["kind"].as_array().is_some_and(|kinds| kinds.iter().any(|k| k == "cdylib"));
    // Besides the library there may be import libraries and debug files.
    let is_library = |path: &PathBuf| path.extension().is_some_and(|e| e == std::env::consts::DLL_EXTENSION);
    let files = message["filenames"].as_array().filter(|_| is_wanted)?;
    files.iter().filter_map(|f| f.as_str()).map(PathBuf::from).find(is_library)
}

fn library(identifier: &str, path: PathBuf) -> Library {
    let model_identifier = identifier.to_owned();
    Library { platform: host_platform().to_owned(), model_identifier, path }
}

/// Finds the libraries of this platform in a folder, as cargo names them.
///
/// # Errors
/// The first library that is not there.
pub fn in_folder(folder: &Path, entries: &[Entry]) -> Result<Vec<Library>, Error> {
    entries
        .iter()
        .map(|entry| named_in_folder(folder, entry.package, entry.identity.model_identifier))
        .collect()
}

/// Finds the library of one package in a folder, as cargo names it.
///
/// # Errors
/// It is not there.
pub fn named_in_folder(folder: &Path, package: &'static str, identifier: &str) -> Result<Library, Error> {
    use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
    let path = folder.join(format!("{DLL_PREFIX}{identifier}{DLL_SUFFIX}"));
    if !path.is_file() {
        return Err(Error::NoLibrary { path, package });
    }
    Ok(library(identifier, path))
}

/// Finds libraries that were built elsewhere: `<platform>/<modelIdentifier>.<extension>` in each folder or in its
/// subfolder `binaries`, so that an unpacked FMU fits, too. A `lib` before the name is accepted.
///
/// They must come from the same sources: an FMU refuses to start when library and description differ.
///
/// # Errors
/// A folder that holds no library of any FMU.
pub fn of_platforms(folders: &[PathBuf], entries: &[Entry]) -> Result<Vec<Library>, Error> {
    let mut found: Vec<Library> = Vec::new();
    for folder in folders {
        let before = found.len();
        for entry in entries {
            for new in named_of_platforms(folder, entry.identity.model_identifier) {
                let same =
                    |l: &Library| l.platform == new.platform && l.model_identifier == new.model_identifier;
                if !found.iter().any(same) {
                    found.push(new);
                }
            }
        }
        if found.len() == before {
            return Err(Error::NoPlatform { path: folder.clone() });
        }
    }
    Ok(found)
}

/// The binaries of one library in a folder, for every platform; see [`of_platforms`].
pub fn named_of_platforms(folder: &Path, identifier: &str) -> Vec<Library> {
    let of = |(platform, extension): (&str, &str)| {
        let candidates = ["", "lib"].map(|prefix| format!("{prefix}{identifier}.{extension}"));
        let path = [folder.join(platform), folder.join("binaries").join(platform)]
            .iter()
            .flat_map(|place| candidates.iter().map(move |name| place.join(name)))
            .find(|path| path.is_file())?;
        Some(Library { platform: platform.to_owned(), ..library(identifier, path) })
    };
    PLATFORMS.into_iter().filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use airloop_models::registry;

    #[test]
    fn binaries_of_other_platforms_are_found_in_both_layouts() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for path in ["win64/friction.dll", "binaries/darwin64/libcart_pole.dylib", "win64/unrelated.dll"] {
            let path = folder.path().join(path);
            std::fs::create_dir_all(path.parent().expect("a platform")).expect("writable");
            std::fs::write(path, "binary").expect("writable");
        }
        let found = of_platforms(&[folder.path().to_path_buf()], &registry::all()).expect("two binaries");
        let mut names: Vec<(&str, &str)> =
            found.iter().map(|l| (l.platform.as_str(), l.model_identifier.as_str())).collect();
        names.sort_unstable();
        assert_eq!(names, [("darwin64", "cart_pole"), ("win64", "friction")]);
    }

    #[test]
    fn a_folder_without_binaries_is_refused_by_name() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let error = of_platforms(&[folder.path().to_path_buf()], &registry::all()).expect_err("it is empty");
        assert!(error.to_string().contains("win64/friction.dll"), "{error}");
        let error = in_folder(folder.path(), &registry::all()).expect_err("it is empty");
        assert!(error.to_string().contains("cargo build --release -p fmu-arx-actuator"), "{error}");
    }

    #[test]
    fn the_library_is_read_from_the_messages_of_cargo() {
        let line = |kind: &str| {
            format!(
                r#"{{"reason":"compiler-artifact","target":{{"name":"friction","kind":["{kind}"]}},"filenames":["x/friction.d","x/libfriction.{}"]}}"#,
                std::env::consts::DLL_EXTENSION
            )
        };
        assert!(artifact(&line("cdylib"), "friction").is_some());
        assert_eq!(artifact(&line("rlib"), "friction"), None);
        assert_eq!(artifact(&line("cdylib"), "cart_pole"), None);
        assert_eq!(artifact("not JSON", "friction"), None);
    }
}
