//! The checker against FMUs with one defect each, and against legal ones: which it finds, and that it calls no legal
//! one wrong.
#![cfg(target_os = "linux")]

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use airloop_fmi::Fmu;
use airloop_fmi::check::{Finding, Severity, dynamic_findings_in_parts, static_findings};
use mutants::{Mutant, behavior, description, legal};
use tempfile::TempDir;

mod mutants;

/// Mutants that the checker may miss.
const MAX_MISSED: usize = 2;

/// Time for the library of one mutant.
const MAX_TIME: Duration = Duration::from_secs(6);

/// Name of the variable that tells a child what to run.
const SUBJECT: &str = "AIRLOOP_CHECKED_FMU";

/// Answer of the checker.
struct Verdict {
    refused: Option<String>,
    findings: Vec<Finding>,
}

impl Verdict {
    fn rules(&self) -> Vec<String> {
        let errors = self.findings.iter().filter(|finding| finding.severity == Severity::Error);
        let mut rules: Vec<String> = errors.map(|finding| finding.rule.to_string()).collect();
        rules.extend(self.refused.as_ref().map(|_| "refused".to_owned()));
        rules.dedup();
        rules
    }
}

/// Static findings here, those of the library in a process of its own.
fn judge(path: &Path) -> Verdict {
    let fmu = match Fmu::open(path) {
        Ok(fmu) => fmu,
        Err(error) => return Verdict { refused: Some(error.to_string()), findings: Vec::new() },
    };
    let mut findings = static_findings(&fmu);
    let output = path.with_extension("jsonl");
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "run_a_library", "--ignored", "--nocapture", "--quiet"])
        .env(SUBJECT, path)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let began = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break Some(status);
        }
        if began.elapsed() > MAX_TIME {
            child.kill().unwrap();
            child.wait().unwrap();
            break None;
        }
        std::thread::sleep(Duration::from_millis(2));
    };
    let text = std::fs::read_to_string(&output).unwrap_or_default();
    findings.extend(
        text.lines()
            .filter(|line| *line != "done")
            .map(|line| serde_json::from_str::<Finding>(line).unwrap()),
    );
    if !text.ends_with("done\n") {
        let (element, message) = ("process".to_owned(), format!("{status:?}"));
        findings.push(Finding { severity: Severity::Error, rule: "process-lost".into(), element, message });
    }
    Verdict { refused: None, findings }
}

/// The process that `judge` starts.
#[test]
#[ignore = "started by the other tests"]
fn run_a_library() {
    use std::io::Write;
    let Some(path) = std::env::var_os(SUBJECT) else { return };
    let path = Path::new(&path);
    let mut output = std::fs::File::create(path.with_extension("jsonl")).unwrap();
    dynamic_findings_in_parts(&Fmu::open(path).unwrap(), &mut |findings| {
        for finding in findings {
            writeln!(output, "{}", serde_json::to_string(&finding).unwrap()).unwrap();
        }
    });
    writeln!(output, "done").unwrap();
}

fn defective() -> impl Iterator<Item = &'static Mutant> {
    description::MUTANTS.iter().chain(behavior::MUTANTS)
}

#[test]
fn defective_fmus_are_found_by_their_rules() {
    let folder = TempDir::new().unwrap();
    let mut missed = Vec::new();
    for (number, mutant) in defective().enumerate() {
        let verdict = judge(&mutant.write(folder.path(), &format!("{number}.fmu")));
        if !verdict.rules().iter().any(|rule| rule == mutant.rule) {
            missed.push(format!("{}: {} is not among {:?}", mutant.name, mutant.rule, verdict.rules()));
        }
    }
    let count = defective().count();
    assert!(count >= 150, "{count} mutants");
    assert!(missed.len() <= MAX_MISSED, "{} of {count} missed:\n{}", missed.len(), missed.join("\n"));
}

#[test]
fn legal_fmus_are_not_called_wrong() {
    let folder = TempDir::new().unwrap();
    let mut wrong = Vec::new();
    for (number, variant) in legal::VARIANTS.iter().enumerate() {
        let verdict = judge(&variant.write(folder.path(), &format!("{number}.fmu")));
        let troubles: Vec<_> =
            verdict.findings.iter().filter(|finding| finding.severity > Severity::Note).collect();
        if verdict.refused.is_some() || !troubles.is_empty() {
            wrong.push(format!("{}: {:?} {troubles:#?}", variant.name, verdict.refused));
        }
    }
    assert!(legal::VARIANTS.len() >= 20);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Writes all FMUs, and what the checker makes of them as `mutants.jsonl`, for `make study-checker`.
#[test]
#[ignore = "writes the ground of docs/checker.md"]
fn write_mutants() {
    use std::io::Write;
    let folder = std::env::var_os("AIRLOOP_MUTANTS").expect("AIRLOOP_MUTANTS names a folder");
    let folder = Path::new(&folder);
    std::fs::create_dir_all(folder).unwrap();
    let mut list = std::fs::File::create(folder.join("mutants.jsonl")).unwrap();
    for (number, mutant) in defective().chain(legal::VARIANTS).enumerate() {
        let file = format!("{number:03}.fmu");
        let verdict = judge(&mutant.write(folder, &file));
        let row = serde_json::json!({
            "file": file,
            "name": mutant.name,
            "is_legal": mutant.rule.is_empty(),
            "rule": mutant.rule,
            "found": verdict.rules(),
        });
        writeln!(list, "{row}").unwrap();
    }
}
