//! Values of attributes: bounds, starts, nominals, units, the default experiment.

use std::fmt::Display;

use super::{Findings, element};
use crate::description::{ModelDescription, RealAttributes, Variable, VariableKind};
use airloop_series::units::{self, Compatibility};

pub(super) fn check(description: &ModelDescription, findings: &mut Findings) {
    for variable in &description.variables {
        match &variable.kind {
            VariableKind::Real(real) => {
                bounds(variable, real.start, real.min, real.max, findings);
                check_real(description, variable, real, findings);
            }
            VariableKind::Integer { start, min, max, .. } => bounds(variable, *start, *min, *max, findings),
            VariableKind::Enumeration { declared_type, start, min, max } => {
                bounds(variable, *start, *min, *max, findings);
                let items = description.types.iter().find(|declared| declared.name == *declared_type);
                let known =
                    |value| items.is_none_or(|items| items.items.iter().any(|(_, item)| *item == value));
                if let Some(start) = start.filter(|&start| !known(start)) {
                    let message =
                        format!("start=\"{start}\" is not an item of the enumeration {declared_type}");
                    findings.error("start-range", element(variable), message);
                }
            }
            VariableKind::Boolean { .. } | VariableKind::String { .. } => {}
        }
    }
    check_units(description, findings);
    check_experiment(description, findings);
}

fn bounds<T: PartialOrd + Display + Copy>(
    variable: &Variable,
    start: Option<T>,
    min: Option<T>,
    max: Option<T>,
    findings: &mut Findings,
) {
    if let (Some(min), Some(max)) = (min, max)
        && min > max
    {
        findings.error("min-max", element(variable), format!("min={min} is larger than max={max}"));
        return;
    }
    if let (Some(start), Some(min)) = (start, min)
        && start < min
    {
        findings.error("start-range", element(variable), format!("start={start} is below min={min}"));
    }
    if let (Some(start), Some(max)) = (start, max)
        && start > max
    {
        findings.error("start-range", element(variable), format!("start={start} is above max={max}"));
    }
}

fn check_real(
    description: &ModelDescription,
    variable: &Variable,
    real: &RealAttributes,
    findings: &mut Findings,
) {
    if let Some(nominal) = real.nominal.filter(|nominal| *nominal <= 0.0) {
        findings.error(
            "nominal",
            element(variable),
            format!("nominal={nominal} where a positive number is needed"),
        );
    }
    let Some(name) = &real.unit else {
        if let Some(display) = &real.display_unit {
            let message = format!("displayUnit=\"{display}\" without a unit");
            findings.error("display-unit", element(variable), message);
        }
        return;
    };
    let Some(unit) = description.units.iter().find(|unit| unit.name == *name) else {
        let message = format!("unit=\"{name}\" is not among the UnitDefinitions");
        findings.error("unit-undeclared", element(variable), message);
        return;
    };
    if let Some(display) = &real.display_unit
        && display != name
        && !unit.display_units.iter().any(|known| known.name == *display)
    {
        let message = format!("displayUnit=\"{display}\" is not a DisplayUnit of the unit {name}");
        findings.error("display-unit", element(variable), message);
    }
}

fn check_units(description: &ModelDescription, findings: &mut Findings) {
    for unit in &description.units {
        let place = format!("Unit {}", unit.name);
        let Some(base) = &unit.base else {
            if unit.name != "1" && unit.name != "-" {
                let message = "it has no BaseUnit, so that importers cannot check or convert it";
                findings.warning("unit-base", place, message);
            }
            continue;
        };
        // Radian is a base unit to FMI and a plain number to many tools; only other dimensions are suspicious.
        let Some(usual) = units::lookup(&unit.name) else { continue };
        let without_rad = |mut unit: units::Unit| {
            unit.exponents.rad = 0;
            unit
        };
        let relation = units::compatible(&without_rad(*base), &without_rad(usual));
        if relation != Compatibility::Equal {
            let message = format!(
                "its BaseUnit is {} (factor {}, offset {}), while {} usually is {} (factor {}, offset {})",
                base.exponents,
                base.factor,
                base.offset,
                unit.name,
                usual.exponents,
                usual.factor,
                usual.offset
            );
            findings.warning("unit-base", place, message);
        }
    }
}

fn check_experiment(description: &ModelDescription, findings: &mut Findings) {
    let experiment = &description.default_experiment;
    let place = "DefaultExperiment";
    let start = experiment.start.unwrap_or(0.0);
    if let Some(stop) = experiment.stop.filter(|stop| *stop < start) {
        findings.error("default-experiment", place, format!("stopTime={stop} lies before startTime={start}"));
    }
    for (name, value) in [("tolerance", experiment.tolerance), ("stepSize", experiment.step_size)] {
        if let Some(value) = value.filter(|value| *value <= 0.0) {
            let message = format!("{name}={value} where a positive number is needed");
            findings.error("default-experiment", place, message);
        }
    }
}
