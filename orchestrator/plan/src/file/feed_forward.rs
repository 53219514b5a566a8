//! `[feed_forward]`: actuators that are to deliver planned forces, and the plant that the forces then drive.

use schemars::JsonSchema;
use serde::Deserialize;

use super::quantity::Quantity;
use super::value::{Entries, Parameters, Text, not_negative, one, same_schema};

/// Actuators that are to deliver planned forces, and the plant that these then drive.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FeedForward {
    /// System of one actuator, linear, relative to the folder of this file.
    pub actuator: Text,
    /// Its input.
    pub command: Text,
    /// Its output.
    pub output: Text,
    /// Sample time of the commands.
    pub sample_time: Quantity,
    /// Largest command, both ways.
    pub largest: Quantity,
    /// Weight of the changes of the command.
    #[serde(default = "smoothness", deserialize_with = "not_negative")]
    #[schemars(range(min = 0))]
    pub smoothness: f64,
    /// Force that each actuator is to deliver.
    pub forces: Entries<Planned>,
    /// System that the forces drive.
    pub plant: Option<Plant>,
}

fn smoothness() -> f64 {
    1e-2
}

/// A state or input of the plan times a factor.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Planned {
    /// State or input of the plan.
    pub variable: Text,
    /// Factor.
    #[serde(default = "one")]
    pub factor: f64,
}

/// A system driven by the forces that the actuators deliver.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Plant {
    /// File of the system, relative to the folder of this file.
    pub system: Text,
    /// Start values of parameters: component.variable, or variable for a single FMU.
    #[serde(default)]
    pub parameters: Parameters,
    /// Inputs of the plant, each a delivered force or as planned.
    pub inputs: Entries<Drive>,
    /// Output of the plant = state of the plan that it is to reach.
    pub states: Entries<Text>,
}

/// Signal at an input of the plant.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(try_from = "DriveKeys")]
pub enum Drive {
    /// The force of an actuator times a factor.
    Force(Text, f64),
    /// As planned.
    Planned(Planned),
}

/// `force` or `variable`, times a factor.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{ "required": ["force"] }, { "required": ["variable"] }]))]
struct DriveKeys {
    /// The delivered force of an actuator.
    force: Option<Text>,
    /// State or input of the plan.
    variable: Option<Text>,
    /// Factor.
    #[serde(default = "one")]
    factor: f64,
}

same_schema! {
    [] Drive = DriveKeys;
}

impl TryFrom<DriveKeys> for Drive {
    type Error = &'static str;

    fn try_from(DriveKeys { force, variable, factor }: DriveKeys) -> Result<Drive, &'static str> {
        match (force, variable) {
            (Some(force), None) => Ok(Drive::Force(force, factor)),
            (None, Some(variable)) => Ok(Drive::Planned(Planned { variable, factor })),
            _ => Err("an input of the plant has either `force` or `variable`"),
        }
    }
}
