//! An effect as a TOML file: formula over the variables of its port, states with their rates, parameters with units.

use std::collections::BTreeMap;

use airloop_expression::{Dimension, Expression};
use serde::Deserialize;
use toml::Spanned;

use super::units;

/// Most states: the FMU that evaluates formulas has no more.
pub const STATES: usize = 3;
/// Most parameters, for the same reason.
pub const PARAMETERS: usize = 12;
/// Variables of every port: position, velocity, the value that passes, time.
pub const VARIABLES: [&str; 4] = ["x", "v", "f", "t"];
/// Values that a formula can use.
pub const VALUES: usize = VARIABLES.len() + STATES + PARAMETERS;
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
    /// A signal or command; the formula replaces it.
    Signal,
}

impl PortKind {
    /// Word of the kind.
    pub fn word(self) -> &'static str {
        match self {
            PortKind::Force => "force",
            PortKind::Torque => "torque",
            PortKind::Flow => "flow",
            PortKind::Signal => "signal",
        }
    }

    /// Whether the formula is what the port gives on, instead of being taken off.
    pub fn replaces(self) -> bool {
        self == PortKind::Signal
    }

    /// Units of `x`, `v` and `f`.
    pub fn units(self) -> [&'static str; 3] {
        match self {
            PortKind::Force => ["m", "m/s", "N"],
            PortKind::Torque => ["rad", "rad/s", "N.m"],
            PortKind::Flow => ["m", "m/s", "m3/s"],
            PortKind::Signal => ["m", "m/s", "1"],
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
    /// Formula; its names are [`VARIABLES`], states, parameters.
    pub expression: Expression,
    /// Rates of the states.
    pub rates: Vec<Expression>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    kind: Spanned<String>,
    port: Spanned<String>,
    formula: Spanned<String>,
    #[serde(default)]
    words: String,
    #[serde(default)]
    variables: BTreeMap<String, Spanned<String>>,
    #[serde(default)]
    states: BTreeMap<String, Spanned<State>>,
    #[serde(default)]
    parameters: BTreeMap<String, Spanned<Entry>>,
    #[serde(default)]
    signs: Signs,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum State {
    Rate(String),
    Table(StateTable),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StateTable {
    rate: String,
    unit: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    unit: String,
    #[serde(default)]
    bounds: Option<[f64; 2]>,
    #[serde(default)]
    start: Option<Starts>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Starts {
    One(f64),
    Several(Vec<f64>),
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Signs {
    #[serde(default)]
    dissipative: bool,
}

/// `line L, column C: ` of a byte of a text.
fn place(text: &str, byte: usize) -> String {
    let before = &text[..byte.min(text.len())];
    let line = before.matches('\n').count() + 1;
    let column = before.chars().rev().take_while(|c| *c != '\n').count() + 1;
    format!("line {line}, column {column}: ")
}

/// Whether a text is a name: letters, digits and `_`, no digit first.
fn is_name(text: &str) -> bool {
    let starts = text.chars().next().is_some_and(|c| c.is_alphabetic() || c == '_');
    starts && text.chars().all(|c| c.is_alphanumeric() || c == '_')
}

impl Own {
    /// Reads and checks the text of a file.
    ///
    /// # Errors
    /// The first thing that does not fit, with its place: keys, names, units, formulas, bounds, starts.
    pub fn read(text: &str) -> Result<Own, Problem> {
        let file: File = toml::from_str(text).map_err(|error: toml::de::Error| Problem {
            place: error.span().map_or_else(String::new, |span| place(text, span.start)),
            problem: error.message().to_owned(),
        })?;
        Reader { text, file: &file }.own()
    }

    /// Names that the formulas use, in the order of their values.
    pub fn names(&self) -> Vec<&str> {
        let states = self.states.iter().map(|(name, _)| name.as_str());
        let parameters = self.parameters.iter().map(|own| own.name.as_str());
        VARIABLES.into_iter().chain(states).chain(parameters).collect()
    }

    /// Values for [`Expression::value`] from those of the variables, the states and the parameters.
    pub fn values(&self, variables: [f64; 4], z: &[f64], p: &[f64]) -> [f64; VALUES] {
        let mut values = [0.0; VALUES];
        let all = variables.iter().chain(&z[..self.states.len()]).chain(p);
        values.iter_mut().zip(all).for_each(|(value, own)| *value = *own);
        values
    }

    /// Value of the formula.
    pub fn value(&self, variables: [f64; 4], z: &[f64], p: &[f64]) -> f64 {
        self.expression.value(&self.values(variables, z, p))
    }

    /// States after `step` \[s\] with the variables held: each by the exponential of its own rate, which is exact where
    /// the rate is linear in the state and stays stable however fast it is.
    pub fn advance(&self, variables: [f64; 4], z: &mut [f64], p: &[f64], step: f64) {
        let values = self.values(variables, z, p);
        for (i, rate) in self.rates.iter().enumerate() {
            let place = VARIABLES.len() + i;
            let now = rate.value(&values);
            let mut moved = values;
            let width = 1e-6 * (values[place].abs() + now.abs() * step).max(1e-12);
            moved[place] += width;
            let slope = (rate.value(&moved) - now) / width * step;
            // (exp(s) - 1)/s
            let factor = if slope.abs() < 1e-8 { 1.0 } else { slope.min(50.0).exp_m1() / slope };
            z[i] += step * now * factor;
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
        let mut text = format!(
            "kind = {:?}\nport = {:?}\nformula = {:?}\nwords = {:?}\n",
            self.kind,
            self.port.word(),
            self.formula,
            self.words
        );
        text += "\n[variables]\n";
        for (name, unit) in VARIABLES.iter().zip(&self.units) {
            text += &format!("{name} = {unit:?}\n");
        }
        if !self.states.is_empty() {
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

struct Reader<'a> {
    text: &'a str,
    file: &'a File,
}

impl Reader<'_> {
    fn refuse<T>(&self, at: &Spanned<T>, problem: impl std::fmt::Display) -> Problem {
        Problem { place: place(self.text, at.span().start), problem: problem.to_string() }
    }

    fn port(&self) -> Result<PortKind, Problem> {
        Ok(match self.file.port.get_ref().as_str() {
            "force" => PortKind::Force,
            "torque" => PortKind::Torque,
            "flow" => PortKind::Flow,
            "signal" => PortKind::Signal,
            other => {
                return Err(self.refuse(
                    &self.file.port,
                    format!("there is no port `{other}`; known are force, torque, flow, signal"),
                ));
            }
        })
    }

    fn names(&self) -> Result<Vec<&str>, Problem> {
        let file = self.file;
        if !is_name(file.kind.get_ref()) {
            let problem = format!("kind = `{}` is no name: letters, digits and _", file.kind.get_ref());
            return Err(self.refuse(&file.kind, problem));
        }
        let states = file.states.iter().map(|(name, at)| (name, self.refuse(at, "")));
        let parameters = file.parameters.iter().map(|(name, at)| (name, self.refuse(at, "")));
        let mut found = VARIABLES.to_vec();
        for (name, at) in states.chain(parameters) {
            let problem = if !is_name(name) {
                format!("`{name}` is no name: letters, digits and _")
            } else if found.contains(&name.as_str()) {
                format!("the name `{name}` is given twice; those of the port are {}", VARIABLES.join(", "))
            } else {
                found.push(name);
                continue;
            };
            return Err(Problem { problem, ..at });
        }
        for (count, most, what) in
            [(file.states.len(), STATES, "states"), (file.parameters.len(), PARAMETERS, "parameters")]
        {
            if count > most {
                return Err(self.refuse(&file.kind, format!("it has {count} {what}; {most} are allowed")));
            }
        }
        Ok(found)
    }

    fn own(&self) -> Result<Own, Problem> {
        let (file, port) = (self.file, self.port()?);
        let names = self.names()?;
        let mut units = port.units().map(str::to_owned);
        for (name, unit) in &file.variables {
            let Some(place) = VARIABLES[..3].iter().position(|own| own == name) else {
                return Err(
                    self.refuse(unit, format!("[variables] has no `{name}`; it gives units of x, v, f"))
                );
            };
            units[place].clone_from(unit.get_ref());
        }
        let dimension = |unit: &str| units::coherent(unit);
        let mut known = Vec::new();
        for (name, unit) in VARIABLES.iter().zip(&units) {
            let at = file.variables.get(*name).unwrap_or(&file.port);
            known.push(dimension(unit).map_err(|problem| self.refuse(at, problem))?);
        }
        known.push(Dimension::new(0.0, 0.0, 1.0));
        let read = |at: &Spanned<String>, text: &str, what: &str| {
            Expression::parse(text, &names)
                .map_err(|error| self.refuse(at, format!("{what} = `{text}`, {error}")))
        };
        let expression = read(&file.formula, file.formula.get_ref(), "formula")?;
        let mut states = Vec::new();
        let mut rates = Vec::new();
        let mut given = Vec::new();
        for (name, state) in &file.states {
            let (rate, unit) = match state.get_ref() {
                State::Rate(rate) => (rate, None),
                State::Table(own) => (&own.rate, Some(own.unit.as_str())),
            };
            let parsed = Expression::parse(rate, &names)
                .map_err(|error| self.refuse(state, format!("rate of {name} = `{rate}`, {error}")))?;
            let unit = unit.map(dimension).transpose().map_err(|problem| self.refuse(state, problem))?;
            states.push((name.clone(), rate.clone()));
            rates.push(parsed);
            given.push(unit);
        }
        let mut parameters = Vec::new();
        let mut own_units = Vec::new();
        for (name, entry) in &file.parameters {
            let at = entry;
            let entry = entry.get_ref();
            own_units.push(dimension(&entry.unit).map_err(|problem| self.refuse(at, problem))?);
            let bounds = entry.bounds.map_or((f64::NEG_INFINITY, f64::INFINITY), |[low, high]| (low, high));
            if bounds.0.is_nan() || bounds.1.is_nan() || bounds.0 >= bounds.1 {
                let problem = format!("bounds of `{name}` must be a least and a larger value");
                return Err(self.refuse(at, problem));
            }
            let starts = match &entry.start {
                None => Vec::new(),
                Some(Starts::One(value)) => vec![*value],
                Some(Starts::Several(values)) => values.clone(),
            };
            if let Some(out) = starts.iter().find(|value| !(bounds.0..=bounds.1).contains(*value)) {
                let problem = format!(
                    "start = {out} of `{name}` is outside of its bounds, {} to {}",
                    bounds.0, bounds.1
                );
                return Err(self.refuse(at, problem));
            }
            let (name, unit) = (name.clone(), entry.unit.clone());
            parameters.push(Parameter { name, unit, bounds, starts, linear: false });
        }
        let mut own = Own {
            kind: file.kind.get_ref().clone(),
            port,
            units,
            formula: file.formula.get_ref().clone(),
            words: file.words.clone(),
            dissipative: file.signs.dissipative,
            states,
            parameters,
            expression,
            rates,
        };
        units::check(&own, [&known, &own_units], &given).map_err(|(state, problem)| {
            let at = state.and_then(|i| file.states.values().nth(i)).map(|at| self.refuse(at, &problem));
            at.unwrap_or_else(|| self.refuse(&file.formula, &problem))
        })?;
        for index in 0..own.parameters.len() {
            own.parameters[index].linear = is_linear(&own, index);
            if own.parameters[index].starts.is_empty() && !own.parameters[index].linear {
                let name = &own.parameters[index].name;
                let at = &file.parameters[name];
                let problem = format!(
                    "`{name}` needs `start`, one value or several, since the formula is not proportional to it"
                );
                return Err(self.refuse(at, problem));
            }
        }
        // Two factors of one product cannot both be found by a linear step.
        let mut first = true;
        for own in &mut own.parameters {
            let shown = own.linear && !own.starts.contains(&0.0);
            if own.linear && !first && shown && !own.starts.is_empty() {
                own.linear = false;
            }
            first &= !own.linear;
        }
        Ok(own)
    }
}

/// Whether the formula is affine in a parameter that no rate uses.
fn is_linear(own: &Own, index: usize) -> bool {
    let place = VARIABLES.len() + own.states.len() + index;
    if own.rates.iter().any(|rate| rate.uses(place)) {
        return false;
    }
    // Points without meaning, away from zero and from each other.
    (1..=4).all(|draw| {
        let at = |value: f64| {
            let mut values: [f64; VALUES] =
                std::array::from_fn(|i| 0.3 + 0.37 * (1.7 * i as f64 + 2.9 * f64::from(draw)).sin().abs());
            values[place] = value;
            own.expression.value(&values)
        };
        let [zero, one, two, back] = [0.0, 1.0, 2.0, -3.0].map(at);
        let size = [zero, one, two, back].iter().fold(1e-300, |a: f64, b| a.max(b.abs()));
        let straight = |far: f64, times: f64| (far - zero - times * (one - zero)).abs() < 1e-9 * size;
        straight(two, 2.0) && straight(back, -3.0)
    })
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
            ("words", "word", "unknown field `word`"),
            ("kind = \"bristle\"", "", "missing field `kind`"),
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
