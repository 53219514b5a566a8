//! Sources of FMUs in a description: URIs relative to the file that is written.

use std::path::{Component, Path, PathBuf};

use crate::system::{Error, SystemGraph};

/// The `source` of each component for a description `file` in `folder`.
pub(super) fn relative(graph: &SystemGraph, file: &Path, folder: &Path) -> Result<Vec<String>, Error> {
    let io = |path: &Path| {
        let file = path.to_owned();
        move |source| Error::Io { file, source }
    };
    let base = folder.canonicalize().map_err(io(folder))?;
    let package = graph.package.as_ref().map(|package| package.path());
    graph
        .components
        .iter()
        .map(|component| {
            let path = &component.fmu.path;
            let what = || format!("the source of component `{}`", component.name);
            if package.is_some_and(|package| path.starts_with(package)) {
                return Err(Error::Unwritable {
                    file: file.into(),
                    what: what(),
                    problem: format!(
                        "its FMU lies inside {}, and a description can only refer to files; write an .ssp",
                        graph.file.display()
                    ),
                });
            }
            let target = path.canonicalize().map_err(io(path))?;
            between(&base, &target).ok_or_else(|| Error::Unwritable {
                file: file.into(),
                what: what(),
                problem: format!("there is no relative path to {} in UTF-8; copy the FMU", target.display()),
            })
        })
        .collect()
}

/// URI that leads from the folder `base` to `target`, both absolute.
fn between(base: &Path, target: &Path) -> Option<String> {
    let (base, target): (Vec<Component>, Vec<Component>) =
        (base.components().collect(), target.components().collect());
    let common = base.iter().zip(&target).take_while(|(a, b)| a == b).count();
    if common == 0 {
        return None;
    }
    let mut parts = vec!["..".to_owned(); base.len() - common];
    for part in &target[common..] {
        parts.push(encoded(part.as_os_str().to_str()?));
    }
    Some(parts.join("/"))
}

/// A path segment with all but the unreserved characters of URIs as percent codes.
pub(super) fn encoded(segment: &str) -> String {
    let mut uri = String::new();
    for byte in segment.bytes() {
        match byte {
            b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' => uri.push(byte as char),
            _ => uri.push_str(&format!("%{byte:02X}")),
        }
    }
    uri
}

/// A file name that no other of `taken` has: `name.ending`, `name-2.ending` ...
pub(super) fn unique(name: &str, ending: &str, taken: &[PathBuf]) -> PathBuf {
    let plain = |c: char| if c.is_alphanumeric() || "-_. ".contains(c) { c } else { '_' };
    let stem: String = name.chars().map(plain).collect();
    let free = |path: &PathBuf| {
        // Some file systems take names that differ in case only for the same.
        let lower = |path: &PathBuf| path.to_string_lossy().to_lowercase();
        !taken.iter().any(|other| lower(other) == lower(path))
    };
    let first = PathBuf::from(format!("{stem}.{ending}"));
    let rest = (2_u32..).map(|number| PathBuf::from(format!("{stem}-{number}.{ending}")));
    std::iter::once(first).chain(rest).find(free).expect("there are more numbers than files")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_between_folders_are_relative_uris() {
        let uri = |base: &str, target: &str| between(Path::new(base), Path::new(target)).unwrap();
        assert_eq!(uri("/a/b/c", "/a/d/x y.fmu"), "../../d/x%20y.fmu");
        assert_eq!(uri("/a", "/a/x.fmu"), "x.fmu");
        assert_eq!(uri("/", "/a/\u{e4}:b.fmu"), "a/%C3%A4%3Ab.fmu");
    }

    #[test]
    fn names_that_are_taken_get_a_number() {
        let taken = ["a.fmu", "A-2.fmu"].map(PathBuf::from);
        assert_eq!(unique("a", "fmu", &taken), Path::new("a-3.fmu"));
        assert_eq!(unique("x/y", "ssv", &taken), Path::new("x_y.ssv"));
    }
}
