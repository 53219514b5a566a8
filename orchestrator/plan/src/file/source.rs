//! The text of a problem file, and places in it.

use std::path::{Path, PathBuf};

use crate::Error;

/// The text of a problem file with its path.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Source {
    /// Path, as given.
    pub file: PathBuf,
    /// The whole text.
    pub text: String,
}

/// A place in a file, in bytes from its beginning; [`Source::line_column`] counts it for a reader.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct Place(pub usize);

impl Source {
    /// Reads a file.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn read(file: &Path) -> Result<Source, Error> {
        let text = airloop_series::file::read_to_string(file)
            .map_err(|source| Error::Io { file: file.into(), source })?;
        Ok(Source { file: file.into(), text })
    }

    /// Line and column (in characters) of a place, from 1.
    pub fn line_column(&self, place: Place) -> (usize, usize) {
        let start = (0..=place.0.min(self.text.len())).rev().find(|&at| self.text.is_char_boundary(at));
        let before = &self.text[..start.unwrap_or(0)];
        let line_start = before.rfind('\n').map_or(0, |at| at + 1);
        (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
    }

    /// The first of some keys that the file has at its root, and its place.
    pub fn key<'a>(&self, keys: &[&'a str]) -> Option<(&'a str, Place)> {
        let document = toml::de::DeTable::parse(&self.text).ok()?;
        keys.iter().find_map(|&key| Some((key, Place(document.get_ref().get_key_value(key)?.0.span().start))))
    }

    /// Error at a place.
    pub fn error_at(&self, place: Place, problem: impl Into<String>) -> Error {
        let (line, column) = self.line_column(place);
        Error::File { file: self.file.clone(), line, column, problem: problem.into() }
    }

    /// A fingerprint of the text and of `more` (GUIDs of FMUs): FNV-1a of 64 bits, as 16 hexadecimal digits.
    pub fn hash<'a>(&'a self, more: impl IntoIterator<Item = &'a str>) -> String {
        let parts = std::iter::once(self.text.as_str()).chain(more);
        let mut hash = 0xcbf2_9ce4_8422_2325_u64;
        for byte in parts.flat_map(|part| part.bytes().chain([0])) {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
        format!("{hash:016x}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn source(text: &str) -> Source {
        Source { file: "p.toml".into(), text: text.into() }
    }

    #[test]
    fn places_count_lines_and_characters_from_one() {
        let source = source("a = 1\nß = 22\n");
        assert_eq!(source.line_column(Place(0)), (1, 1));
        assert_eq!(source.line_column(Place(source.text.find("22").unwrap())), (2, 5));
        assert_eq!(source.line_column(Place(1000)), (3, 1));
    }

    #[test]
    fn the_fingerprint_is_that_of_fnv_and_tells_parts_apart() {
        // FNV-1a of "a" and a zero byte.
        let step = |h: u64, b: u64| (h ^ b).wrapping_mul(1_099_511_628_211);
        let expected = step(step(14_695_981_039_346_656_037, 97), 0);
        assert_eq!(source("a").hash([]), format!("{expected:016x}"));
        assert_ne!(source("a").hash(["bc"]), source("a").hash(["b", "c"]));
    }
}
