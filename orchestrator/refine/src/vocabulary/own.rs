//! An effect of one's own: a formula over the variables of its port, states with their rates, parameters with units; or
//! an FMU that stands for the formula.

use std::path::Path;
use std::sync::Arc;

use airloop_expression::Expression;
use serde::Deserialize;

use super::fmu_law::FmuLaw;
use super::reader;

/// Most states of a formula: the FMU that evaluates formulas has no more.
pub const STATES: usize = 3;
/// Most states of an effect.
pub const MAX_STATES: usize = 8;
/// Most parameters, for the same reason.
pub const PARAMETERS: usize = 12;
/// Variables of every port: position, velocity, the value that passes, time.
pub const VARIABLES: [&str; 4] = ["x", "v", "f", "t"];
/// Values that a formula can use.
pub const VALUES: usize = VARIABLES.len() + MAX_STATES + PARAMETERS;
/// Starts that are tried together at most.
const MAX_STARTS: usize = 48;

/// Quantity that a port carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PortKind {
    /// A force; the formula is taken off.
    Force,
    /// A torque; the formula is taken off.
    Torque,
    /// A flow of volume or mass; the formula is taken off.
    Flow,
    /// A voltage that drives a current, which is `v`; the formula is taken off.
    Voltage,
    /// A signal or command; the formula replaces it.
    Signal,
    /// An output as its sensor shows it; the formula replaces it.
    Sensor,
}

impl PortKind {
    /// Word of the kind.
    pub fn word(self) -> &'static str {
        match self {
            PortKind::Force => "force",
            PortKind::Torque => "torque",
            PortKind::Flow => "flow",
            PortKind::Voltage => "voltage",
            PortKind::Signal => "signal",
            PortKind::Sensor => "sensor",
        }
    }

    /// Whether the formula is what the port gives on, instead of being taken off.
    pub fn replaces(self) -> bool {
        matches!(self, PortKind::Signal | PortKind::Sensor)
    }

    /// Units of `x`, `v` and `f`.
    pub fn units(self) -> [&'static str; 3] {
        match self {
            PortKind::Force => ["m", "m/s", "N"],
            PortKind::Torque => ["rad", "rad/s", "N.m"],
            PortKind::Flow => ["m", "m/s", "m3/s"],
            PortKind::Voltage => ["A.s", "A", "V"],
            PortKind::Signal | PortKind::Sensor => ["m", "m/s", "1"],
        }
    }
}

/// Problem with an effect, and its place in the file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{place}{problem}")]
pub struct Problem {
    /// `line L, column C: `, or empty.
    pub place: String,
    /// Problem and remedy.
    pub problem: String,
}

/// A parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Name.
    pub name: String,
    /// Unit, coherent with SI.
    pub unit: String,
    /// Least and largest value.
    pub bounds: (f64, f64),
    /// Values to start from.
    pub starts: Vec<f64>,
    /// The formula is proportional to it: it is found by a linear step.
    pub linear: bool,
}

/// An effect of one's own, checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Own {
    /// Its name.
    pub kind: String,
    /// Where it may act.
    pub port: PortKind,
    /// Units of `x`, `v` and `f`.
    pub units: [String; 3],
    /// Formula as written.
    pub formula: String,
    /// Description for reports.
    pub words: String,
    /// It takes energy: formula times velocity is not negative on average.
    pub dissipative: bool,
    /// States with their rates as written.
    pub states: Vec<(String, String)>,
    /// Parameters.
    pub parameters: Vec<Parameter>,
    /// Source of its value.
    pub law: Law,
}

/// Source of the value of an effect.
#[derive(Debug, Clone, PartialEq)]
pub enum Law {
    /// A formula.
    Formula {
        /// Formula; its names are [`VARIABLES`], states, parameters.
        expression: Expression,
        /// Rates of the states.
        rates: Vec<Expression>,
    },
    /// An output of an FMU.
    Fmu(Arc<FmuLaw>),
}

impl Own {
    /// The formula, with the rates of its states: `k*z with z' = v - z/s`.
    pub fn with_rates(&self) -> String {
        let rates: Vec<String> = self.states.iter().map(|(name, rate)| format!("{name}' = {rate}")).collect();
        match rates[..] {
            [] => self.formula.clone(),
            _ => format!("{} with {}", self.formula, rates.join(" and ")),
        }
    }

    /// Reads and checks the text of a file.
    ///
    /// # Errors
    /// The first thing that does not fit, with its place: keys, names, units, formulas, bounds, starts.
    pub fn read(text: &str) -> Result<Own, Problem> {
        reader::read(text, None)
    }

