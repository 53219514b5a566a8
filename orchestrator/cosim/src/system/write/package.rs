//! An `.ssp` archive: the description, the FMUs and a parameter set per component that has start values.
//!
//! FMUs that can hold start values get those of their component ([`baked`]); the parameter set says the same once more,
//! for readers that know FMUs by their files.

use std::fs::File;
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};

use airloop_series::fails_once::FailsOnce;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use tempfile::TempDir;

use super::document::{How, component_name, description, parameter_set};
use super::source::{encoded, unique};
use super::{Error, baked, unpacked};
use crate::system::SystemGraph;

/// Planned content of an archive: all texts are made, the FMUs are found.
pub(super) struct Package {
    /// Name in the archive and content.
    texts: Vec<(String, String)>,
    /// Name in the archive and file.
    fmus: Vec<(String, PathBuf)>,
    /// Holds the derived FMUs until they are packed.
    _derived: TempDir,
}

impl Package {
    pub fn new(graph: &SystemGraph, how: How, file: &Path) -> Result<Package, Error> {
        let derived =
            airloop_series::scratch::folder().map_err(|source| Error::Write { file: file.into(), source })?;
        let mut taken: Vec<PathBuf> = Vec::new();
        let mut known: Vec<(PathBuf, PathBuf)> = Vec::new();
        // Archives and unpacked folders of the components as they are, with their names in the package.
        let mut opened: Vec<(PathBuf, PathBuf)> = Vec::new();
        let (mut sources, mut sets, mut texts) = (Vec::new(), Vec::new(), Vec::new());
        for (index, component) in graph.components.iter().enumerate() {
            let path = &component.fmu.path;
            let own = component_name(graph, index);
            let out = derived.path().join(format!("{index}.fmu"));
            if baked::derive(component, &own, file, &out)? {
                let name = unique(&own, "fmu", &taken);
                taken.push(name.clone());
                sources.push(format!("resources/{}", encoded(&name.to_string_lossy())));
                known.push((out, name));
                continue;
            }
            let at = |source| Error::Io { file: path.clone(), source };
            let real = path.canonicalize().map_err(at)?;
            let name = match opened.iter().find(|(other, _)| *other == real) {
                Some((_, name)) => name.clone(),
                None => {
                    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
                    let name = unique(&stem, "fmu", &taken);
                    taken.push(name.clone());
                    opened.push((real.clone(), name.clone()));
                    let packed = if real.is_dir() {
                        unpacked::pack(&component.fmu, &out).map_err(at)?;
                        out
                    } else {
                        real
                    };
                    known.push((packed, name.clone()));
                    name
                }
            };
            sources.push(format!("resources/{}", encoded(&name.to_string_lossy())));
        }
        for (index, component) in graph.components.iter().enumerate() {
            if component.start_values.is_empty() {
                sets.push(None);
                continue;
            }
            let name = component_name(graph, index);
            let inside = unique(&name, "ssv", &taken);
            taken.push(inside.clone());
            let inside = inside.to_string_lossy().into_owned();
            sets.push(Some(format!("resources/{}", encoded(&inside))));
            let text = parameter_set(component, how, file)?;
            texts.push((format!("resources/{inside}"), text));
        }
        let text = description(graph, &sources, Some(&sets), how, file)?;
        texts.insert(0, ("SystemStructure.ssd".into(), text));
        let fmus =
            known.into_iter().map(|(path, name)| (format!("resources/{}", name.display()), path)).collect();
        Ok(Package { texts, fmus, _derived: derived })
    }

    /// Writes the archive; time stamps are the earliest that zip has, permissions are fixed.
    pub fn write(&self, out: impl Write + Seek) -> io::Result<()> {
        let options =
            SimpleFileOptions::default().last_modified_time(DateTime::default()).unix_permissions(0o644);
        let mut zip = ZipWriter::new(FailsOnce::new(out));
        for (name, text) in &self.texts {
            zip.start_file(name.as_str(), options.compression_method(CompressionMethod::Deflated))?;
            zip.write_all(text.as_bytes())?;
        }
        for (name, path) in &self.fmus {
            let mut fmu = File::open(path)?;
            let large = fmu.metadata()?.len() >= u64::from(u32::MAX);
            // FMUs are archives themselves: packing them again gains nothing.
            let options = options.compression_method(CompressionMethod::Stored).large_file(large);
            zip.start_file(name.as_str(), options)?;
            io::copy(&mut fmu, &mut zip)?;
        }
        zip.finish()?;
        Ok(())
    }
}
