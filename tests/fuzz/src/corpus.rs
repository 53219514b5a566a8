//! Inputs to mutate: files of the repository, and a few of `tests/fuzz/corpus` for kinds that the repository lacks.

use std::path::{Path, PathBuf};

use crate::input::{Form, Input, pack};
use crate::runs;
use crate::targets::Target;

/// Rows of a record that are taken.
const ROWS: usize = 200;

/// Unmutated inputs of a target, in a fixed order.
pub fn seeds(target: Target) -> Vec<Input> {
    let root = root();
    let corpus = root.join("tests/fuzz/corpus");
    let texts = |form: Form, files: Vec<PathBuf>| -> Vec<Input> {
        files.into_iter().filter_map(|file| std::fs::read(file).ok()).map(|b| Input::Plain(form, b)).collect()
    };
    let own = |ending: &str| files(&corpus.join(target.name), ending);
    match target.name {
        "description" => {
            let mut found = files(&root.join("modelDescriptions"), "xml");
            found.extend(own("xml"));
            texts(Form::Xml, found)
        }
        "archive" => descriptions(&root)
            .into_iter()
            .map(|(name, xml)| {
                let library = format!("binaries/linux64/{name}.so");
                Input::Archive(vec![
                    ("modelDescription.xml".into(), xml),
                    ("resources/table.csv".into(), b"time,x\n0,1\n1,2\n".to_vec()),
                    (library, b"\x7fELF\x02\x01\x01\0".to_vec()),
                ])
            })
            .collect(),
        "states" => {
            let saved = runs::saved_states(&root.join("target/fmu").join(runs::FMU));
            saved.map(|bytes| Input::Plain(Form::Words, bytes)).into_iter().collect()
        }
        "ssd" | "simulate" => systems(&root).into_iter().map(|text| Input::Plain(Form::Xml, text)).collect(),
        "ssv" => texts(
            Form::Xml,
            [files(&root.join("examples/01_run"), "ssv"), files(&root.join("examples/04_half_step"), "ssv")]
                .concat(),
        ),
        "ssp" => systems(&root)
            .into_iter()
            .map(|text| {
                let mut entries = vec![("SystemStructure.ssd".to_owned(), text)];
                entries.extend(beside(&root));
                let small =
                    descriptions(&root).into_iter().filter(|(name, _)| SMALL.contains(&name.as_str()));
                entries.extend(small.map(|(name, xml)| {
                    (format!("{name}.fmu"), pack(&[("modelDescription.xml".to_owned(), xml)]))
                }));
                Input::Archive(entries)
            })
            .collect(),
        "problem" => texts(
            Form::Toml,
            in_examples(&root, &["03_swing_up", "03_swing_up/generic", "04_half_step"], "stabilize"),
        ),
        "stabilize" => texts(
            Form::Toml,
            ["03_swing_up", "04_half_step"]
                .map(|name| root.join("examples").join(name).join("stabilize.toml"))
                .to_vec(),
        ),
        "study" => {
            let mut found = texts(Form::Toml, own("toml"));
            found.extend(texts(Form::Toml, vec![root.join("examples/06_study/study.toml")]));
            let pendulum = root.join("target/fmu/pendulum.fmu").display().to_string();
            for input in &mut found {
                if let Input::Plain(_, bytes) = input {
                    *bytes =
                        String::from_utf8_lossy(bytes).replace("airloop:pendulum", &pendulum).into_bytes();
                }
            }
            found
        }
        "case" => texts(
            Form::Toml,
            ["v01", "v05"].map(|name| root.join("data/rig").join(name).join("case.toml")).to_vec(),
        )
        .into_iter()
        .map(|input| one_record(&input))
        .collect(),
        "csv" | "identify" => texts(Form::Csv, files(&corpus.join("csv"), "csv")),
        "units" => texts(Form::Words, own("txt")),
        _ => texts(Form::Toml, own("toml")),
    }
}

