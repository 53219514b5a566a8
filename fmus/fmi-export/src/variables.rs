//! Get and set by value reference: who may set what when, ranges, finite values.

use crate::ctypes::Status;
use crate::instance::Instance;
use crate::model::Model;
use crate::state_machine::Mode;
use crate::table::{Causality, Initial, Kind, Table, Variability, Variable};
use crate::values::{Boolean, Integer, Real, Text};
use std::ffi::CString;

/// Access rule of one variable, as a set of modes, with its range.
#[derive(Clone, Copy, Debug)]
struct Rule {
    settable: u16,
    is_parameter: bool,
    min: f64,
    max: f64,
}

/// Rules of every variable by type and value reference.
#[derive(Clone, Debug, Default)]
pub(crate) struct Access {
    real: Vec<Rule>,
    integer: Vec<Rule>,
    boolean: Vec<Rule>,
    text: Vec<Rule>,
}

const fn bit(mode: Mode) -> u16 {
    1 << mode as u8
}

impl Access {
    pub fn of(table: &Table) -> Self {
        let mut access = Self::default();
        for v in table.variables() {
            let mut rule = Rule {
                settable: modes_to_set(v),
                is_parameter: v.causality == Causality::Parameter,
                min: f64::NEG_INFINITY,
                max: f64::INFINITY,
            };
            match v.kind {
                Kind::Real { min, max, .. } => {
                    rule.min = min.unwrap_or(rule.min);
                    rule.max = max.unwrap_or(rule.max);
                    access.real.push(rule);
                }
                Kind::Integer { min, max, .. } => {
                    rule.min = min.map_or(rule.min, f64::from);
                    rule.max = max.map_or(rule.max, f64::from);
                    access.integer.push(rule);
                }
                Kind::Enumeration { enumeration, .. } => {
                    rule.min = 1.0;
                    rule.max = table.enumerations()[enumeration].items.len() as f64;
                    access.integer.push(rule);
                }
                Kind::Boolean { .. } => access.boolean.push(rule),
                Kind::Text { .. } => access.text.push(rule),
            }
        }
        access
    }
}

/// FMI 2.0.4, footnotes of the tables in 3.2.3 and 4.2.4; states may also be set one by one in Model Exchange.
fn modes_to_set(v: &Variable) -> u16 {
    let before_start = bit(Mode::Instantiated) | bit(Mode::InitializationMode);
    match (v.causality, v.variability) {
        (Causality::Input, Variability::Continuous) => {
            before_start | bit(Mode::EventMode) | bit(Mode::ContinuousTimeMode) | bit(Mode::StepComplete)
        }
        (Causality::Input, _) | (Causality::Parameter, Variability::Tunable) => {
            before_start | bit(Mode::EventMode) | bit(Mode::StepComplete)
        }
        (Causality::Parameter, _) => before_start,
        _ if v.is_state && v.is_computed() => bit(Mode::EventMode) | bit(Mode::ContinuousTimeMode),
        _ if v.is_state => before_start | bit(Mode::EventMode) | bit(Mode::ContinuousTimeMode),
        _ if v.initial == Some(Initial::Exact) => before_start,
        _ => 0,
    }
}

/// Reason why a variable can't be set now.
enum Refused {
    Error(String),
    Discard(String),
}

impl<M: Model> Instance<M> {
    pub(crate) fn get_real(&mut self, references: &[u32], values: &mut [f64]) -> Status {
        const F: &str = "fmi2GetReal";
        if let Err(refusal) = self.update() {
            return self.refuse(F, &refusal);
        }
        for (reference, value) in references.iter().zip(values) {
            if *reference as usize >= self.access.real.len() {
                return self.unknown_reference(F, "Real", *reference);
            }
            *value = self.state.values[Real(*reference)];
        }
        Status::OK
    }

    pub(crate) fn get_integer(&mut self, references: &[u32], values: &mut [i32]) -> Status {
        const F: &str = "fmi2GetInteger";
        if let Err(refusal) = self.update() {
            return self.refuse(F, &refusal);
        }
        for (reference, value) in references.iter().zip(values) {
            if *reference as usize >= self.access.integer.len() {
                return self.unknown_reference(F, "Integer", *reference);
            }
            *value = self.state.values[Integer(*reference)];
        }
        Status::OK
    }

    pub(crate) fn get_boolean(&mut self, references: &[u32], values: &mut [i32]) -> Status {
        const F: &str = "fmi2GetBoolean";
        if let Err(refusal) = self.update() {
            return self.refuse(F, &refusal);
        }
        for (reference, value) in references.iter().zip(values) {
            if *reference as usize >= self.access.boolean.len() {
                return self.unknown_reference(F, "Boolean", *reference);
            }
            *value = i32::from(self.state.values[Boolean(*reference)]);
        }
        Status::OK
    }

    /// Copies the strings into buffers that stay until the next call; `give` receives their addresses.
    pub(crate) fn get_string(&mut self, references: &[u32], mut give: impl FnMut(usize, &CString)) -> Status {
        const F: &str = "fmi2GetString";
        if let Err(refusal) = self.update() {
            return self.refuse(F, &refusal);
        }
        self.returned_strings.clear();
        for reference in references {
            if *reference as usize >= self.access.text.len() {
                return self.unknown_reference(F, "String", *reference);
            }
            let text = self.state.values[Text(*reference)].replace('\0', " ");
            self.returned_strings.push(CString::new(text).expect("null bytes were replaced"));
        }
        for (i, text) in self.returned_strings.iter().enumerate() {
            give(i, text);
        }
        Status::OK
    }

