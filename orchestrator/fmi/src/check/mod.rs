//! A checker for FMUs: what the standard asks for beyond what the import needs, statically and by running.
//!
//! The static checks look at archive and model description; they catch what schema and usual validators let pass
//! (start outside min..max, `derivative` of a non-state, incomplete structure, ...). The dynamic checks run the
//! library: both interfaces, reset, saved states, derivatives against differences, declared dependencies against
//! observed ones. What makes an FMU unusable is not a finding but an error of [`Fmu::open`].

mod attributes;
mod dependencies;
mod derivatives;
mod files;
mod lifecycle;
mod names;
mod perturbation;
mod probe;
mod roles;
mod state;
mod structure;

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
    names::check(&fmu.description, &mut findings);
    attributes::check(&fmu.description, &mut findings);
    roles::check(&fmu.description, &mut findings);
    structure::check(&fmu.description, &mut findings);
    findings.of(fmu)
}

/// Runs the library of the FMU and checks how it behaves. A crash of the library ends this process; `airloop inspect`
/// calls this in a process of its own.
pub fn dynamic_findings(fmu: &Arc<Fmu>) -> Vec<Finding> {
    let mut findings = Findings::default();
    for kind in [InterfaceKind::CoSimulation, InterfaceKind::ModelExchange] {
        if fmu.interface(kind).is_some() && lifecycle::check(fmu, kind, &mut findings) {
            state::check(fmu, kind, &mut findings);
            derivatives::check(fmu, kind, &mut findings);
            dependencies::check(fmu, kind, &mut findings);
        }
    }
    findings.of(fmu)
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