/// Files that the readers of a target look for beside their own.
///
/// # Errors
/// The place cannot be written.
pub fn furnish(target: Target, place: &Path) -> std::io::Result<()> {
    let root = root();
    match target.name {
        "ssd" => {
            for (name, bytes) in beside(&root) {
                std::fs::write(place.join(name), bytes)?;
            }
            for (name, xml) in descriptions(&root) {
                let folder = place.join(format!("{name}.fmu"));
                std::fs::create_dir_all(&folder)?;
                std::fs::write(folder.join("modelDescription.xml"), xml)?;
            }
        }
        "simulate" => {
            for (name, bytes) in beside(&root) {
                std::fs::write(place.join(name), bytes)?;
            }
            for fmu in files(&root.join("target/fmu"), "fmu") {
                runs::unpack(&fmu, &place.join(fmu.file_name().unwrap_or_default()));
            }
        }
        "states" => runs::unpack(&root.join("target/fmu").join(runs::FMU), &place.join(runs::FMU)),
        "study" => {
            for name in ["swing.csv", "tail.csv"] {
                let text = std::fs::read_to_string(root.join("examples/06_study").join(name))?;
                std::fs::write(place.join(name), head(&text, 4 * ROWS))?;
            }
        }
        "case" => {
            let text = std::fs::read_to_string(root.join("data/rig/v05/trial_01.csv"))?;
            std::fs::write(place.join("record.csv"), head(&text, ROWS))?;
        }
        "dataset" => {
            for file in files(&root.join("tests/fuzz/corpus/dataset"), "csv") {
                std::fs::copy(&file, place.join(file.file_name().unwrap_or_default()))?;
            }
        }
        _ => {}
    }
    Ok(())
}

/// FMUs that packages hold.
const SMALL: [&str; 3] = ["friction", "arx-actuator", "cart-pole"];

fn root() -> PathBuf {
    let above = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    above.canonicalize().unwrap_or(above)
}

/// Files of a folder by their ending, sorted.
fn files(folder: &Path, ending: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut found: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    found.retain(|path| path.extension().is_some_and(|own| own == ending));
    found.sort();
    found
}

/// TOML files of examples, without those called `other`.
fn in_examples(root: &Path, folders: &[&str], other: &str) -> Vec<PathBuf> {
    let all = folders.iter().flat_map(|folder| files(&root.join("examples").join(folder), "toml"));
    all.filter(|path| path.file_stem().is_some_and(|stem| stem != other)).collect()
}

/// Model descriptions by name.
fn descriptions(root: &Path) -> Vec<(String, Vec<u8>)> {
    let name = |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let found = files(&root.join("modelDescriptions"), "xml").into_iter();
    found.filter_map(|path| Some((name(&path), std::fs::read(&path).ok()?))).collect()
}

/// The systems of the examples, with their FMUs beside them.
fn systems(root: &Path) -> Vec<Vec<u8>> {
    let folders = ["01_run", "04_half_step"];
    let found = folders.iter().flat_map(|folder| files(&root.join("examples").join(folder), "ssd"));
    let text = |path: PathBuf| std::fs::read_to_string(path).ok();
    found.filter_map(text).map(|text| text.replace("../../target/fmu/", "").into_bytes()).collect()
}

/// The parameter sets of these systems.
fn beside(root: &Path) -> Vec<(String, Vec<u8>)> {
    let folders = ["01_run", "04_half_step"];
    let found = folders.iter().flat_map(|folder| files(&root.join("examples").join(folder), "ssv"));
    found
        .filter_map(|path| {
            Some((path.file_name()?.to_string_lossy().into_owned(), std::fs::read(&path).ok()?))
        })
        .collect()
}

/// A case whose files are all the same record.
fn one_record(input: &Input) -> Input {
    let Input::Plain(form, bytes) = input else { return input.clone() };
    let text = String::from_utf8_lossy(bytes);
    let lines = text.lines().map(|line| {
        if line.starts_with("name = \"") && line.contains(".csv") { "name = \"record.csv\"" } else { line }
    });
    Input::Plain(*form, lines.collect::<Vec<_>>().join("\n").into_bytes())
}

fn head(text: &str, rows: usize) -> String {
    text.lines().take(rows).map(|line| format!("{line}\n")).collect()
}
