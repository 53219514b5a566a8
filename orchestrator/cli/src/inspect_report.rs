//! Findings of `airloop inspect --check` in the forms that CI systems read: SARIF 2.1.0 and JUnit XML.

use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::folder;
use airloop::Error;
use airloop_fmi::check::{Finding, Severity};
use airloop_report::plot::svg::escape;

/// Form of a report, by the ending of its file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    Sarif,
    JUnit,
}

fn form(file: &Path) -> Option<Form> {
    match file.extension()?.to_str()? {
        "sarif" => Some(Form::Sarif),
        "xml" => Some(Form::JUnit),
        _ => None,
    }
}

/// A file name for a report.
pub fn parse(text: &str) -> Result<PathBuf, String> {
    let file = PathBuf::from(text);
    match form(&file) {
        Some(_) => Ok(file),
        None => Err("the file must end in .sarif (SARIF 2.1.0) or .xml (JUnit)".into()),
    }
}

/// Refuses to replace what is not such a report.
///
/// # Errors
/// The file is read by this command, or is there and is not a report of airloop.
pub fn check(file: &Path, input: &Path) -> Result<(), Error> {
    folder::check_file(file, &[input])
}

/// Writes the findings of all FMUs, by their paths.
///
/// # Errors
/// The file cannot be written.
pub fn write(file: &Path, checks: &[(PathBuf, Vec<Finding>)]) -> Result<(), Error> {
    let text = match form(file) {
        Some(Form::JUnit) => junit(checks),
        Some(Form::Sarif) | None => format!("{:#}\n", sarif(checks)),
    };
    let written = airloop_series::file::write_whole(file, |out| out.write_all(text.as_bytes()));
    let refuse = |error: std::io::Error| Error::OutputFile {
        file: file.to_owned(),
        problem: format!("the report cannot be written: {error}"),
    };
    written.map_err(refuse)
}

/// Line of the description that the element of a finding names at its end, as in `variable x (line 12)`.
fn line(finding: &Finding) -> Option<u64> {
    let (_, line) = finding.element.strip_suffix(')')?.rsplit_once("(line ")?;
    line.parse().ok()
}

/// A path as a relative or absolute URI.
fn uri(path: &Path) -> String {
    let mut uri = String::new();
    for byte in path.to_string_lossy().bytes() {
        match byte {
            b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' | b'/' => {
                uri.push(char::from(byte))
            }
            _ => uri.push_str(&format!("%{byte:02X}")),
        }
    }
    uri
}

fn sarif(checks: &[(PathBuf, Vec<Finding>)]) -> Value {
    let rules: BTreeSet<&str> =
        checks.iter().flat_map(|(_, findings)| findings).map(|finding| finding.rule.as_ref()).collect();
    // Each FMU, and its description inside, to which lines belong.
    let artifacts = checks.iter().enumerate().flat_map(|(number, (path, _))| {
        [
            json!({ "location": { "uri": uri(path) } }),
            json!({ "location": { "uri": "/modelDescription.xml" }, "parentIndex": 2 * number }),
        ]
    });
    let results = checks.iter().enumerate().flat_map(|(number, (path, findings))| {
        findings.iter().map(move |finding| {
            let physical = match line(finding) {
                Some(line) => json!({
                    "artifactLocation": { "uri": "/modelDescription.xml", "index": 2 * number + 1 },
                    "region": { "startLine": line },
                }),
                None => json!({ "artifactLocation": { "uri": uri(path), "index": 2 * number } }),
            };
            json!({
                "ruleId": finding.rule,
                "level": finding.severity,
                "message": { "text": format!("{}: {}", finding.element, finding.message) },
                "locations": [{
                    "physicalLocation": physical,
                    "logicalLocations": [{ "fullyQualifiedName": finding.element }],
                }],
            })
        })
    });
    json!({
        "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
        "version": "2.1.0",
        "runs": [{
            "tool": { "driver": {
                "name": "airloop",
                "version": env!("CARGO_PKG_VERSION"),
                "rules": rules.iter().map(|rule| json!({ "id": rule })).collect::<Vec<_>>(),
            } },
            "artifacts": artifacts.collect::<Vec<_>>(),
            "results": results.collect::<Vec<_>>(),
        }],
    })
}

/// One suite for each FMU, one case for each finding: errors fail, the others are said. An FMU without findings has one
/// case.
fn junit(checks: &[(PathBuf, Vec<Finding>)]) -> String {
    let errors = |findings: &[Finding]| findings.iter().filter(|f| f.severity == Severity::Error).count();
    let cases: usize = checks.iter().map(|(_, findings)| findings.len().max(1)).sum();
    let failures: usize = checks.iter().map(|(_, findings)| errors(findings)).sum();
    let mut text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites name=\"airloop inspect\" tests=\"{cases}\" failures=\"{failures}\">\n"
    );
    for (path, findings) in checks {
        let name = xml(&path.to_string_lossy());
        let (tests, failures) = (findings.len().max(1), errors(findings));
        text += &format!("  <testsuite name=\"{name}\" tests=\"{tests}\" failures=\"{failures}\">\n");
        if findings.is_empty() {
            text += &format!("    <testcase classname=\"{name}\" name=\"check\"/>\n");
        }
        for finding in findings {
            let (rule, element, message) = (xml(&finding.rule), xml(&finding.element), xml(&finding.message));
            let inside = match finding.severity {
                Severity::Error => format!("<failure type=\"{rule}\" message=\"{message}\"/>"),
                severity => format!("<system-out>{severity}: {message}</system-out>"),
            };
            text += &format!(
                "    <testcase classname=\"{name}\" name=\"{rule}: {element}\">{inside}</testcase>\n"
            );
        }
        text += "  </testsuite>\n";
    }
    text + "</testsuites>\n"
}

/// Text for XML; characters that XML 1.0 does not know become spaces.
fn xml(text: &str) -> String {
    escape(&text.replace(|c: char| c.is_control(), " "))
}
