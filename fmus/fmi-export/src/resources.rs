//! The folder behind `fmuResourceLocation`.

use std::path::PathBuf;

/// Path of a `file:` URI or a plain path; none for an empty text or another scheme.
///
/// Accepts `file:///a/b`, `file:/a/b`, `file://localhost/a/b` and percent-encoding (RFC 8089).
pub(crate) fn folder(location: &str) -> Option<PathBuf> {
    let location = location.trim();
    if location.is_empty() {
        return None;
    }
    let Some(rest) = location.strip_prefix("file:") else {
        return (!location.contains("://")).then(|| PathBuf::from(location));
    };
    let path = match rest.strip_prefix("//") {
        Some(with_host) => &with_host[with_host.find('/')?..],
        None => rest,
    };
    let path = percent_decode(path)?;
    // file:///C:/folder
    let is_drive = path.len() > 2 && path.as_bytes()[0] == b'/' && path.as_bytes()[2] == b':';
    Some(PathBuf::from(if is_drive { &path[1..] } else { &path }))
}

fn percent_decode(text: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let [first, tail @ ..] = rest {
        rest = tail;
        if *first == b'%' {
            let (code, tail) = rest.split_at_checked(2)?;
            bytes.push(u8::from_str_radix(std::str::from_utf8(code).ok()?, 16).ok()?);
            rest = tail;
        } else {
            bytes.push(*first);
        }
    }
    String::from_utf8(bytes).ok()
}

#[cfg(test)]
mod tests {
    use super::folder;
    use std::path::PathBuf;

    #[test]
    fn every_spelling_of_a_file_uri_gives_the_folder() {
        for uri in ["file:///a/b%20c/r", "file:/a/b%20c/r", "file://localhost/a/b%20c/r", "/a/b c/r"] {
            assert_eq!(folder(uri), Some(PathBuf::from("/a/b c/r")), "{uri}");
        }
        assert_eq!(folder("file:///C:/r"), Some(PathBuf::from("C:/r")));
        for none in ["", "  ", "https://host/r", "file:///%zz"] {
            assert_eq!(folder(none), None, "{none}");
        }
    }
}
