//! `[feed_forward]`: actuators that are to deliver planned forces, and the plant that the forces then drive.

use super::quantity::Quantity;
use super::read::texts_of_pairs;
use super::table::{Text, Value};
use crate::Error;

/// `[feed_forward]`.
#[derive(Debug, Clone, PartialEq)]
pub struct FeedForward {
    /// File of the actuator's system, relative to the problem file.
    pub actuator: Text,
    /// Its command.
    pub command: Text,
    /// Its output.
    pub output: Text,
    /// Sample time of the commands.
    pub sample_time: Quantity,
    /// Largest command, both ways.
    pub largest: Quantity,
    /// Weight of the changes of the command.
    pub smoothness: f64,
    /// Force that each actuator is to deliver.
    pub forces: Vec<(Text, Planned)>,
    /// Plant that the forces drive.
    pub plant: Option<Plant>,
}

/// A variable of the plan times a factor.
#[derive(Debug, Clone, PartialEq)]
pub struct Planned {
    /// State or input of the plan.
    pub variable: Text,
    /// Factor.
    pub factor: f64,
}

/// A system driven by the forces that the actuators deliver.
#[derive(Debug, Clone, PartialEq)]
pub struct Plant {
    /// File of the system, relative to the problem file.
    pub system: Text,
    /// Start values of parameters.
    pub parameters: Vec<(Text, String)>,
    /// Its inputs.
    pub inputs: Vec<(Text, Drive)>,
    /// Its outputs, and the states of the plan that they are to reach.
    pub states: Vec<(Text, Text)>,
}

/// Role of an input of the plant.
#[derive(Debug, Clone, PartialEq)]
pub enum Drive {
    /// The force of an actuator times a factor.
    Force(Text, f64),
    /// As planned.
    Planned(Planned),
}

/// Reads the section.
pub fn read(value: Value) -> Result<FeedForward, Error> {
    let table = value.table("[feed_forward]")?;
    let forces = table.need("forces")?.table("[feed_forward.forces]")?.entries();
    let forces =
        forces.into_iter().map(|(name, value)| Ok((name, planned(value)?))).collect::<Result<_, Error>>()?;
    let smoothness = table.maybe("smoothness", |value| {
        let number = value.number()?;
        if number >= 0.0 { Ok(number) } else { Err(value.error("`smoothness` is not negative")) }
    })?;
    let section = FeedForward {
        actuator: table.need("actuator")?.text()?,
        command: table.need("command")?.text()?,
        output: table.need("output")?.text()?,
        sample_time: table.need("sample_time")?.quantity()?,
        largest: table.need("largest")?.quantity()?,
        smoothness: smoothness.unwrap_or(1e-2),
        forces,
        plant: table.maybe("plant", plant)?,
    };
    table.finish()?;
    Ok(section)
}

fn factor(table: &super::table::Table) -> Result<f64, Error> {
    Ok(table.maybe("factor", |value| value.number())?.unwrap_or(1.0))
}

fn planned(value: Value) -> Result<Planned, Error> {
    let table = value.table("a planned force")?;
    let planned = Planned { variable: table.need("variable")?.text()?, factor: factor(&table)? };
    table.finish()?;
    Ok(planned)
}

fn plant(value: Value) -> Result<Plant, Error> {
    let table = value.table("[feed_forward.plant]")?;
    let inputs = table.need("inputs")?.table("[feed_forward.plant.inputs]")?.entries();
    let drive = |(name, value): (Text, Value)| {
        let one = value.table("an input of the plant")?;
        let drive = match one.maybe("force", |value| value.text())? {
            Some(force) => Drive::Force(force, factor(&one)?),
            None => {
                Drive::Planned(Planned { variable: one.need("variable")?.text()?, factor: factor(&one)? })
            }
        };
        one.finish()?;
        Ok((name, drive))
    };
    let plant = Plant {
        system: table.need("system")?.text()?,
        parameters: table
            .maybe("parameters", |value| super::read::parameters(value, "[feed_forward.plant.parameters]"))?
            .unwrap_or_default(),
        inputs: inputs.into_iter().map(drive).collect::<Result<_, Error>>()?,
        states: texts_of_pairs(table.need("states")?, "[feed_forward.plant.states]")?,
    };
    table.finish()?;
    Ok(plant)
}
