//! Where a file is, seen from a folder.

use std::path::Path;

/// Path of a file as seen from a folder that may not be there yet, with forward slashes.
///
/// # Errors
/// The file is not there.
pub fn relative_path(file: &Path, folder: &Path) -> std::io::Result<String> {
    let absolute = file.canonicalize()?;
    // The part of the folder that is there decides what `..` means.
    let full = std::path::absolute(folder)?;
    let there = full.ancestors().find_map(|part| Some((part, part.canonicalize().ok()?)));
    let base = match there {
        Some((part, real)) => full.strip_prefix(part).map_or_else(|_| real.clone(), |rest| real.join(rest)),
        None => full.clone(),
    };
    let (mut own, mut other) = (absolute.components().peekable(), base.components().peekable());
    while own.peek().is_some() && own.peek() == other.peek() {
        own.next();
        other.next();
    }
    let up = other.map(|_| "..".to_owned());
    let down = own.map(|part| part.as_os_str().to_string_lossy().into_owned());
    Ok(up.chain(down).collect::<Vec<_>>().join("/"))
}
