//! `[cycle]`: a motion that repeats itself, as a problem file declares it.

use schemars::JsonSchema;
use serde::Deserialize;

use super::value::{Entries, Text};

/// A motion that repeats itself: the first phase begins where the last one ends, after the `reset` of the first phase
/// and with states and inputs in new places, such as those of the legs of a walker after a step.
#[derive(Debug, Clone, PartialEq, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cycle {
    /// State of the next turn = state of this one, or its negative ("-name"); others keep their places.
    #[serde(default)]
    pub states: Entries<Text>,
    /// The same of inputs, for controllers that repeat the motion; the plan may let them jump.
    #[serde(default)]
    pub inputs: Entries<Text>,
    /// States that need not return, such as the way made.
    #[serde(default)]
    pub free: Vec<Text>,
}
