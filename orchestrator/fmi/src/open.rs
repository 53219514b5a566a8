//! Opening an FMU: archive, model description, and the library on first use.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use tempfile::TempDir;

use super::archive::{Archive, ArchiveError, Limits, Unpacked};
use super::description::{Interface, ModelDescription};
use super::error::Error;
use super::feed_through::FeedThrough;
use super::isolate;
use super::library::{Library, platform_folders};

/// One of the two interfaces that are imported.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum InterfaceKind {
    /// The FMU steps itself.
    CoSimulation,
    /// The importer integrates.
    ModelExchange,
}

impl fmt::Display for InterfaceKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl InterfaceKind {
    pub(super) fn name(self) -> &'static str {
        match self {
            InterfaceKind::CoSimulation => "Co-Simulation",
            InterfaceKind::ModelExchange => "Model Exchange",
        }
    }
}

/// Place of the files of an FMU.
enum Folder {
    /// Unpacked here; removed when dropped.
    Temporary(TempDir),
    /// Of the user.
    Kept(PathBuf),
    /// Those of another FMU.
    Of(Arc<Fmu>),
}

impl Folder {
    fn path(&self) -> &Path {
        match self {
            Folder::Temporary(folder) => folder.path(),
            Folder::Kept(folder) => folder,
            Folder::Of(other) => other.folder(),
        }
    }
}

/// An opened FMU. Its files lie in a temporary folder that goes when the last user (instances included) is dropped, or
/// in the folder that was opened.
pub struct Fmu {
    /// The archive.
    pub path: PathBuf,
    /// Name of the archive in messages and records: its path, or its place inside of a package.
    pub shown: PathBuf,
    /// Content of `modelDescription.xml`.
    pub description: ModelDescription,
    // Dropped before `folder`: a library is closed before its file is removed.
    libraries: Mutex<Vec<(String, Arc<Library>)>>,
    folder: Folder,
    files: Vec<String>,
    folders: Vec<String>,
    /// Lengths that structural parameters have here and not in the archive.
    pub(super) sizes: Vec<(String, i64)>,
    feed_through: OnceLock<FeedThrough>,
}

impl fmt::Debug for Fmu {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Fmu").field("path", &self.shown).field("model", &self.description.model_name).finish()
    }
}

/// The model description of the FMU that messages call `shown`, with other values of structural parameters.
fn describe(shown: &Path, xml: &[u8], structure: &[(String, i64)]) -> Result<ModelDescription, Error> {
    ModelDescription::parse_resized(xml, structure)
        .map_err(|source| Error::Description { path: shown.to_owned(), source })
}

impl Fmu {
    /// Checks and unpacks the archive at `path` and reads its model description, with the default [`Limits`]; a folder
    /// with a `modelDescription.xml` is taken for an FMU that is unpacked already.
    ///
    /// The library is loaded when the first instance is made, so an FMU without a binary for this platform can be
    /// opened and inspected.
    ///
    /// # Errors
    /// [`Error::Archive`] or [`Error::Description`], with file, place and what is wrong.
    pub fn open(path: &Path) -> Result<Arc<Fmu>, Error> {
        Fmu::open_within(path, &Limits::default())
    }

    /// Like [`Fmu::open`] for an archive that messages call `shown`.
    ///
    /// # Errors
    /// Same as [`Fmu::open`].
    pub fn open_shown(path: &Path, shown: &Path) -> Result<Arc<Fmu>, Error> {
        Fmu::open_as(path, shown, &Limits::default())
    }

    /// Like [`Fmu::open`] with other limits on the archive.
    ///
    /// # Errors
    /// Same as [`Fmu::open`].
    pub fn open_within(path: &Path, limits: &Limits) -> Result<Arc<Fmu>, Error> {
        Fmu::open_as(path, path, limits)
    }

