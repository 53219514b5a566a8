//! The `.fmu` archive of a system: description, library, and the system with its FMUs unpacked in the resources.

use std::fs::File;
use std::io::{self, Read, Seek, Write};
use std::path::{Path, PathBuf};

use airloop_cosim::master::embedded::Value;
use airloop_cosim::system::write::{self, Version};
use airloop_cosim::system::{self, SystemGraph};
use airloop_fmi::{Fmu, InterfaceKind};
use airloop_series::fails_once::FailsOnce;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipArchive, ZipWriter};

use crate::description;
use crate::recipe::{FILE, Recipe, STRUCTURE, SYSTEM};
use crate::table::{Table, has};

/// Reason why a system does not become an FMU. Nothing was written.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The system cannot be written or read back.
    #[error(transparent)]
    System(#[from] system::Error),
    /// A component's FMU cannot be opened.
    #[error(transparent)]
    Fmu(#[from] airloop_fmi::Error),
    /// No interface that all components have.
    #[error(
        "the components have no interface in common: {0}; a system FMU needs Co-Simulation or Model Exchange of all"
    )]
    NoInterface(String),
    /// No platform that all components and the library have.
    #[error("there is no platform for which the library and all components have a binary: {0}")]
    NoPlatform(String),
    /// A start value that an FMU of FMI 2.0 cannot have.
    #[error(
        "`{name}` starts at {value}, and an Integer of FMI 2.0 has 32 bits; give it another start value with `--set`"
    )]
    WideInteger {
        /// The variable.
        name: String,
        /// Its start value.
        value: i64,
    },
    /// A setting out of range.
    #[error("the step {0} s of the master is refused; it must be positive and finite")]
    Step(f64),
    /// A file that cannot be read or written.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Message of the operating system.
        source: io::Error,
    },
}

/// One file of the archive.
struct Member {
    name: String,
    bytes: Vec<u8>,
}

/// Writes the system as an FMU to `out`; `template` is the archive with the libraries of this crate. Gives the
/// platforms on which it runs.
///
/// # Errors
/// Components without an interface or platform in common, or files that cannot be read or written.
pub fn write(
    graph: &SystemGraph,
    recipe: &Recipe,
    template: &Path,
    out: &Path,
) -> Result<Vec<String>, Error> {
    if !(recipe.step > 0.0 && recipe.step.is_finite()) {
        return Err(Error::Step(recipe.step));
    }
    check_interfaces(graph)?;
    let at = |path: &Path| {
        let path = path.to_owned();
        move |source| Error::File { path, source }
    };
    let work = airloop_series::scratch::folder().map_err(at(out))?;
    let package = work.path().join("system.ssp");
    write::write(graph, &package, Version::V1_0)?;
    let mut members = Vec::new();
    for (name, bytes) in entries(&package)? {
        if !name.ends_with(".fmu") {
            members.push(Member { name: format!("resources/{SYSTEM}/{name}"), bytes });
            continue;
        }
        // An FMU is a folder under its own name, so that nobody has to unpack it at every start.
        let inner = work.path().join("inner.fmu");
        std::fs::write(&inner, bytes).map_err(at(&inner))?;
        for (file, bytes) in entries(&inner)? {
            members.push(Member { name: format!("resources/{SYSTEM}/{name}/{file}"), bytes });
        }
    }
    // What the library will read, so that both have the same variables.
    let folder = work.path().join("unpacked");
    for member in &members {
        let path = folder.join(&member.name);
        std::fs::create_dir_all(path.parent().unwrap_or(&folder)).map_err(at(&path))?;
        std::fs::write(&path, &member.bytes).map_err(at(&path))?;
    }
    let mut again = SystemGraph::open_to_read(&folder.join("resources").join(SYSTEM).join(STRUCTURE))?;
    again.experiment = graph.experiment;
    let table = Table::with(&again, recipe);
    for variable in &table.variables {
        if let Some(Value::Integer(value)) = variable.start
            && i32::try_from(value).is_err()
        {
            return Err(Error::WideInteger { name: variable.name.clone(), value });
        }
    }
    let mut recipe = recipe.clone();
    recipe.guid = String::new();
    let digest = members.iter().fold(description::text(&again, &recipe, &table), |mut text, member| {
        let content = fmi_export::fingerprint(&String::from_utf8_lossy(&member.bytes));
        text.push_str(&format!("\n{} {content}", member.name));
        text
    });
    recipe.guid = fmi_export::fingerprint(&format!("{digest}\n{:?}", recipe.master));

    let libraries = entries(template)?;
    let platforms = platforms(&again, &libraries)?;
    for (name, bytes) in libraries {
        let wanted = |platform: &String| name.starts_with(&format!("binaries/{platform}/"));
        if platforms.iter().any(wanted) || name.starts_with("documentation/licenses/") {
            members.push(Member { name, bytes });
        }
    }
    let text = toml::to_string(&recipe).unwrap_or_default();
    members.push(Member { name: format!("resources/{FILE}"), bytes: text.into_bytes() });
    let page = documentation(&again, &recipe, &members);
    members.push(Member { name: "documentation/index.html".into(), bytes: page.into_bytes() });
    let text = description::text(&again, &recipe, &table).into_bytes();
    members.insert(0, Member { name: "modelDescription.xml".into(), bytes: text });
    drop(again);
    airloop_series::file::write_whole(out, |file| pack(file, &members)).map_err(at(out))?;
    Ok(platforms)
}

