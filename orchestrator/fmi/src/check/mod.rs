//! A checker for FMUs: what the standard asks for beyond what the import needs, statically and by running.
//!
//! The static checks look at archive and model description; they catch what schema and usual validators let pass
//! (start outside min..max, `derivative` of a non-state, incomplete structure, ...). The dynamic checks run the
//! library: both interfaces, reset, saved states, derivatives against differences, declared dependencies against
//! observed ones. What makes an FMU unusable is not a finding but an error of [`Fmu::open`].

mod arrays;
mod attributes;
mod continuous;
mod dependencies;
mod derivatives;
mod discrete;
mod files;
mod interfaces;
mod leaks;
mod lifecycle;
mod names;
mod perturbation;
mod probe;
mod ranges;
mod roles;
mod schema;
mod settings;
mod state;
mod stepping;
mod structure;
mod terminals;
mod types;
mod variability;

use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::description::Variable;
use super::{Fmu, InterfaceKind, fmi3};

/// Severity of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Allowed, but worth knowing.
    Note,
    /// Allowed or unclear, and likely to make trouble.
    Warning,
    /// Against the standard.
    Error,
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Severity::Note => "note",
            Severity::Warning => "warning",
            Severity::Error => "error",
        })
    }
}

/// One thing that the checker found.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Finding {
    /// Severity.
    pub severity: Severity,
    /// Short name of the rule, stable between versions.
    pub rule: Cow<'static, str>,
    /// Place: a variable with its line, an element, a file, or an interface.
    pub element: String,
    /// Fault, and what is allowed.
    pub message: String,
}

/// Checks archive and model description.
pub fn static_findings(fmu: &Fmu) -> Vec<Finding> {
    let mut findings = Findings::default();
    files::check(fmu, &mut findings);
    let description = std::fs::read(fmu.folder().join("modelDescription.xml")).ok();
    if let Some(root) = description.and_then(|bytes| crate::xml::parse(&bytes).ok()) {
        schema::check(&root, fmu.description.is_fmi3(), &mut findings);
        files::check_sources(fmu, &root, &mut findings);
        if fmu.description.is_fmi3() {
            arrays::check(&root, &mut findings);
        } else {
            roles::check_default_variability(&root, &mut findings);
        }
    }
    types::check(&fmu.description, &mut findings);
    names::check(&fmu.description, &mut findings);
    attributes::check(&fmu.description, &mut findings);
    roles::check(&fmu.description, &mut findings);
    structure::check(&fmu.description, &mut findings);
    terminals::check(fmu, &mut findings);
    findings.of(fmu)
}

/// Runs the library of the FMU and checks how it behaves. A crash of the library ends this process; `airloop inspect`
/// calls [`dynamic_findings_in_parts`] in a process of its own.
pub fn dynamic_findings(fmu: &Arc<Fmu>) -> Vec<Finding> {
    let mut all = Vec::new();
    dynamic_findings_in_parts(fmu, &mut |findings| all.extend(findings));
    all
}

/// A check of one interface.
type Check = fn(&Arc<Fmu>, InterfaceKind, &mut Findings);

/// The checks of a working interface, those that an FMU is least ready for at the end.
const CHECKS: [Check; 10] = [
    settings::check,
    variability::check,
    ranges::check,
    continuous::check,
    state::check,
    derivatives::check,
    dependencies::check,
    discrete::check,
    stepping::check,
    leaks::check,
];

/// Same as [`dynamic_findings`]; `report` gets the findings of each check as soon as it has ended, so that a crash in a
/// later one loses none.
pub fn dynamic_findings_in_parts(fmu: &Arc<Fmu>, report: &mut dyn FnMut(Vec<Finding>)) {
    let mut working = Vec::new();
    for kind in [InterfaceKind::CoSimulation, InterfaceKind::ModelExchange] {
        if fmu.interface(kind).is_none() {
            continue;
        }
        let mut findings = Findings::default();
        if lifecycle::check(fmu, kind, &mut findings) {
            working.push(kind);
        }
        report(findings.of(fmu));
    }
    if working.len() == 2 {
        let mut findings = Findings::default();
        interfaces::check(fmu, &mut findings);
        report(findings.of(fmu));
    }
    for check in CHECKS {
        for &kind in &working {
            let mut findings = Findings::default();
            check(fmu, kind, &mut findings);
            report(findings.of(fmu));
        }
    }
}

/// Findings so far.
#[derive(Debug, Default)]
struct Findings(Vec<Finding>);

impl Findings {
    /// The findings in the words of the FMI version of the FMU.
    fn of(self, fmu: &Fmu) -> Vec<Finding> {
        let mut findings = self.0;
        if fmu.description.is_fmi3() {
            findings.iter_mut().for_each(|finding| finding.message = fmi3::names::in_text(&finding.message));
        }
        findings
    }

    fn add(
        &mut self,
        severity: Severity,
        rule: &'static str,
        element: impl Into<String>,
        message: impl Into<String>,
    ) {
        self.0.push(Finding {
            severity,
            rule: rule.into(),
            element: element.into(),
            message: message.into(),
        });
    }

    fn error(&mut self, rule: &'static str, element: impl Into<String>, message: impl Into<String>) {
        self.add(Severity::Error, rule, element, message);
    }

    fn warning(&mut self, rule: &'static str, element: impl Into<String>, message: impl Into<String>) {
        self.add(Severity::Warning, rule, element, message);
    }

    fn note(&mut self, rule: &'static str, element: impl Into<String>, message: impl Into<String>) {
        self.add(Severity::Note, rule, element, message);
    }
}

/// Name of a variable in findings.
fn element(variable: &Variable) -> String {
    format!("variable {} (line {})", variable.name, variable.line)
}