    /// As [`Own::read`] for a file in `folder`, where its FMU is looked for.
    ///
    /// # Errors
    /// Same as [`Own::read`], and an FMU that cannot be opened or lacks what the file names.
    pub fn read_in(text: &str, folder: &Path) -> Result<Own, Problem> {
        reader::read(text, Some(folder))
    }

    /// Names that the formulas use, in the order of their values.
    pub fn names(&self) -> Vec<&str> {
        let states = self.states.iter().map(|(name, _)| name.as_str());
        let parameters = self.parameters.iter().map(|own| own.name.as_str());
        VARIABLES.into_iter().chain(states).chain(parameters).collect()
    }

    /// Whether the value or a rate follows from one of [`VARIABLES`], by its place.
    pub fn uses(&self, variable: usize) -> bool {
        match &self.law {
            Law::Formula { expression, rates } => {
                expression.uses(variable) || rates.iter().any(|rate| rate.uses(variable))
            }
            Law::Fmu(own) => own.uses(variable),
        }
    }

    /// Values for [`Expression::value`] from those of the variables, the states and the parameters.
    pub fn values(&self, variables: [f64; 4], z: &[f64], p: &[f64]) -> [f64; VALUES] {
        let mut values = [0.0; VALUES];
        let all = variables.iter().chain(&z[..self.states.len()]).chain(p);
        values.iter_mut().zip(all).for_each(|(value, own)| *value = *own);
        values
    }

    /// Value of the effect; not a number where it has none.
    pub fn value(&self, variables: [f64; 4], z: &[f64], p: &[f64]) -> f64 {
        match &self.law {
            Law::Formula { expression, .. } => expression.value(&self.values(variables, z, p)),
            Law::Fmu(own) => own.value(variables, z, p),
        }
    }

    /// States after `step` \[s\] with the variables held: each by the exponential of its own rate, which is exact where
    /// the rate is linear in the state and stays stable however fast it is.
    pub fn advance(&self, variables: [f64; 4], z: &mut [f64], p: &[f64], step: f64) {
        let rates = match &self.law {
            Law::Formula { rates, .. } => rates,
            Law::Fmu(own) => return own.advance(variables, z, p, step),
        };
        let values = self.values(variables, z, p);
        for (i, rate) in rates.iter().enumerate() {
            let place = VARIABLES.len() + i;
            let now = rate.value(&values);
            let mut moved = values;
            let width = 1e-6 * (values[place].abs() + now.abs() * step).max(1e-12);
            moved[place] += width;
            let slope = (rate.value(&moved) - now) / width;
            z[i] += exponential_step(now, slope, step);
        }
    }

    /// Points to start from: all together, zero where the linear step finds the value.
    pub fn starts(&self) -> Vec<Vec<f64>> {
        let mut found: Vec<Vec<f64>> = vec![Vec::new()];
        for own in &self.parameters {
            let next = |base: &Vec<f64>| {
                let values = if own.linear { &[0.0][..] } else { &own.starts[..] };
                values.iter().map(|value| [&base[..], &[*value]].concat()).collect::<Vec<_>>()
            };
            found = found.iter().flat_map(next).collect();
        }
        found.truncate(MAX_STARTS);
        found
    }

    /// The TOML text of an effect with these values as starts, which [`Own::read`] reads again.
    pub fn to_toml(&self, values: &[f64]) -> String {
        let mut text = format!("kind = {:?}\nport = {:?}\n", self.kind, self.port.word());
        match &self.law {
            Law::Formula { .. } => text += &format!("formula = {:?}\n", self.formula),
            Law::Fmu(own) => {
                let inputs =
                    own.inputs.iter().map(|(place, name)| format!("{} = {name:?}", VARIABLES[*place]));
                let inputs: Vec<String> = inputs.collect();
                text += &format!("fmu = {:?}\noutput = {:?}\n", own.path(), own.output);
                text += &format!("inputs = {{ {} }}\n", inputs.join(", "));
            }
        }
        text += &format!("words = {:?}\n", self.words);
        text += "\n[variables]\n";
        for (name, unit) in VARIABLES.iter().zip(&self.units) {
            text += &format!("{name} = {unit:?}\n");
        }
        if !self.states.is_empty() && matches!(self.law, Law::Formula { .. }) {
            text += "\n[states]\n";
            self.states.iter().for_each(|(name, rate)| text += &format!("{name} = {rate:?}\n"));
        }
        for (own, value) in self.parameters.iter().zip(values) {
            text += &format!("\n[parameters.{}]\nunit = {:?}\nstart = [{value:?}]\n", own.name, own.unit);
            if own.bounds.0.is_finite() && own.bounds.1.is_finite() {
                text += &format!("bounds = [{:?}, {:?}]\n", own.bounds.0, own.bounds.1);
            }
        }
        if self.dissipative {
            text += "\n[signs]\ndissipative = true\n";
        }
        text
    }
}

