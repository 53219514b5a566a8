//! `[stick_figure]`: rods from a point that moves, such as legs and trunk from a hip.

use serde::{Deserialize, Serialize};

use super::table::{Text, Value};
use crate::Error;

/// `[stick_figure]`.
#[derive(Debug, Clone, PartialEq)]
pub struct StickFigure {
    /// Position of the point from which all rods go.
    pub x: Text,
    /// See `x`.
    pub y: Text,
    /// The rods.
    pub rods: Vec<Rod>,
}

/// A rod: to `(x + length sin(angle), y - length cos(angle))`.
#[derive(Debug, Clone, PartialEq)]
pub struct Rod {
    /// Name in the figure; none: its angles.
    pub name: Option<String>,
    /// Angles whose mean is that of the rod, 0 hanging, counter-clockwise.
    pub angles: Vec<Text>,
    /// Its length; below 0 it stands up.
    pub length: Length,
}

/// A variable by its name, or a number \[m\].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Length {
    /// Constant \[m\].
    Number(f64),
    /// A variable.
    Variable(String),
}

/// Reads the section.
pub fn read(value: Value) -> Result<StickFigure, Error> {
    let table = value.table("[stick_figure]")?;
    let rods = table.need("rod")?.list()?.into_iter().map(rod).collect::<Result<Vec<_>, _>>()?;
    let figure = StickFigure { x: table.need("x")?.text()?, y: table.need("y")?.text()?, rods };
    table.finish()?;
    Ok(figure)
}

fn rod(value: Value) -> Result<Rod, Error> {
    let table = value.table("[[stick_figure.rod]]")?;
    let angle = table.need("angle")?;
    let angles = match angle.text() {
        Ok(one) => vec![one],
        Err(_) => angle.list()?.iter().map(Value::text).collect::<Result<_, _>>()?,
    };
    if angles.is_empty() {
        return Err(angle.error("a rod has an angle, or several whose mean it has"));
    }
    let length = table.need("length")?;
    let length = match length.text() {
        Ok(name) => Length::Variable(name.text),
        Err(_) => Length::Number(length.number()?),
    };
    let name = table.maybe("name", |value| value.text())?.map(|text| text.text);
    table.finish()?;
    Ok(Rod { name, angles, length })
}
