//! Libraries that also run with an older glibc than that of this computer.
//!
//! glibc keeps the old versions of its symbols, but a linker takes the newest. So the libraries of FMUs are linked
//! against stand-ins for libc, libm, libpthread and libdl that hold the names alone, each with the newest version that
//! [`OLDEST`] has, as the development files of that release would. The names are read from the libraries of this
//! computer.
//!
//! Functions that later became symbols (`stat64` and relatives, glibc 2.33) are what they were in the static part of
//! glibc 2.28, `libc_nonshared.a`. A weak symbol that is newer than [`OLDEST`] stays unresolved; the standard library
//! of Rust does without.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Oldest glibc that the libraries run with: RHEL 8, and what is younger (Debian 10, Ubuntu 18.10).
pub const OLDEST: [u32; 2] = [2, 28];
/// From this version on, libc holds what libpthread and libdl held before.
const MERGED: [u32; 2] = [2, 34];

/// Version of a symbol, such as 2.2.5.
type Version = Vec<u32>;
/// Version and kind of each symbol by its name.
type Symbols = BTreeMap<String, (Version, char)>;

/// Arguments for the linker, which find stand-ins in a folder that is written here; none where this is no Linux with
/// glibc.
///
/// # Errors
/// A reason in words: a tool is missing, or a file cannot be read or written.
pub fn link_arguments(folder: &Path) -> Result<Vec<String>, String> {
    // What `stat64` of the static part passes on as the version of its structure.
    let stat_version = match std::env::consts::ARCH {
        "x86_64" => 1,
        "aarch64" => 0,
        _ => return Ok(Vec::new()),
    };
    if !cfg!(all(target_os = "linux", target_env = "gnu")) {
        return Ok(Vec::new());
    }
    std::fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let folder = folder.canonicalize().map_err(|error| format!("{}: {error}", folder.display()))?;
    let libc = defined(&library("libc.so.6")?)?;
    let (mut main, mut threads, mut loading) = (Symbols::new(), Symbols::new(), Symbols::new());
    for (name, versions) in libc {
        let was_elsewhere = versions.iter().any(|(version, _)| version[..] == MERGED);
        let Some(old) = newest_old(versions) else { continue };
        let of = match (was_elsewhere, name.starts_with("dl")) {
            (false, _) => &mut main,
            (true, true) => &mut loading,
            (true, false) => &mut threads,
        };
        of.insert(name, old);
    }
    let math = defined(&library("libm.so.6")?)?;
    let math = math.into_iter().filter_map(|(name, versions)| Some((name, newest_old(versions)?))).collect();
    stand_in(&folder, "libc.so.6", "libc.so.6", &main)?;
    stand_in(&folder, "libpthread.so", "libpthread.so.0", &threads)?;
    stand_in(&folder, "libdl.so", "libdl.so.2", &loading)?;
    stand_in(&folder, "libm.so", "libm.so.6", &math)?;
    let object = static_part(&folder, stat_version)?;
    let script = linker_script(&folder.join("libc.so.6"), &object)?;
    write(&folder.join("libc.so"), &script)?;
    Ok(vec![format!("-L{}", folder.display()), "-Wl,-z,defs".into()])
}

/// Full path of a library that the C compiler links against.
fn library(name: &str) -> Result<PathBuf, String> {
    let path = output(Command::new("cc").arg(format!("-print-file-name={name}")))?;
    let path = PathBuf::from(path.trim());
    if path.is_absolute() { Ok(path) } else { Err(format!("cc knows no {name}")) }
}

/// Versions of glibc and kinds of all symbols that a library defines.
fn defined(library: &Path) -> Result<BTreeMap<String, Vec<(Version, char)>>, String> {
    let text = output(Command::new("nm").args(["--dynamic", "--defined-only"]).arg(library))?;
    let mut symbols: BTreeMap<String, Vec<(Version, char)>> = BTreeMap::new();
    for line in text.lines() {
        let mut words = line.split_whitespace().rev();
        let (Some(symbol), Some(kind)) = (words.next(), words.next().and_then(|kind| kind.chars().next()))
        else {
            continue;
        };
        let Some((name, version)) = symbol.split_once('@') else { continue };
        let Some(version) = version.trim_start_matches('@').strip_prefix("GLIBC_") else { continue };
        let numbers: Result<Version, _> = version.split('.').map(str::parse).collect();
        // Others than numbers, such as PRIVATE, are for glibc itself.
        if let Ok(version) = numbers {
            symbols.entry(name.to_owned()).or_default().push((version, kind));
        }
    }
    Ok(symbols)
}

fn newest_old(versions: Vec<(Version, char)>) -> Option<(Version, char)> {
    versions.into_iter().filter(|(version, _)| version[..] <= OLDEST[..]).max()
}

fn text(version: &Version) -> String {
    version.iter().map(u32::to_string).collect::<Vec<_>>().join(".")
}

