//! Messages to the importer: categories, the switch of `fmi2SetDebugLogging`, the callback.

use crate::ctypes::{CallbackLogger, ComponentEnvironment, LogMessage, Status};
use crate::fmi3::names;
use std::ffi::CString;

/// Log categories, as declared in `LogCategories`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Category {
    /// State events, samples and time events.
    Events,
    /// Messages with status `fmi2Warning`.
    Warning,
    /// Messages with status `fmi2Discard`.
    Discard,
    /// Messages with status `fmi2Error`.
    Error,
    /// Messages with status `fmi2Fatal`.
    Fatal,
}

/// Name and description of every category that an importer can ask for; `logAll` first.
pub const CATEGORIES: &[(&str, &str)] = &[
    ("logAll", "every message"),
    ("logEvents", "state events, time events and samples"),
    ("logStatusWarning", "messages with status fmi2Warning"),
    ("logStatusDiscard", "messages with status fmi2Discard"),
    ("logStatusError", "messages with status fmi2Error"),
    ("logStatusFatal", "messages with status fmi2Fatal"),
];

impl Category {
    fn name(self) -> &'static str {
        CATEGORIES[self as usize + 1].0
    }

    fn bit(self) -> u8 {
        1 << self as u8
    }

    fn status(self) -> Status {
        match self {
            Category::Events => Status::OK,
            Category::Warning => Status::Warning,
            Category::Discard => Status::Discard,
            Category::Error => Status::Error,
            Category::Fatal => Status::Fatal,
        }
    }
}

const ALL: u8 = 0b1_1111;
const STATUS_MESSAGES: u8 = ALL & !1;

/// Callback of the importer.
#[derive(Clone, Copy)]
pub(crate) enum Callback {
    /// None was given.
    Nobody,
    /// Of FMI 2.0, printf-like.
    Two(CallbackLogger),
    /// Of FMI 3.0, which takes plain text.
    Three(LogMessage),
}

/// Destination of the messages of one instance, and the categories that are logged.
pub(crate) struct Logger {
    callback: Callback,
    environment: ComponentEnvironment,
    instance: CString,
    enabled: u8,
}

impl Logger {
    /// Without debug logging only messages about a status go out.
    pub fn new(
        callback: Callback,
        environment: ComponentEnvironment,
        instance: &str,
        logging_on: bool,
    ) -> Self {
        let enabled = if logging_on { ALL } else { STATUS_MESSAGES };
        Self { callback, environment, instance: to_c(instance), enabled }
    }

    /// `fmi2SetDebugLogging`: without categories all are switched; with `on` exactly those named are on.
    ///
    /// `Err` holds the first unknown category; the others take effect.
    pub fn set(&mut self, on: bool, categories: &[String]) -> Result<(), String> {
        let mut mask = if categories.is_empty() { ALL } else { 0 };
        let mut unknown = Ok(());
        for name in categories {
            match CATEGORIES.iter().position(|(known, _)| known == name) {
                Some(0) => mask = ALL,
                Some(i) => mask |= 1 << (i - 1),
                None => unknown = unknown.and(Err(name.clone())),
            }
        }
        self.enabled = match (on, categories.is_empty()) {
            (true, _) => mask,
            (false, true) => 0,
            (false, false) => self.enabled & !mask,
        };
        unknown
    }

    /// True where a message of the category would be delivered.
    pub fn wants(&self, category: Category) -> bool {
        !matches!(self.callback, Callback::Nobody) && self.enabled & category.bit() != 0
    }

    pub fn log(&self, category: Category, message: &str) {
        if !self.wants(category) {
            return;
        }
        let (status, name) = (category.status(), to_c(category.name()));
        match self.callback {
            Callback::Nobody => {}
            Callback::Two(callback) => {
                // The message is the format string of a printf-like function.
                let message = to_c(&message.replace('%', "%%"));
                crate::abi::call_logger(callback, self.environment, &self.instance, status, &name, &message);
            }
            Callback::Three(callback) => {
                let message = to_c(&names::in_message(message));
                crate::abi::call_log_message(callback, self.environment, status, &name, &message);
            }
        }
    }
}

fn to_c(text: &str) -> CString {
    CString::new(text.replace('\0', " ")).expect("null bytes were replaced")
}
