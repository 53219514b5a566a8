//! The state of an instance as data: what `fmi2GetFMUstate` keeps and `fmi2SerializeFMUstate` writes.

use airloop_cosim::system::graph::{Start, StartValue};
use fmi_export::state_machine::Mode;
use serde::{Deserialize, Serialize};

/// See the module. Reals are kept as bits, so that every one comes back.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Saved {
    pub mode: u8,
    pub times: [u64; 3],
    pub stop: Option<u64>,
    pub tolerance: Option<u64>,
    pub count: u64,
    pub terminated: bool,
    pub inputs: Vec<Option<u64>>,
    /// Additions to rates.
    #[serde(default)]
    pub added: Vec<u64>,
    pub starts: Vec<Vec<(usize, Number)>>,
    /// State of the runner, if there was one.
    pub runner: Option<Vec<u8>>,
}

/// A start value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) enum Number {
    Real(u64),
    Integer(i64),
    Boolean(bool),
    String(String),
}

impl Number {
    pub fn of(start: &StartValue) -> (usize, Number) {
        let value = match &start.value {
            Start::Real(value) => Number::Real(value.to_bits()),
            Start::Integer(value) => Number::Integer(*value),
            Start::Boolean(value) => Number::Boolean(*value),
            Start::String(value) => Number::String(value.clone()),
        };
        (start.variable, value)
    }

    pub fn start(&self, variable: usize) -> StartValue {
        let value = match self {
            Number::Real(bits) => Start::Real(f64::from_bits(*bits)),
            Number::Integer(value) => Start::Integer(*value),
            Number::Boolean(value) => Start::Boolean(*value),
            Number::String(value) => Start::String(value.clone()),
        };
        StartValue { variable, value }
    }
}

/// A mode by its number.
pub(crate) fn mode(number: u8) -> Option<Mode> {
    Mode::ALL.into_iter().find(|mode| *mode as u8 == number)
}