    fn open_as(path: &Path, shown: &Path, limits: &Limits) -> Result<Arc<Fmu>, Error> {
        if path.join("modelDescription.xml").is_file() {
            return Fmu::open_folder(path, shown, limits);
        }
        let refuse = |source| Error::Archive { path: shown.to_owned(), source };
        let mut archive = Archive::open(path, limits).map_err(refuse)?;
        let description = describe(shown, &archive.description().map_err(refuse)?, &[])?;
        let Unpacked { folder, files, folders } = archive.unpack().map_err(refuse)?;
        Ok(Fmu::new((path, shown), description, (Folder::Temporary(folder), files, folders), &[]))
    }

    /// An FMU of which no library is loaded yet, with lengths of its arrays that differ from those of the archive.
    fn new(
        (path, shown): (&Path, &Path),
        description: ModelDescription,
        (folder, files, folders): (Folder, Vec<String>, Vec<String>),
        sizes: &[(String, i64)],
    ) -> Arc<Fmu> {
        Arc::new(Fmu {
            path: path.to_owned(),
            shown: shown.to_owned(),
            description,
            libraries: Mutex::default(),
            folder,
            files,
            folders,
            sizes: sizes.to_vec(),
            feed_through: OnceLock::new(),
        })
    }

    fn open_folder(path: &Path, shown: &Path, limits: &Limits) -> Result<Arc<Fmu>, Error> {
        let refuse = |source| Error::Archive { path: shown.to_owned(), source: ArchiveError::Read(source) };
        let folder = path.canonicalize().map_err(refuse)?;
        let (mut files, mut folders) = (Vec::new(), Vec::new());
        let mut open = vec![String::new()];
        while let Some(inner) = open.pop() {
            for entry in std::fs::read_dir(folder.join(&inner)).map_err(refuse)? {
                let entry = entry.map_err(refuse)?;
                let name = format!("{inner}{}", entry.file_name().to_string_lossy());
                if entry.file_type().map_err(refuse)?.is_dir() {
                    open.push(format!("{name}/"));
                    folders.push(format!("{name}/"));
                } else {
                    files.push(name);
                }
            }
            if files.len() + folders.len() > limits.entries {
                let (what, found) = ("the number of entries".to_owned(), files.len() + folders.len());
                let (found, limit) = (found as u64, limits.entries as u64);
                let source = ArchiveError::TooLarge { what, found, limit };
                return Err(Error::Archive { path: shown.to_owned(), source });
            }
        }
        files.sort();
        folders.sort();
        let xml = std::fs::read(folder.join("modelDescription.xml")).map_err(refuse)?;
        let description = describe(shown, &xml, &[])?;
        Ok(Fmu::new((path, shown), description, (Folder::Kept(folder), files, folders), &[]))
    }

    /// The same FMU with other lengths of its arrays: values of structural parameters, by name (FMI 3.0). They are set
    /// in every instance before anything else.
    ///
    /// # Errors
    /// [`Error::Description`] where the description makes no sense with these values.
    pub fn resized(self: &Arc<Fmu>, structure: &[(String, i64)]) -> Result<Arc<Fmu>, Error> {
        let refuse = |source| Error::Archive { path: self.shown.clone(), source: ArchiveError::Read(source) };
        let xml = std::fs::read(self.folder().join("modelDescription.xml")).map_err(refuse)?;
        let description = describe(&self.shown, &xml, structure)?;
        let contents = (Folder::Of(Arc::clone(self)), self.files.clone(), self.folders.clone());
        Ok(Fmu::new((&self.path, &self.shown), description, contents, structure))
    }

