//! Options: the inputs, outputs and parameters of a system that the dynamics shows.

/// Choice and order of states, inputs and outputs.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Options {
    /// States in the order of the problem: `component.state`, or a connector of the system that shows one. `None`: all
    /// that move, component by component in the order of the file.
    pub states: Option<Vec<String>>,
    /// System inputs in the order of the problem; others keep their start values. `None`: all.
    pub inputs: Option<Vec<String>>,
    /// Outputs: `component.variable` for any Real variable, or a connector of the system.
    pub outputs: Vec<String>,
    /// Time \[s\] at which the components are initialized.
    pub time: f64,
}