/// Change of a state in a step \[s\] from its rate and the slope of that over the state \[1/s\].
pub(super) fn exponential_step(rate: f64, slope: f64, step: f64) -> f64 {
    let part = slope * step;
    // (exp(s) - 1)/s
    let factor = if part.abs() < 1e-8 { 1.0 } else { part.min(50.0).exp_m1() / part };
    step * rate * factor
}

#[cfg(test)]
mod tests {
    use super::*;

    pub const BRISTLE: &str = r#"kind = "bristle"
port = "force"
formula = "k*z"
words = "elastic bristles of the seal"
[states]
z = "v - abs(v)*z/d"
[parameters.k]
unit = "N/m"
bounds = [0, 1e6]
[parameters.d]
unit = "m"
bounds = [1e-6, 1e-2]
start = [1e-4, 1e-3]
[signs]
dissipative = true
"#;

    #[test]
    fn a_file_gives_an_effect_whose_amplitude_is_found_by_a_linear_step() {
        let own = Own::read(BRISTLE).expect("an effect");
        assert_eq!(own.names(), ["x", "v", "f", "t", "z", "d", "k"]);
        assert_eq!(own.starts(), [[1e-4, 0.0], [1e-3, 0.0]]);
        assert!(own.dissipative && own.parameters[1].linear && !own.parameters[0].linear);
        assert_eq!(own.value([0.0, 0.1, 5.0, 1.0], &[2e-4], &[1e-3, 1e4]), 2.0);
        let again = Own::read(&own.to_toml(&[1e-3, 1e4])).expect("its own text");
        assert_eq!((again.formula, again.states), (own.formula, own.states));
    }

    #[test]
    fn states_follow_linear_rates_exactly_however_fast() {
        let own = Own::read(BRISTLE).expect("an effect");
        for (v, d, step) in [(0.1, 1e-3, 1e-3), (-0.5, 1e-5, 1e-2), (0.02, 5e-3, 1e-1)] {
            let mut z = [3e-4];
            own.advance([0.0, v, 0.0, 0.0], &mut z, &[d, 1.0], step);
            let exact = crate::study::law::preslide(3e-4, v, d, step);
            assert!((z[0] - exact).abs() < 1e-9 * d.max(3e-4), "{} {exact}", z[0]);
        }
    }

    #[test]
    fn what_does_not_fit_is_told_with_line_and_column() {
        for (old, new, words) in [
            (
                "formula = \"k*z\"",
                "formula = \"k*y\"",
                "line 3, column 11: formula = `k*y`, column 3: there is no `y`",
            ),
            (
                "\"k*z\"",
                "\"k*v\"",
                "line 3, column 11: the formula `k*v` has the unit kg.m.s-3, the port kg.m.s-2",
            ),
            (
                "\"force\"",
                "\"forces\"",
                "line 2, column 8: there is no port `forces`; known are force, torque",
            ),
            ("unit = \"N/m\"", "unit = \"N/mm\"", "line 7, column 1: N/mm is 1000 times the SI unit"),
            ("unit = \"N/m\"", "unit = \"furlong\"", "unit `furlong` is not known"),
            ("z/d", "z/k", "cannot be told"),
            // A state in m.s has this rate, so that it is the formula that does not fit.
            (
                "v - abs",
                "x - abs",
                "line 3, column 11: the formula `k*z` has the unit kg.m.s-1, the port kg.m.s-2",
            ),
            ("start = [1e-4, 1e-3]", "", "`d` needs `start`"),
            ("start = [1e-4, 1e-3]", "start = 1.0", "outside of its bounds, 0.000001 to 0.01"),
            ("bounds = [0, 1e6]", "bounds = [1, 0]", "bounds of `k`"),
            ("[parameters.k]", "[parameters.x]", "`x` is given twice"),
            ("words", "word", "the file has no key `word`; did you mean `words`"),
            ("kind = \"bristle\"", "", "the file has no `kind`; add it"),
            ("kind = \"bristle\"", "kind = \"my effect\"", "is no name"),
        ] {
            assert!(BRISTLE.contains(old));
            let error = Own::read(&BRISTLE.replace(old, new)).expect_err(new);
            assert!(error.to_string().contains(words), "{new}: {error}");
        }
    }

    #[test]
    fn a_unit_of_a_state_may_be_given() {
        let text = r#"kind = "heat"
port = "torque"
formula = "c*T*v"
[states.T]
rate = "(f*v - h*T)/C"
unit = "K"
[parameters]
c = { unit = "N.m.s/(rad.K)" }
h = { unit = "W/K", start = 0.5 }
C = { unit = "J/K", start = 30 }
"#;
        let own = Own::read(text).expect("an effect");
        assert_eq!(own.parameters.iter().filter(|p| p.linear).count(), 1);
    }
}
