//! A folder with an FMU that misbehaves, and runs of it in a process of its own after which nothing may be left.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::{Duration, Instant};

use airloop_testing::hostile::Version;
use tempfile::TempDir;

/// A folder with `m.fmu` and a folder for temporary files.
pub struct Place(TempDir);

impl Place {
    pub fn new(version: Version) -> Place {
        let folder = TempDir::new().unwrap();
        version.write(&folder.path().join("m.fmu"));
        std::fs::create_dir(folder.path().join("tmp")).unwrap();
        Place(folder)
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Runs for a second; later words may change that.
    pub fn run(&self, hostile: &str, words: &[&str]) -> Output {
        let all = ["run", "m.fmu", "--stop", "1", "--step", "10ms", "--no-plots", "-o", "out"];
        self.airloop(hostile, &[&all, words].concat())
    }

    /// Any command.
    pub fn airloop(&self, hostile: &str, words: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_airloop"))
            .args(words)
            .env("HOSTILE", hostile)
            .env("TMPDIR", self.path("tmp"))
            .current_dir(self.0.path())
            .output()
            .unwrap()
    }

    /// Runs in a worker and sees that nothing stays; exit code and what was said.
    pub fn isolated(&self, hostile: &str, words: &[&str]) -> (Option<i32>, String) {
        let _ = std::fs::remove_dir_all(self.path("out"));
        let began = Instant::now();
        let output = self.run(hostile, &[&["--isolate", "--call-limit", "300ms"], words].concat());
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(began.elapsed() < Duration::from_secs(10), "{hostile}: {said}");
        assert_eq!(names(&self.path("tmp")), [] as [String; 0], "{hostile}");
        assert!(!self.path("left_behind.txt").exists(), "{hostile}");
        let out = names(&self.path("out"));
        assert!(
            out.iter().all(|name| !name.starts_with('.') && !name.contains("partial")),
            "{hostile}: {out:?}"
        );
        (output.status.code(), said)
    }
}

/// Names in a folder; none where there is none.
pub fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect()
}