fn check_interfaces(graph: &SystemGraph) -> Result<(), Error> {
    if [InterfaceKind::CoSimulation, InterfaceKind::ModelExchange].iter().any(|&kind| has(graph, kind)) {
        return Ok(());
    }
    let offered = graph.components.iter().map(|component| {
        let kinds = [InterfaceKind::CoSimulation, InterfaceKind::ModelExchange];
        let kinds: Vec<String> = kinds
            .iter()
            .filter(|&&kind| component.fmu.interface(kind).is_some())
            .map(ToString::to_string)
            .collect();
        format!("{} has {}", component.name, kinds.join(" and "))
    });
    Err(Error::NoInterface(offered.collect::<Vec<_>>().join(", ")))
}

/// Platforms of the libraries for which all components have a binary.
fn platforms(graph: &SystemGraph, libraries: &[(String, Vec<u8>)]) -> Result<Vec<String>, Error> {
    let mut own: Vec<String> = libraries
        .iter()
        .filter_map(|(name, _)| Some(name.strip_prefix("binaries/")?.split_once('/')?.0.to_owned()))
        .collect();
    own.sort();
    own.dedup();
    let of = |fmu: &Fmu| fmu.platforms().into_iter().map(as_in_fmi2).map(str::to_owned).collect::<Vec<_>>();
    let common: Vec<String> = own
        .iter()
        .filter(|platform| graph.components.iter().all(|component| of(&component.fmu).contains(platform)))
        .cloned()
        .collect();
    if !common.is_empty() {
        return Ok(common);
    }
    let each = graph
        .components
        .iter()
        .map(|component| format!("{} {}", component.name, of(&component.fmu).join(", ")));
    let all: Vec<String> = std::iter::once(format!("library {}", own.join(", "))).chain(each).collect();
    Err(Error::NoPlatform(all.join("; ")))
}

/// Name of a platform in FMI 2.0, where it has one; components of FMI 3.0 call it otherwise.
fn as_in_fmi2(platform: &str) -> &str {
    match platform {
        "x86_64-linux" => "linux64",
        "x86-linux" => "linux32",
        "x86_64-windows" => "win64",
        "x86-windows" => "win32",
        "x86_64-darwin" => "darwin64",
        other => other,
    }
}

/// All files of an archive.
fn entries(path: &Path) -> Result<Vec<(String, Vec<u8>)>, Error> {
    let at = |source| Error::File { path: path.to_owned(), source };
    let mut zip = ZipArchive::new(File::open(path).map_err(at)?).map_err(|error| at(error.into()))?;
    let mut files = Vec::new();
    for index in 0..zip.len() {
        let mut entry = zip.by_index(index).map_err(|error| at(error.into()))?;
        if entry.is_file() {
            let mut bytes = Vec::new();
            entry.read_to_end(&mut bytes).map_err(at)?;
            files.push((entry.name().to_owned(), bytes));
        }
    }
    Ok(files)
}

/// The first page: components, master, and the licenses that travel with them.
fn documentation(graph: &SystemGraph, recipe: &Recipe, members: &[Member]) -> String {
    let escape = fmi_export::description::escape;
    let rows: String = graph
        .components
        .iter()
        .map(|component| {
            let description = &component.fmu.description;
            format!(
                "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
                escape(&component.name),
                escape(&description.model_name),
                escape(&description.generation_tool),
                escape(&description.description)
            )
        })
        .collect();
    let licenses: String = members
        .iter()
        .filter(|member| member.name.to_lowercase().contains("license"))
        .map(|member| format!("<li><code>{}</code></li>\n", escape(&member.name)))
        .collect();
    format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{name}</title></head>\n<body>\n\
         <h1>{name}</h1>\n<p>A system of {count} FMUs as one. Co-Simulation: master {master:?}, step {step} s inside. Model \
         Exchange: one differential equation without coupling error.</p>\n<table>\n<tr><th>component</th><th>model</th>\
         <th>made by</th><th>description</th></tr>\n{rows}</table>\n<h2>Licenses</h2>\n<ul>\n{licenses}</ul>\n</body></html>\n",
        name = escape(&recipe.name),
        count = graph.components.len(),
        master = recipe.master,
        step = recipe.step,
    )
}

/// Writes the archive; time stamps are the earliest that zip has.
fn pack(out: impl Write + Seek, members: &[Member]) -> io::Result<()> {
    let mut zip = ZipWriter::new(FailsOnce::new(out));
    for member in members {
        let executable = member.name.contains("binaries/");
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Deflated)
            .last_modified_time(DateTime::default())
            .unix_permissions(if executable { 0o755 } else { 0o644 });
        zip.start_file(member.name.as_str(), options)?;
        zip.write_all(&member.bytes)?;
    }
    zip.finish()?;
    Ok(())
}