/// Writes a library that defines these symbols and does nothing.
fn stand_in(folder: &Path, file: &str, soname: &str, symbols: &Symbols) -> Result<(), String> {
    let mut code = String::from(".text\n");
    for (number, (name, (version, kind))) in symbols.iter().enumerate() {
        let object = matches!(kind, 'B' | 'D' | 'R' | 'V' | 'A');
        let kind = if object { "object" } else { "function" };
        let version = text(version);
        let _ = writeln!(
            code,
            ".globl here_{number}\n.type here_{number}, %{kind}\n.symver here_{number}, {name}@@GLIBC_{version}\nhere_{number}:"
        );
    }
    code += ".byte 0\n";
    let mut versions: Vec<&Version> = symbols.values().map(|(version, _)| version).collect();
    versions.sort();
    versions.dedup();
    let mut map = String::new();
    for (place, version) in versions.iter().enumerate() {
        let locals = if place == 0 { "local: here_*;" } else { "" };
        let before = if place == 0 { String::new() } else { format!(" GLIBC_{}", text(versions[place - 1])) };
        let _ = writeln!(map, "GLIBC_{} {{ {locals} }}{before};", text(version));
    }
    let (assembly, script) = (folder.join("names.s"), folder.join("versions.map"));
    write(&assembly, &code)?;
    write(&script, &map)?;
    let mut cc = Command::new("cc");
    cc.args(["-shared", "-nostdlib", "-o"]).arg(folder.join(file)).arg(format!("-Wl,-soname,{soname}"));
    cc.arg(format!("-Wl,--version-script={}", script.display())).arg(&assembly);
    output(&mut cc).map(|_| ())
}

/// Compiles what the static part of the C library had until glibc 2.32.
fn static_part(folder: &Path, stat_version: u32) -> Result<PathBuf, String> {
    let code = format!(
        "#define PART __attribute__((visibility(\"hidden\")))\n\
         int __xstat64(int, const char *, void *), __lxstat64(int, const char *, void *);\n\
         int __fxstat64(int, int, void *), __fxstatat64(int, int, const char *, void *, int);\n\
         PART int stat64(const char *path, void *to) {{ return __xstat64({stat_version}, path, to); }}\n\
         PART int lstat64(const char *path, void *to) {{ return __lxstat64({stat_version}, path, to); }}\n\
         PART int fstat64(int file, void *to) {{ return __fxstat64({stat_version}, file, to); }}\n\
         PART int fstatat64(int folder, const char *path, void *to, int flags) {{\n\
         \treturn __fxstatat64({stat_version}, folder, path, to, flags);\n\
         }}\n"
    );
    let (source, object, archive) =
        (folder.join("stat.c"), folder.join("stat.o"), folder.join("libc_nonshared.a"));
    write(&source, &code)?;
    output(Command::new("cc").args(["-O2", "-fPIC", "-c", "-o"]).arg(&object).arg(&source))?;
    output(Command::new("ar").arg("rcs").arg(&archive).arg(&object))?;
    Ok(archive)
}

/// The linker script `libc.so` of this computer with the stand-in for libc, and with the static part besides its own.
fn linker_script(stand_in: &Path, static_part: &Path) -> Result<String, String> {
    let path = library("libc.so")?;
    let own = std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
    let libc = own.split_whitespace().find(|word| word.ends_with("libc.so.6"));
    let libc = libc.ok_or_else(|| format!("{} does not name libc.so.6", path.display()))?;
    Ok(own.replace(libc, &format!("{} {}", stand_in.display(), static_part.display())))
}

fn write(path: &Path, text: &str) -> Result<(), String> {
    std::fs::write(path, text).map_err(|error| format!("{}: {error}", path.display()))
}

/// Standard output of a command that succeeds.
fn output(command: &mut Command) -> Result<String, String> {
    let program = command.get_program().to_string_lossy().into_owned();
    let result = command.output().map_err(|error| format!("{program} did not start: {error}"))?;
    if result.status.success() {
        Ok(String::from_utf8_lossy(&result.stdout).into_owned())
    } else {
        Err(format!("{program} failed: {}", String::from_utf8_lossy(&result.stderr).trim()))
    }
}

#[cfg(all(test, target_os = "linux", target_env = "gnu", target_arch = "x86_64"))]
mod tests {
    use super::*;

    #[test]
    fn a_library_takes_old_versions_of_symbols_and_leaves_out_what_is_newer() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let arguments = link_arguments(&folder.path().join("glibc")).expect("a C compiler");
        let (source, library) = (folder.path().join("old.c"), folder.path().join("old.so"));
        let code = "double pow(double, double);\n\
                    int stat64(const char *, void *), pthread_create(void *, void *, void *, void *);\n\
                    __attribute__((weak)) int gettid(void);\n\
                    double call(double x, void *to) {\n\
                    \tpthread_create(to, 0, 0, 0);\n\
                    \treturn pow(x, x) + stat64(\"\", to) + (gettid ? gettid() : 0);\n\
                    }\n";
        write(&source, code).expect("writable");
        let mut cc = Command::new("cc");
        cc.args(["-shared", "-fPIC", "-o"])
            .arg(&library)
            .arg(&source)
            .args(arguments)
            .args(["-lpthread", "-lm"]);
        output(&mut cc).expect("it links");
        let symbols =
            output(Command::new("nm").args(["--dynamic", "--undefined-only"]).arg(&library)).expect("nm");
        let all: Vec<&str> = symbols.lines().filter_map(|line| line.split_whitespace().last()).collect();
        for expected in ["pow@GLIBC_2.2.5", "pthread_create@GLIBC_2.2.5", "__xstat64@GLIBC_2.2.5", "gettid"] {
            assert!(all.contains(&expected), "{expected} is not among {all:?}");
        }
    }
}
