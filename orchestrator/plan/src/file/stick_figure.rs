//! `[stick_figure]`: rods from a point that moves, such as legs and trunk from a hip.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::value::{Placed, Text};

/// Rods from a point that moves, such as legs from a hip, drawn and shown in motion on the page of the results.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StickFigure {
    /// Horizontal position of the point in m.
    pub x: Text,
    /// Its height in m.
    pub y: Text,
    /// The rods, each to (x + length sin(angle), y - length cos(angle)).
    #[serde(rename = "rod")]
    pub rods: Vec<Rod>,
}

/// A rod.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rod {
    /// Name in the figure; default: its angles.
    pub name: Option<String>,
    /// Angle in rad, 0 hanging, counter-clockwise; of several their mean.
    pub angle: Placed<Angle>,
    /// Length in m, a variable or a number; below 0 the rod stands up.
    pub length: Length,
}

/// One angle or several, by the names of variables.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "an angle is the name of a variable, or a list of names whose mean it is")]
#[schemars(inline)]
pub enum Angle {
    /// A variable.
    One(String),
    /// Variables whose mean it is.
    Mean(#[schemars(length(min = 1))] Vec<String>),
}

impl Angle {
    /// The names of its variables.
    pub fn names(&self) -> &[String] {
        match self {
            Angle::One(name) => std::slice::from_ref(name),
            Angle::Mean(names) => names,
        }
    }
}

/// A variable by its name, or a number \[m\].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "a length is the name of a variable, or a number")]
#[schemars(inline)]
pub enum Length {
    /// Constant in m.
    Number(f64),
    /// A variable.
    Variable(String),
}
