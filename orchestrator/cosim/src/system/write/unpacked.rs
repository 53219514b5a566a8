//! FMUs that lie in a folder, made into archives again.

use std::fs::File;
use std::io;
use std::path::Path;

use airloop_fmi::Fmu;
use airloop_series::fails_once::FailsOnce;
use zip::write::SimpleFileOptions;
use zip::{DateTime, ZipWriter};

/// Writes the files of an FMU into an archive, with the earliest time stamp that zip has.
pub(super) fn pack(fmu: &Fmu, out: &Path) -> io::Result<()> {
    let options =
        SimpleFileOptions::default().last_modified_time(DateTime::default()).unix_permissions(0o755);
    let mut zip = ZipWriter::new(FailsOnce::new(File::create(out)?));
    // The description first, where readers look for it.
    let mut files: Vec<&String> = fmu.files().iter().collect();
    files.sort_by_key(|name| (name.as_str() != "modelDescription.xml", name.as_str()));
    for name in files {
        zip.start_file(name.as_str(), options)?;
        io::copy(&mut File::open(fmu.folder().join(name))?, &mut zip)?;
    }
    zip.finish()?;
    Ok(())
}
