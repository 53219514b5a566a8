//! Archives that must be refused, with a message that says why, and without a file left behind.

use std::io::{Cursor, Write};
use std::path::Path;
use std::time::{Duration, Instant};

use airloop_fmi::Fmu;
use airloop_testing::fmu_library::{INPUT, archive, description, save};
use tempfile::TempDir;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

fn refusal(path: &Path) -> String {
    Fmu::open(path).map(|_| ()).expect_err("the archive must be refused").to_string()
}

fn refusal_of(bytes: &[u8]) -> String {
    let folder = TempDir::new().unwrap();
    let message = refusal(&save(&folder, "bad.fmu", bytes));
    assert!(message.contains("bad.fmu"), "the message names the file: {message}");
    message
}

/// A sound archive plus one entry.
fn with_entry(name: &str) -> Vec<u8> {
    archive(&[("modelDescription.xml", description(INPUT).as_bytes()), (name, b"x")])
}

/// Replaces each occurrence of `from` by the equally long `to`, as only a hostile writer would.
fn forge(bytes: &[u8], from: &str, to: &str) -> Vec<u8> {
    assert_eq!(from.len(), to.len());
    let mut forged = bytes.to_vec();
    let mut count = 0;
    for at in 0..=bytes.len() - from.len() {
        if bytes[at..].starts_with(from.as_bytes()) {
            forged[at..at + to.len()].copy_from_slice(to.as_bytes());
            count += 1;
        }
    }
    assert_eq!(count, 2, "local header and central directory");
    forged
}

#[test]
fn a_sound_archive_is_opened() {
    let folder = TempDir::new().unwrap();
    let fmu = Fmu::open(&save(&folder, "good.fmu", &with_entry("resources/a/b.txt"))).unwrap();
    assert_eq!(std::fs::read(fmu.resources().join("a/b.txt")).unwrap(), b"x");
    assert!(fmu.resources_uri().starts_with("file:///"));
    let resources = fmu.resources();
    drop(fmu);
    assert!(!resources.exists(), "the temporary folder goes with the FMU");
}

#[test]
fn dangerous_names_are_refused_with_the_reason() {
    let cases = [
        ("/etc/x", "absolute"),
        ("../x", "\"..\""),
        ("a/../../x", "\"..\""),
        ("a\\b", "backslash"),
        ("C:/x", "drive letter"),
        ("a//b", "empty part"),
        ("./b", "part \".\""),
        ("a\nb", "control character"),
    ];
    for (name, reason) in cases {
        let placeholder = "q".repeat(name.len());
        let message = refusal_of(&forge(&with_entry(&placeholder), &placeholder, name));
        assert!(message.contains(reason), "{name:?}: {message}");
    }
}

