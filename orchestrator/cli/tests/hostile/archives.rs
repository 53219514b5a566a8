//! Archives and model descriptions.

use std::io::{Cursor, Write};

use airloop_testing::c_fmu::DESCRIPTION;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use super::Case;

fn archive(entries: &[(&str, &[u8])]) -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in entries {
        writer.start_file(*name, SimpleFileOptions::default()).unwrap();
        writer.write_all(bytes).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

/// An archive with two entries of one name, which the writer would refuse.
fn twice(name: &str) -> Vec<u8> {
    let other: String = name.chars().rev().collect();
    let bytes = archive(&[(name, b"1"), (&other, b"2")]);
    let mut found = bytes.clone();
    for (at, window) in bytes.windows(other.len()).enumerate() {
        if window == other.as_bytes() {
            found[at..at + name.len()].copy_from_slice(name.as_bytes());
        }
    }
    found
}

/// The archive with other bytes in the headers of its first entry: at `places` of the local and of the central one.
fn patched(archive: &[u8], places: (usize, usize), other: &[u8]) -> Vec<u8> {
    let mut bytes = archive.to_vec();
    for (mark, place) in [(b"PK\x03\x04", places.0), (b"PK\x01\x02", places.1)] {
        let at = bytes.windows(4).position(|window| window == mark).unwrap() + place;
        bytes[at..at + other.len()].copy_from_slice(other);
    }
    bytes
}

/// The archive with another byte for the X of the name `r/aXb`.
fn named(archive: &[u8], letter: u8) -> Vec<u8> {
    let mut bytes = archive.to_vec();
    while let Some(at) = bytes.windows(5).position(|window| window == b"r/aXb") {
        bytes[at + 3] = letter;
    }
    bytes
}

/// An archive with a symbolic link.
fn linked(name: &str, target: &[u8]) -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    writer.start_file(name, SimpleFileOptions::default().unix_permissions(0o777)).unwrap();
    writer.write_all(target).unwrap();
    let mut bytes = writer.finish().unwrap().into_inner();
    let at = bytes.windows(4).position(|window| window == b"PK\x01\x02").unwrap();
    // Kind of file of Unix, in the external attributes.
    bytes[at + 41] = 0xa1;
    bytes
}

pub fn archives() -> Vec<Case> {
    let inspect = |what: &str, bytes: Vec<u8>| Case::new(what, "inspect x.fmu").file("x.fmu", bytes);
    let xml = DESCRIPTION.as_bytes();
    let good = archive(&[("modelDescription.xml", xml)]);
    let library = |bytes: &[u8]| archive(&[("modelDescription.xml", xml), ("binaries/linux64/m.so", bytes)]);
    let run = |what: &str, bytes: Vec<u8>| {
        Case::new(what, "run x.fmu --stop 1 --step 10ms -o out").file("x.fmu", bytes)
    };
    let cut = good[..good.len() / 2].to_vec();
    let mut flipped = good.clone();
    flipped[60] ^= 0xff;
    let long = "n".repeat(60_000);
    let deep: Vec<String> = (0..8).map(|k| format!("{}{k}", "a/".repeat(30_000))).collect();
    let deep: Vec<(&str, &[u8])> = deep.iter().map(|name| (name.as_str(), &b"x"[..])).collect();
    let nested = "a/".repeat(200) + "x";
    let mut elf = b"\x7fELF\x02\x01\x01\0".to_vec();
    elf.resize(64, 0);
    (elf[16], elf[18], elf[20], elf[32], elf[54], elf[56]) = (3, 62, 1, 64, 56, 9);
    let (mut foreign, mut narrow) = (elf.clone(), elf.clone());
    (foreign[18], narrow[4]) = (183, 1);
    vec![
        Case::new("no file", "inspect x.fmu"),
        inspect("an empty file", Vec::new()),
        inspect("a text", b"this is no archive\n".to_vec()),
        inspect("cut in half", cut),
        inspect("one byte of the description changed", flipped),
        inspect("without modelDescription.xml", archive(&[("readme.txt", b"x")])),
        inspect("modelDescription.xml in a folder", archive(&[("m/modelDescription.xml", xml)])),
        inspect("an entry `../x`", archive(&[("modelDescription.xml", xml), ("../x", b"x")])),
        inspect("an entry `/tmp/x`", archive(&[("modelDescription.xml", xml), ("/tmp/x", b"x")])),
        inspect("an entry `C:\\x`", archive(&[("modelDescription.xml", xml), ("C:\\x", b"x")])),
        inspect("a name of 60,000 letters", archive(&[("modelDescription.xml", xml), (&long, b"x")])),
        inspect("eight names of 30,000 folders", archive(&deep)),
        inspect("a file in 200 folders", archive(&[("modelDescription.xml", xml), (&nested, b"x")])),
        inspect("two different entries of one name", twice("resources/ab")),
        inspect("an entry `a/../../x`", archive(&[("modelDescription.xml", xml), ("a/../../x", b"x")])),
        inspect(
            "names that differ by case",
            archive(&[("modelDescription.xml", xml), ("r/A", b"1"), ("r/a", b"2")]),
        ),
        inspect(
            "a file and a folder of one name",
            archive(&[("modelDescription.xml", xml), ("r", b"1"), ("r/a", b"2")]),
        ),
        inspect("MODELDESCRIPTION.XML", archive(&[("MODELDESCRIPTION.XML", xml)])),
        inspect("an entry that is encrypted", patched(&good, (6, 8), &[1, 0])),
        inspect("another compression than that of its bytes", patched(&good, (8, 10), &[98, 0])),
        inspect("a size that is a lie", patched(&good, (22, 24), &[10, 0, 0, 0])),
        inspect(
            "a zero byte in a name",
            named(&archive(&[("modelDescription.xml", xml), ("r/aXb", b"1")]), b'\0'),
        ),
        inspect(
            "a name that is not UTF-8",
            named(&archive(&[("modelDescription.xml", xml), ("r/aXb", b"1")]), 0xff),
        ),
        inspect("a description that is a link", linked("modelDescription.xml", b"/etc/passwd")),
        Case::new("a named pipe", "inspect x.fmu").make(|folder| super::pipe(&folder.join("x.fmu"))),
        Case::new("an empty folder", "inspect x.fmu")
            .make(|folder| std::fs::create_dir(folder.join("x.fmu")).unwrap()),
        Case::new("a link to /dev/zero", "inspect x.fmu")
            .make(|folder| std::os::unix::fs::symlink("/dev/zero", folder.join("x.fmu")).unwrap()),
        run("a library for another processor", library(&foreign)),
        run("a library of 32 bits", library(&narrow)),
        run("no library", good.clone()),
        run("a library that is a text", library(b"int main() {}\n")),
        run("an empty library", library(b"")),
        run("a library that is cut off", library(&elf)),
        run(
            "a library of another machine only",
            archive(&[("modelDescription.xml", xml), ("binaries/win64/m.dll", b"MZ")]),
        ),
    ]
}