    /// The unpacked `resources` folder as a `file:///` URI, as fmi2Instantiate wants it.
    pub fn resources_uri(&self) -> String {
        let path = self.folder.path().join("resources");
        let mut uri = String::from("file://");
        for byte in path.to_string_lossy().bytes() {
            match byte {
                b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' | b'/' => {
                    uri.push(byte as char)
                }
                _ => uri.push_str(&format!("%{byte:02X}")),
            }
        }
        uri
    }

    /// The unpacked `resources` folder.
    pub fn resources(&self) -> PathBuf {
        self.folder.path().join("resources")
    }

    /// The folder with the unpacked files.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Names of all files in the archive, with forward slashes, in archive order.
    pub fn files(&self) -> &[String] {
        &self.files
    }

    /// Whether the archive has the folder `name` (with a slash at the end), be it empty.
    pub(super) fn has_folder(&self, name: &str) -> bool {
        let mut entries = self.files().iter().chain(&self.folders);
        entries.any(|entry| entry.starts_with(name))
    }

    /// Folders below `binaries/` that hold at least one file, sorted.
    pub fn platforms(&self) -> Vec<&str> {
        let mut platforms: Vec<_> = self
            .files()
            .iter()
            .filter_map(|file| file.strip_prefix("binaries/")?.split_once('/').map(|(platform, _)| platform))
            .collect();
        platforms.sort_unstable();
        platforms.dedup();
        platforms
    }

    /// The capabilities of an interface, if the FMU offers it.
    pub fn interface(&self, kind: InterfaceKind) -> Option<&Interface> {
        match kind {
            InterfaceKind::CoSimulation => self.description.co_simulation.as_ref(),
            InterfaceKind::ModelExchange => self.description.model_exchange.as_ref(),
        }
    }

    /// Inputs (indices of variables) on which an output depends directly: none where it is a continuous state of an FMU
    /// with Model Exchange, else all inputs where the FMU does not say.
    pub fn feed_through(&self, output: usize) -> &[usize] {
        self.all_feed_through().running(output)
    }

    /// Inputs (indices of variables) on which an output depends in initialization mode; where the FMU does not say,
    /// those of [`Fmu::feed_through`].
    pub fn initial_feed_through(&self, output: usize) -> &[usize] {
        self.all_feed_through().initial(output)
    }

    fn all_feed_through(&self) -> &FeedThrough {
        self.feed_through.get_or_init(|| FeedThrough::new(&self.description))
    }

    /// The library of an interface, loaded once.
    pub(super) fn library(&self, kind: InterfaceKind) -> Result<Arc<Library>, Error> {
        let Some(interface) = self.interface(kind) else {
            let offered = [InterfaceKind::CoSimulation, InterfaceKind::ModelExchange]
                .into_iter()
                .find(|&other| self.interface(other).is_some())
                .map_or("none", InterfaceKind::name);
            let (path, offered) = (self.shown.clone(), offered.to_owned());
            return Err(Error::Interface { path, wanted: kind.name(), offered });
        };
        if let Folder::Of(other) = &self.folder {
            return other.library(kind);
        }
        let identifier = &interface.model_identifier;
        let mut libraries = self.libraries.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, library)) = libraries.iter().find(|(name, _)| name == identifier) {
            return Ok(Arc::clone(library));
        }
        let inner = self.binary(identifier)?;
        let library = Arc::new(match isolate::choice(&self.description.generation_tool) {
            Some(isolation) => Library::in_worker(self, kind, &inner, &isolation)?,
            None => {
                let load = if self.description.is_fmi3() { Library::load_fmi3 } else { Library::load };
                load(&self.shown, self.folder.path(), &inner)?
            }
        });
        libraries.push((identifier.clone(), Arc::clone(&library)));
        Ok(library)
    }

    /// Path inside the archive of the library for this platform.
    fn binary(&self, identifier: &str) -> Result<String, Error> {
        let paths = platform_folders()
            .iter()
            .map(|folder| format!("binaries/{folder}/{identifier}{}", std::env::consts::DLL_SUFFIX));
        for path in paths {
            if self.files().contains(&path) {
                return Ok(path);
            }
        }
        let platforms = self.platforms();
        // FMI 3.0 writes x86_64-linux where FMI 2.0 writes linux64.
        let usual = |folder: &&&str| folder.contains('-') == self.description.is_fmi3();
        let folder = platform_folders().iter().find(usual).or(platform_folders().first());
        Err(Error::NoBinary {
            path: self.shown.clone(),
            wanted: format!(
                "binaries/{}/{identifier}{}",
                folder.unwrap_or(&std::env::consts::OS),
                std::env::consts::DLL_SUFFIX
            ),
            available: if platforms.is_empty() { "no platform".to_owned() } else { platforms.join(", ") },
        })
    }
}
