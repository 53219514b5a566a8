//! How the system inside an FMU is run: `resources/system.toml`.

use std::path::Path;

use airloop_cosim::master::{Algorithm, Settings};
use airloop_cosim::system::SystemGraph;
use airloop_ocp::control::nmpc::Plant;
use serde::{Deserialize, Serialize};

/// Name of the file in the resources.
pub(crate) const FILE: &str = "system.toml";
/// Folder of the system in the resources, and its description there.
pub(crate) const SYSTEM: &str = "system";
pub(crate) const STRUCTURE: &str = "SystemStructure.ssd";

/// Master that steps the components in Co-Simulation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Master {
    /// Serial.
    GaussSeidel,
    /// Parallel.
    Jacobi,
    /// Linearly implicit.
    InterfaceJacobian,
}

/// Identity of the FMU and settings of its master.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Recipe {
    /// `modelName`.
    pub name: String,
    /// Master of Co-Simulation; its options are those of `airloop run`.
    pub master: Master,
    /// Communication step size inside \[s\]; a step of the importer is made of these.
    pub step: f64,
    /// Identity of the archive; made by [`crate::write`].
    #[serde(default)]
    pub guid: String,
    /// The FMU is a controller that predicts with the system; none: it is the system.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nmpc: Option<Nmpc>,
    /// The FMU is the only component under its own names, with an input [`added_to`] each of these rates of its states;
    /// none: it is the system.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rates: Vec<String>,
}

/// Name of the input that adds to a rate.
pub fn added_to(rate: &str) -> String {
    format!("added_to_{rate}")
}

/// A controller that predicts with the system inside.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Nmpc {
    /// States of the model, `component.state`.
    pub states: Vec<String>,
    /// Inputs of the model.
    pub inputs: Vec<String>,
    /// Outputs of the model.
    pub outputs: Vec<String>,
    /// Names of the estimated values: states, disturbances of inputs, parameters.
    pub estimates: Vec<String>,
    /// Parameters that the controller learns.
    pub parameters: Vec<Parameter>,
    /// Numbers of the controller.
    pub plant: Plant,
}

/// Variables that one learned parameter moves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// `component.variable`, with its values one width above and below the declared one.
    pub variables: Vec<(String, f64, f64)>,
    /// Whether the rates are linear in it.
    pub linear: bool,
}

impl Recipe {
    /// Gauss-Seidel at the step that the system suggests, or 1 ms.
    pub fn new(graph: &SystemGraph) -> Recipe {
        let step = graph.experiment.step_size.unwrap_or(Settings::default().step_size);
        Recipe {
            name: graph.name.clone(),
            master: Master::GaussSeidel,
            step,
            guid: String::new(),
            nmpc: None,
            rates: Vec::new(),
        }
    }

    /// The only component of a system with an input for each of these rates of its states, `der(h)` as its FMU names
    /// them. Model Exchange, and Co-Simulation under error control.
    pub fn with_rates(graph: &SystemGraph, rates: Vec<String>) -> Recipe {
        let name = graph.components.first().map(|own| own.fmu.description.model_name.clone());
        Recipe { name: name.unwrap_or_default(), rates, ..Recipe::new(graph) }
    }

    /// Whether the components are stepped by an integrator in here, also in Co-Simulation.
    pub(crate) fn integrates(&self) -> bool {
        !self.rates.is_empty()
    }

    /// Reads the recipe of an FMU.
    pub(crate) fn read(resources: &Path) -> Result<Recipe, String> {
        let path = resources.join(FILE);
        let text = std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        toml::from_str(&text).map_err(|error| format!("{}: {error}", path.display()))
    }

    /// Settings of the master from `start` to `stop` \[s\].
    pub(crate) fn settings(&self, start: f64, stop: f64, tolerance: Option<f64>) -> Settings {
        let algorithm = match self.master {
            Master::GaussSeidel => Algorithm::GaussSeidel,
            Master::Jacobi => Algorithm::Jacobi,
            Master::InterfaceJacobian => Algorithm::InterfaceJacobian,
        };
        let (start_time, stop_time, step_size) = (start, stop, self.step);
        Settings { start_time, stop_time, step_size, algorithm, tolerance, ..Settings::default() }
    }
}
