//! Terminals and icons: variables and pictures that the file names are there, and names differ.

use std::collections::HashSet;

use super::Findings;
use crate::Fmu;

/// Matching rules of the standard (FMI 3.0 section 2.4.10.2.1); those of others contain a dot.
const RULES: [&str; 3] = ["plug", "bus", "sequence"];

pub(super) fn check(fmu: &Fmu, findings: &mut Findings) {
    let place = "terminalsAndIcons/terminalsAndIcons.xml";
    let all = match fmu.terminals() {
        None => return,
        Some(Err(fault)) => return findings.error("terminals", place, fault),
        Some(Ok(all)) => all,
    };
    let description = &fmu.description;
    // An array counts by its name, of which the variables here are elements.
    let elements = description.variables.iter().filter_map(|v| Some(v.name.rsplit_once('[')?.0));
    let plain = description.variables.iter().map(|variable| variable.name.as_str());
    let unread = description.unread.iter().map(|unread| unread.name.as_str());
    let known: HashSet<&str> = plain.chain(elements).chain(unread).collect();
    let mut names = HashSet::new();
    for terminal in &all.terminals {
        let element = format!("{place}, terminal {} (line {})", terminal.name, terminal.line);
        if !names.insert(terminal.name.as_str()) {
            findings.error("terminals", &element, "another terminal has this name");
        }
        let rule = terminal.matching_rule.as_str();
        if !RULES.contains(&rule) && !rule.contains('.') {
            let message = format!("matchingRule=\"{rule}\" is none of {}", RULES.join(", "));
            findings.error("terminals", &element, message);
        }
        let mut members = HashSet::new();
        for member in &terminal.members {
            if !known.contains(member.variable.as_str()) {
                let message = format!("line {}: there is no variable {}", member.line, member.variable);
                findings.error("terminals", &element, message);
            }
            let is_new = member.name.as_ref().is_none_or(|name| members.insert((name, &member.role)));
            if rule != "sequence" && !is_new {
                findings.error(
                    "terminals",
                    &element,
                    format!("line {}: another member has this name", member.line),
                );
            }
        }
    }
    for icon in all.icons.iter().filter(|icon| !fmu.files().contains(icon)) {
        findings.error("terminals", icon.as_str(), format!("{place} shows it, but it is not there"));
    }
}