#[test]
fn entries_that_meet_in_one_file_are_refused() {
    let xml = description(INPUT);
    let pair = |a: &str, b: &str| archive(&[("modelDescription.xml", xml.as_bytes()), (a, b"x"), (b, b"y")]);
    let cases = [
        (forge(&pair("aaa", "bbb"), "bbb", "aaa"), "\"aaa\""),
        (pair("a/X", "a/x"), "\"a/X\" and \"a/x\""),
        (pair("A/x", "a/y"), "same file"),
        (pair("a", "a/b"), "\"a\" and \"a/b\""),
    ];
    for (bytes, part) in cases {
        let message = refusal_of(&bytes);
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn a_folder_that_appears_twice_is_one_folder() {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    writer.start_file("modelDescription.xml", SimpleFileOptions::default()).unwrap();
    writer.write_all(description(INPUT).as_bytes()).unwrap();
    for name in ["aaaaaaa/", "sources/", "sources/x.c"] {
        writer.start_file(name, SimpleFileOptions::default()).unwrap();
    }
    let bytes = forge(&writer.finish().unwrap().into_inner(), "aaaaaaa/", "sources/");
    let folder = TempDir::new().unwrap();
    let fmu = Fmu::open(&save(&folder, "m.fmu", &bytes)).unwrap();
    assert_eq!(fmu.files(), ["modelDescription.xml", "sources/x.c"]);
}

#[test]
fn a_file_that_appears_twice_with_the_same_content_is_one_file() {
    let xml = description(INPUT);
    let files =
        [("modelDescription.xml", xml.as_bytes()), ("extra/a.xml", b"<a/>"), ("extra/b.xml", b"<a/>")];
    let bytes = forge(&archive(&files), "extra/b.xml", "extra/a.xml");
    let folder = TempDir::new().unwrap();
    let fmu = Fmu::open(&save(&folder, "m.fmu", &bytes)).unwrap();
    assert_eq!(fmu.files(), ["modelDescription.xml", "extra/a.xml"]);
}

#[test]
fn a_symbolic_link_is_refused() {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    writer.start_file("modelDescription.xml", SimpleFileOptions::default()).unwrap();
    writer.write_all(description(INPUT).as_bytes()).unwrap();
    writer.add_symlink("resources/link", "/etc/passwd", SimpleFileOptions::default()).unwrap();
    let message = refusal_of(&writer.finish().unwrap().into_inner());
    assert!(message.contains("resources/link") && message.contains("symbolic link"), "{message}");
}

#[test]
fn one_megabyte_that_unpacks_to_a_gigabyte_is_refused_within_a_second() {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    writer.start_file("modelDescription.xml", SimpleFileOptions::default()).unwrap();
    writer.write_all(description(INPUT).as_bytes()).unwrap();
    writer.start_file("resources/zeros", SimpleFileOptions::default()).unwrap();
    let block = vec![0_u8; 1 << 20];
    (0..1024).for_each(|_| writer.write_all(&block).unwrap());
    let bytes = writer.finish().unwrap().into_inner();
    assert!(bytes.len() < 2 << 20, "{} bytes", bytes.len());
    let folder = TempDir::new().unwrap();
    let path = save(&folder, "bomb.fmu", &bytes);
    let start = Instant::now();
    let message = refusal(&path);
    assert!(start.elapsed() < Duration::from_secs(1), "{:?}", start.elapsed());
    assert!(message.contains("above the limit"), "{message}");
}

#[test]
fn an_entry_larger_than_its_header_says_is_refused() {
    let zeros = vec![0_u8; 1 << 20];
    let bytes = archive(&[("modelDescription.xml", description(INPUT).as_bytes()), ("resources/z", &zeros)]);
    // The unpacked size stands in the local header and in the central directory, as 4 bytes.
    let mut forged = bytes.clone();
    let (real, lie) = ((1_u32 << 20).to_le_bytes(), 100_u32.to_le_bytes());
    for at in 0..bytes.len() - 4 {
        if bytes[at..at + 4] == real {
            forged[at..at + 4].copy_from_slice(&lie);
        }
    }
    assert_ne!(forged, bytes);
    let message = refusal_of(&forged);
    assert!(message.contains("resources/z") && message.contains("declares 100 bytes"), "{message}");
}

#[test]
fn too_many_entries_are_refused() {
    let names: Vec<_> = (0..10_001).map(|i| format!("resources/{i}")).collect();
    let files: Vec<_> = names.iter().map(|name| (name.as_str(), &b""[..])).collect();
    let message = refusal_of(&archive(&files));
    assert!(message.contains("number of entries") && message.contains("10000"), "{message}");
}

#[test]
fn files_that_are_no_archives_are_told_apart() {
    let folder = TempDir::new().unwrap();
    let message = refusal(folder.path());
    assert!(message.contains("not a file"), "{message}");
    let message = refusal(&folder.path().join("missing.fmu"));
    assert!(message.contains("cannot be read") && message.contains("missing.fmu"), "{message}");
    let message = refusal_of(b"");
    assert!(message.contains("empty"), "{message}");
    let message = refusal_of(b"this is text");
    assert!(message.contains("zip"), "{message}");
}

#[test]
fn an_archive_cut_anywhere_is_refused_without_panic() {
    let bytes = with_entry("resources/x");
    for length in 1..bytes.len() {
        let message = refusal_of(&bytes[..length]);
        assert!(!message.is_empty());
    }
}

#[test]
fn a_flipped_byte_never_panics() {
    let bytes = with_entry("resources/x");
    let folder = TempDir::new().unwrap();
    for at in 0..bytes.len() {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x55;
        // Some bytes carry nothing (a date); what counts is that each file is either opened or refused.
        let _ = Fmu::open(&save(&folder, "damaged.fmu", &damaged));
    }
}

#[test]
fn a_missing_model_description_is_named_with_the_nested_one() {
    let message = refusal_of(&archive(&[("resources/x", b"x")]));
    assert!(message.contains("no modelDescription.xml"), "{message}");
    let xml = description(INPUT);
    let message = refusal_of(&archive(&[("m/modelDescription.xml", xml.as_bytes())]));
    assert!(message.contains("m/modelDescription.xml") && message.contains("pack the content"), "{message}");
}

#[test]
fn no_folder_is_left_behind_after_a_refusal() {
    const NAME: &str = "no_folder_is_left_behind_after_a_refusal";
    const CHILD: &str = "AIRLOOP_TEST_DAMAGED_FMU";
    // The folder for temporary files can only be chosen for a process, so the test runs itself once more.
    if let Some(path) = std::env::var_os(CHILD) {
        let message = refusal(Path::new(&path));
        assert!(message.contains("resources/x") && message.contains("damaged"), "{message}");
        return;
    }
    let bytes =
        archive(&[("modelDescription.xml", description(INPUT).as_bytes()), ("resources/x", b"12345678")]);
    let mut damaged = bytes.clone();
    // The byte before the central directory is the last one of the last entry.
    let at = bytes.windows(4).position(|window| window == b"PK\x01\x02").unwrap() - 1;
    damaged[at] ^= 0xFF;
    let (folder, temporary) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    let output = std::process::Command::new(std::env::current_exe().unwrap())
        .args(["--exact", NAME])
        .env(CHILD, save(&folder, "damaged.fmu", &damaged))
        .env("TMPDIR", temporary.path())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
    assert_eq!(std::fs::read_dir(temporary.path()).unwrap().count(), 0);
}