    pub(crate) fn set_real(&mut self, references: &[u32], values: &[f64]) -> Status {
        const F: &str = "fmi2SetReal";
        for (reference, value) in references.iter().zip(values) {
            let Some(rule) = self.access.real.get(*reference as usize) else {
                return self.unknown_reference(F, "Real", *reference);
            };
            if let Err(refused) = self.check(rule, *value, || self.definition.table.real_variable(*reference))
            {
                return self.say(F, &refused);
            }
        }
        for (reference, value) in references.iter().zip(values) {
            self.state.values[Real(*reference)] = *value;
            self.state.parameters_dirty |= self.access.real[*reference as usize].is_parameter;
        }
        self.state.dirty |= !references.is_empty();
        Status::OK
    }

    pub(crate) fn set_integer(&mut self, references: &[u32], values: &[i32]) -> Status {
        const F: &str = "fmi2SetInteger";
        for (reference, value) in references.iter().zip(values) {
            let Some(rule) = self.access.integer.get(*reference as usize) else {
                return self.unknown_reference(F, "Integer", *reference);
            };
            let variable = || self.definition.table.integer_variable(*reference);
            if let Err(refused) = self.check(rule, f64::from(*value), variable) {
                return self.say(F, &refused);
            }
        }
        for (reference, value) in references.iter().zip(values) {
            self.state.values[Integer(*reference)] = *value;
            self.state.parameters_dirty |= self.access.integer[*reference as usize].is_parameter;
        }
        self.state.dirty |= !references.is_empty();
        Status::OK
    }

    pub(crate) fn set_boolean(&mut self, references: &[u32], values: &[i32]) -> Status {
        const F: &str = "fmi2SetBoolean";
        for (reference, value) in references.iter().zip(values) {
            let Some(rule) = self.access.boolean.get(*reference as usize) else {
                return self.unknown_reference(F, "Boolean", *reference);
            };
            let variable = || self.definition.table.boolean_variable(*reference);
            if let Err(refused) = self.check(rule, f64::from(*value), variable) {
                return self.say(F, &refused);
            }
        }
        for (reference, value) in references.iter().zip(values) {
            self.state.values[Boolean(*reference)] = *value != 0;
            self.state.parameters_dirty |= self.access.boolean[*reference as usize].is_parameter;
        }
        self.state.dirty |= !references.is_empty();
        Status::OK
    }

    /// `values` holds `None` for a null pointer or text that is not UTF-8.
    pub(crate) fn set_string(&mut self, references: &[u32], values: &[Option<&str>]) -> Status {
        const F: &str = "fmi2SetString";
        for (reference, value) in references.iter().zip(values) {
            let Some(rule) = self.access.text.get(*reference as usize) else {
                return self.unknown_reference(F, "String", *reference);
            };
            let variable = || self.definition.table.text_variable(*reference);
            if let Err(refused) = self.check(rule, 0.0, variable) {
                return self.say(F, &refused);
            }
            if value.is_none() {
                let name = variable().map_or("?", |v| v.name.as_str());
                return self.discard(F, &format!("`{name}`: the string is a null pointer or not UTF-8"));
            }
        }
        for (reference, value) in references.iter().zip(values) {
            let text = value.expect("null pointers were refused above");
            let target = &mut self.state.values[Text(*reference)];
            target.clear();
            target.push_str(text);
            self.state.parameters_dirty |= self.access.text[*reference as usize].is_parameter;
        }
        self.state.dirty |= !references.is_empty();
        Status::OK
    }

    fn check<'v>(
        &self,
        rule: &Rule,
        value: f64,
        variable: impl Fn() -> Option<&'v Variable>,
    ) -> Result<(), Refused> {
        let name = || variable().map_or("?", |v| v.name.as_str());
        if rule.settable & bit(self.state.mode) == 0 {
            return Err(Refused::Error(format!(
                "`{}` ({}) can't be set in state \"{}\"",
                name(),
                variable().map_or_else(String::new, |v| kind_of(v).to_string()),
                self.state.mode.name()
            )));
        }
        if !value.is_finite() {
            return Err(Refused::Discard(format!(
                "`{}`: the value {value} is not finite; the old value is kept",
                name()
            )));
        }
        if value < rule.min || value > rule.max {
            return Err(Refused::Discard(format!(
                "`{}`: the value {value} is outside {}..{}; the old value is kept",
                name(),
                rule.min,
                rule.max
            )));
        }
        Ok(())
    }

    fn say(&self, function: &str, refused: &Refused) -> Status {
        match refused {
            Refused::Error(text) => self.error(function, text),
            Refused::Discard(text) => self.discard(function, text),
        }
    }

    pub(crate) fn unknown_reference(&self, function: &str, kind: &str, reference: u32) -> Status {
        self.error(function, &format!("no {kind} variable has the value reference {reference}"))
    }
}

fn kind_of(v: &Variable) -> &'static str {
    match (v.causality, v.variability) {
        (Causality::Parameter, Variability::Tunable) => "tunable parameter",
        (Causality::Parameter, _) => "fixed parameter",
        (Causality::CalculatedParameter, _) => "calculated parameter",
        (Causality::Input, Variability::Continuous) => "continuous input",
        (Causality::Input, _) => "discrete input",
        (Causality::Output, _) => "output",
        (Causality::Local, _) => "local",
    }
}
