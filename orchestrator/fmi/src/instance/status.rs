//! Status codes: from the answer of a C function to an error that names instance, function and variables.

use super::{Instance, Phase};
use crate::description::VariableKind;
use crate::error::{CallError, Error, LostError, Status};
use crate::isolate::{LOST, refused_setter};
use crate::last_words;
use crate::log::{self, LogMessage};
use crate::open::Fmu;

pub(crate) const WARNING: u32 = 1;
pub(crate) const DISCARD: u32 = 2;
/// After it the instance can still be freed, which it cannot after those above.
pub(super) const ERROR: u32 = 3;

/// An error shows this many of the last messages.
pub(super) const SHOWN_MESSAGES: usize = 5;

/// Base type: variables of one base type share one space of value references.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Base {
    Real,
    Integer,
    Boolean,
    String,
}

impl Base {
    pub(super) fn of(kind: &VariableKind) -> Base {
        match kind {
            VariableKind::Real(_) => Base::Real,
            VariableKind::Integer { .. } | VariableKind::Enumeration { .. } => Base::Integer,
            VariableKind::Boolean { .. } => Base::Boolean,
            VariableKind::String { .. } => Base::String,
        }
    }
}

impl Instance {
    #[cold]
    pub(crate) fn missing(&self, function: &'static str) -> Error {
        let function = self.c_name(function);
        Error::MissingFunction { path: self.fmu.shown.clone(), function, interface: self.kind.name() }
    }

    #[inline]
    pub(crate) fn same_length(
        &self,
        function: &'static str,
        given: usize,
        expected: usize,
    ) -> Result<(), Error> {
        if given == expected { Ok(()) } else { Err(self.wrong_length(function, given, expected)) }
    }

    #[cold]
    #[inline(never)]
    fn wrong_length(&self, function: &'static str, given: usize, expected: usize) -> Error {
        let function = self.c_name(function);
        Error::Length { component: self.name.clone(), function, given, expected }
    }

    #[inline]
    pub(crate) fn check(&mut self, function: &'static str, status: u32) -> Result<(), Error> {
        last_words::leave();
        if status <= WARNING { Ok(()) } else { Err(self.failure(function, status, None, Vec::new())) }
    }

    #[inline]
    pub(crate) fn check_reals(
        &mut self,
        function: &'static str,
        status: u32,
        references: &[u32],
        values: Option<&[f64]>,
    ) -> Result<(), Error> {
        last_words::leave();
        if status <= WARNING { Ok(()) } else { self.reals_refused(function, status, references, values) }
    }

    #[cold]
    #[inline(never)]
    fn reals_refused(
        &mut self,
        function: &'static str,
        status: u32,
        references: &[u32],
        values: Option<&[f64]>,
    ) -> Result<(), Error> {
        self.check_values(function, status, Base::Real, references, |index| {
            values.map(|values| values[index].to_string())
        })
    }

    #[inline]
    pub(super) fn check_values(
        &mut self,
        function: &'static str,
        status: u32,
        base: Base,
        references: &[u32],
        value: impl Fn(usize) -> Option<String>,
    ) -> Result<(), Error> {
        last_words::leave();
        if status <= WARNING {
            return Ok(());
        }
        let variables = references
            .iter()
            .enumerate()
            .map(|(i, &reference)| (self.variable_name(base, reference), value(i)));
        let variables = variables.collect();
        Err(self.failure(function, status, None, variables))
    }

    #[cold]
    fn variable_name(&self, base: Base, reference: u32) -> String {
        variable_name(&self.fmu, base, reference).unwrap_or_else(|| format!("value reference {reference}"))
    }

    #[cold]
    pub(crate) fn step_failure(&mut self, status: u32, step: f64) -> Error {
        self.failure("fmi2DoStep", status, Some(step), Vec::new())
    }

    #[cold]
    fn failure(
        &mut self,
        function: &'static str,
        status: u32,
        step: Option<f64>,
        variables: Vec<(String, Option<String>)>,
    ) -> Error {
        last_words::leave();
        let remote = self.library.remote();
        if let Some(death) = remote.filter(|_| status == LOST).and_then(|channel| channel.death()) {
            self.phase = Phase::Abandoned(function);
            return Error::Lost(Box::new(LostError::new(&self.name, &self.fmu, self.time, death)));
        }
        // A setter that was sent together with the call.
        let (function, status, variables) = match remote.and_then(|_| refused_setter()) {
            Some((setter, answer)) => (setter, answer, Vec::new()),
            None => (function, status, variables),
        };
        let status = match status {
            DISCARD => Status::Discard,
            ERROR => Status::Error,
            4 => Status::Fatal,
            5 => Status::Pending,
            other => Status::Unknown(other),
        };
        match status {
            Status::Discard => {}
            // After fmi2Error only fmi2Reset and fmi2FreeInstance may follow.
            Status::Error => self.phase = Phase::Passive,
            Status::Fatal | Status::Pending | Status::Unknown(_) => self.phase = Phase::Abandoned(function),
        }
        Error::Call(Box::new(CallError {
            component: self.name.clone(),
            function: self.c_name(function),
            status,
            time: self.time,
            step,
            variables,
            log: named(&self.fmu, self.log.tail(SHOWN_MESSAGES)),
        }))
    }
}

fn variable_name(fmu: &Fmu, base: Base, reference: u32) -> Option<String> {
    let mut variables = fmu.description.variables.iter();
    variables
        .find(|variable| variable.value_reference == reference && Base::of(&variable.kind) == base)
        .map(|variable| variable.name.clone())
}

/// Messages with names of variables in place of their references.
pub(super) fn named(fmu: &Fmu, mut messages: Vec<LogMessage>) -> Vec<LogMessage> {
    let name = |base, reference| {
        let base = match base {
            'r' => Base::Real,
            'i' => Base::Integer,
            'b' => Base::Boolean,
            's' => Base::String,
            _ => return None,
        };
        variable_name(fmu, base, reference)
    };
    messages.iter_mut().for_each(|message| message.text = log::resolve(&message.text, name));
    messages
}
