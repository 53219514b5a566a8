//! `packager`: builds every FMU, or checks the model descriptions kept in the repository.

use airloop_models::registry;
use clap::Parser;
use packager::{Error, Request, descriptions};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Builds the FMU libraries and writes target/fmu/*.fmu, target/fmu/test/*.fmu (and those of FMI 3.0 in folders fmi3
/// beside them) and modelDescriptions/*.xml.
///
/// The same sources and toolchain give the same bytes.
#[derive(Parser)]
#[command(version)]
struct Args {
    /// Only compare modelDescriptions/*.xml with the models; exit code 1 when one is stale
    #[arg(long)]
    check: bool,
    /// Take the libraries of this platform from DIR (as cargo names them) instead of building them
    #[arg(long, value_name = "DIR")]
    lib_dir: Option<PathBuf>,
    /// Add binaries built elsewhere from the same sources: DIR/<platform>/<modelIdentifier>.<ext>, such as
    /// DIR/win64/friction.dll, or the same below DIR/binaries; may be given more than once
    #[arg(long, value_name = "DIR")]
    add_platform: Vec<PathBuf>,
    /// Cargo profile of the library of `airloop export-fmu`: with that of the program, both share their libraries
    #[arg(long, value_name = "PROFILE", default_value = "release")]
    system_profile: String,
    /// Folder of the FMUs [default: target/fmu in the repository]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// The repository [default: the folder above the current one that has fmus/packager]
    #[arg(long, value_name = "DIR")]
    root: Option<PathBuf>,
}

fn main() -> ExitCode {
    match run(Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(errors) => {
            errors.iter().for_each(|e| eprintln!("error: {e}"));
            ExitCode::FAILURE
        }
    }
}

fn run(args: Args) -> Result<(), Vec<Error>> {
    let root = match args.root {
        Some(root) => root,
        None => find_root().map_err(|e| vec![e])?,
    };
    if args.check {
        let errors = descriptions::check(&root, &registry::all());
        return if errors.is_empty() { Ok(()) } else { Err(errors) };
    }
    let out = args.out.unwrap_or_else(|| root.join("target/fmu"));
    let Args { lib_dir, add_platform, system_profile, .. } = args;
    let request = Request { root, lib_dir, add_platform, system_profile, out };
    let written = packager::package(&request).map_err(|e| vec![e])?;
    written.iter().for_each(|path| println!("{}", path.display()));
    Ok(())
}

fn find_root() -> Result<PathBuf, Error> {
    let here = std::env::current_dir().unwrap_or_else(|_| PathBuf::from("."));
    let is_root = |folder: &&Path| folder.join("fmus/packager/Cargo.toml").is_file();
    here.ancestors().find(is_root).map(Path::to_path_buf).ok_or(Error::NoRoot { path: here.clone() })
}