pub fn descriptions() -> Vec<Case> {
    let inspect = |what: &str, text: Vec<u8>| {
        Case::new(what, "inspect x.fmu").file("x.fmu", archive(&[("modelDescription.xml", &text)]))
    };
    let with = |what: &str, from: &str, to: &str| {
        assert!(DESCRIPTION.contains(from), "{from}");
        inspect(what, DESCRIPTION.replacen(from, to, 1).into_bytes())
    };
    let utf16 = DESCRIPTION.encode_utf16().flat_map(u16::to_le_bytes);
    let utf16: Vec<u8> = [0xff, 0xfe].into_iter().chain(utf16).collect();
    let latin = DESCRIPTION.replace("modelName=\"m\"", "modelName=\"\u{fc}\"");
    let latin: Vec<u8> = latin.chars().map(|letter| u8::try_from(u32::from(letter)).unwrap()).collect();
    let bomb = "<!DOCTYPE a [<!ENTITY b \"bbbbbbbb\"><!ENTITY c \"&b;&b;&b;&b;&b;&b;\">]>\n<fmiModelDescription fmiVersion=\"2.0\" modelName=\"&c;\" guid=\"g\"/>";
    let deep = format!("<?xml version=\"1.0\"?>{}{}", "<a>".repeat(50_000), "</a>".repeat(50_000));
    vec![
        inspect("empty", Vec::new()),
        inspect("no XML", b"fmiVersion = 2.0\n".to_vec()),
        inspect("UTF-16", utf16),
        inspect("Latin-1", latin),
        inspect("entities", bomb.into()),
        inspect("50,000 elements inside of each other", deep.into_bytes()),
        inspect("cut in the middle", DESCRIPTION.as_bytes()[..600].to_vec()),
        with("another root element", "fmiModelDescription fmi", "modelDescription fmi"),
        with("FMI 1.0", "fmiVersion=\"2.0\"", "fmiVersion=\"1.0\""),
        with("a beta of FMI 3.0", "fmiVersion=\"2.0\"", "fmiVersion=\"3.0-beta.2\""),
        with("no GUID", " guid=\"g\"", ""),
        with(
            "4,294,967,295 event indicators",
            " guid=\"g\"",
            " guid=\"g\" numberOfEventIndicators=\"4294967295\"",
        ),
        with("a start value that is a word", "<Real start=\"0\"/>", "<Real start=\"zero\"/>"),
        with("a start value beyond all numbers", "<Real start=\"0\"/>", "<Real start=\"1e400\"/>"),
        with("a start value of NaN", "<Real start=\"0\"/>", "<Real start=\"NaN\"/>"),
        with("a derivative of variable 99", "derivative=\"2\"", "derivative=\"99\""),
        with("a value reference below zero", "valueReference=\"3\"", "valueReference=\"-3\""),
        with("a name twice", "name=\"y\"", "name=\"x\""),
        with(
            "one value reference for two inputs",
            "name=\"y\" valueReference=\"3\" causality=\"output\"",
            "name=\"y\" valueReference=\"0\" causality=\"input\"",
        ),
        with("an unknown causality", "causality=\"input\"", "causality=\"imput\""),
        with("an unknown type", "<Real start=\"0\"/>", "<Float start=\"0\"/>"),
        with(
            "an output with index 0",
            "<Unknown index=\"4\" dependencies=\"2\"/></Outputs>",
            "<Unknown index=\"0\"/></Outputs>",
        ),
        with(
            "more kinds than dependencies",
            "index=\"4\" dependencies=\"2\"",
            "index=\"4\" dependencies=\"2\" dependenciesKind=\"fixed fixed\"",
        ),
        with(
            "a declared type that is not there",
            "<Real start=\"0\"/>",
            "<Real start=\"0\" declaredType=\"T\"/>",
        ),
    ]
}
