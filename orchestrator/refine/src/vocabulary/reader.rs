//! Reading of an effect's TOML file: keys, names, units, formulas, and where something does not fit.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use airloop_expression::{Dimension, Expression};
use airloop_series::declared;
use serde::Deserialize;
use toml::Spanned;

use super::fmu_law::{Fault, FmuLaw, Interface};
use super::own::{Law, Own, PARAMETERS, Parameter, PortKind, Problem, STATES, VALUES, VARIABLES};
use super::units;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    kind: Spanned<String>,
    port: Spanned<String>,
    formula: Option<Spanned<String>>,
    fmu: Option<Spanned<String>>,
    output: Option<Spanned<String>>,
    #[serde(default)]
    inputs: BTreeMap<String, Spanned<String>>,
    #[serde(default)]
    words: String,
    #[serde(default)]
    variables: BTreeMap<String, Spanned<String>>,
    #[serde(default)]
    states: BTreeMap<String, Spanned<State>>,
    #[serde(default)]
    parameters: BTreeMap<String, Spanned<Entry>>,
    signs: Option<Signs>,
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
    #[serde(default)]
    unit: Option<String>,
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

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Signs {
    dissipative: Spanned<bool>,
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

/// Reads and checks the text of a file; `folder`: where its FMU is looked for.
///
/// # Errors
/// The first thing that does not fit, with its place.
pub(super) fn read(text: &str, folder: Option<&Path>) -> Result<Own, Problem> {
    let file: File = declared::read(text)
        .map_err(|problem| Problem { place: place(text, problem.at), problem: problem.words })?;
    let reader = Reader { text, file: &file };
    match (&file.formula, &file.fmu) {
        (Some(formula), None) => reader.by_formula(formula),
        (None, Some(fmu)) => reader.by_fmu(fmu, folder),
        (Some(formula), Some(_)) => {
            Err(reader.refuse(formula, "give `formula` or `fmu`, not both: each is the whole effect"))
        }
        (None, None) => Err(reader.refuse(&file.kind, "it needs a `formula`, or an `fmu` and its `output`")),
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
            "voltage" => PortKind::Voltage,
            "signal" => PortKind::Signal,
            "sensor" => PortKind::Sensor,
            other => {
                return Err(self.refuse(
                    &self.file.port,
                    format!(
                        "there is no port `{other}`; known are force, torque, flow, voltage, signal, sensor"
                    ),
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

    /// Units of `x`, `v` and `f`: those of the port, or those of `[variables]`.
    fn units(&self, port: PortKind) -> Result<[String; 3], Problem> {
        let mut units = port.units().map(str::to_owned);
        for (name, unit) in &self.file.variables {
            let Some(place) = VARIABLES[..3].iter().position(|own| own == name) else {
                return Err(
                    self.refuse(unit, format!("[variables] has no `{name}`; it gives units of x, v, f"))
                );
            };
            units[place].clone_from(unit.get_ref());
        }
        Ok(units)
    }

    /// Whether the effect has to take energy.
    fn dissipative(&self, port: PortKind) -> Result<bool, Problem> {
        let Some(Signs { dissipative }) = &self.file.signs else { return Ok(false) };
        let has_power = matches!(port, PortKind::Force | PortKind::Torque | PortKind::Voltage);
        if *dissipative.get_ref() && !has_power {
            let problem = format!("a {} has no power; `dissipative` is for a force or a torque", port.word());
            return Err(self.refuse(dissipative, problem));
        }
        Ok(*dissipative.get_ref())
    }

    /// Bounds and starts of a parameter, as the file gives them.
    fn range(&self, name: &str, at: &Spanned<Entry>) -> Result<((f64, f64), Vec<f64>), Problem> {
        let entry = at.get_ref();
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
            let problem =
                format!("start = {out} of `{name}` is outside of its bounds, {} to {}", bounds.0, bounds.1);
            return Err(self.refuse(at, problem));
        }
        Ok((bounds, starts))
    }

    /// An effect that an FMU computes.
    fn by_fmu(&self, fmu: &Spanned<String>, folder: Option<&Path>) -> Result<Own, Problem> {
        let (file, port) = (self.file, self.port()?);
        if !is_name(file.kind.get_ref()) {
            let problem = format!("kind = `{}` is no name: letters, digits and _", file.kind.get_ref());
            return Err(self.refuse(&file.kind, problem));
        }
        if let Some(state) = file.states.values().next() {
            return Err(self.refuse(state, "the states are those of the FMU; leave out [states]"));
        }
        let Some(output) = &file.output else {
            return Err(self.refuse(fmu, "name the output of the FMU that is the effect: output = \"...\""));
        };
        let count = file.parameters.len();
        if count > PARAMETERS {
            return Err(self.refuse(fmu, format!("it has {count} parameters; {PARAMETERS} are allowed")));
        }
        let mut inputs = Vec::new();
        for (name, input) in &file.inputs {
            let place = VARIABLES[..3].iter().position(|own| own == name);
            let allowed = |place: &usize| port != PortKind::Sensor || *place == 2;
            let Some(place) = place.filter(allowed) else {
                let known = if port == PortKind::Sensor { "f" } else { "x, v, f" };
                let problem = format!("an input of the FMU can get {known}; there is no `{name}` for one");
                return Err(self.refuse(input, problem));
            };
            inputs.push((place, input.get_ref().as_str()));
        }
        let path = folder.unwrap_or(Path::new("")).join(fmu.get_ref());
        let parameters = file.parameters.keys().map(String::as_str).collect();
        let asked = Interface { output: output.get_ref(), inputs, parameters };
        let law = FmuLaw::open(&path, &asked).map_err(|(fault, problem)| match fault {
            Fault::Fmu => self.refuse(fmu, problem),
            Fault::Output => self.refuse(output, problem),
            Fault::Input(place) => self.nth(&file.inputs, place, fmu, problem),
            Fault::Parameter(place) => self.nth(&file.parameters, place, fmu, problem),
        })?;
        let mut units = self.units(port)?;
        for ((place, name), at) in law.inputs.iter().zip(file.inputs.values()) {
            let declared = law.attributes(name).and_then(|real| real.unit.clone());
            units::same(&mut units[*place], declared, file.variables.contains_key(VARIABLES[*place]))
                .map_err(|problem| self.refuse(at, format!("input `{name}`: {problem}")))?;
        }
        let declared = law.attributes(output.get_ref()).and_then(|real| real.unit.clone());
        let stated = file.variables.contains_key("f") || file.inputs.contains_key("f");
        units::same(&mut units[2], declared, stated)
            .map_err(|problem| self.refuse(output, format!("output `{}`: {problem}", output.get_ref())))?;
        let mut parameters = Vec::new();
        for (name, entry) in &file.parameters {
            let real = law.attributes(name);
            let (mut bounds, mut starts) = self.range(name, entry)?;
            let declared = real.and_then(|real| real.unit.clone());
            let mut unit =
                entry.get_ref().unit.clone().unwrap_or_else(|| declared.clone().unwrap_or("1".into()));
            units::same(&mut unit, declared, true)
                .map_err(|problem| self.refuse(entry, format!("parameter `{name}`: {problem}")))?;
            let (least, most) = (real.and_then(|real| real.min), real.and_then(|real| real.max));
            bounds = (bounds.0.max(least.unwrap_or(bounds.0)), bounds.1.min(most.unwrap_or(bounds.1)));
            if starts.is_empty() {
                starts.extend(real.and_then(|real| real.start));
            }
            parameters.push(Parameter { name: name.clone(), unit, bounds, starts, linear: false });
        }
        let own = Own {
            kind: file.kind.get_ref().clone(),
            port,
            units,
            formula: law.words(),
            words: file.words.clone(),
            dissipative: self.dissipative(port)?,
            states: law.states.iter().map(|name| (name.clone(), format!("der({name})"))).collect(),
            parameters,
            law: Law::Fmu(Arc::new(law)),
        };
        self.evaluates(&own, fmu)?;
        Ok(own)
    }

    /// A problem with an entry of a table, by its number.
    fn nth<T>(
        &self,
        table: &BTreeMap<String, Spanned<T>>,
        place: usize,
        other: &Spanned<String>,
        problem: String,
    ) -> Problem {
        let here = table.values().nth(place).map(|at| self.refuse(at, &problem));
        here.unwrap_or_else(|| self.refuse(other, &problem))
    }

    /// Whether the FMU has a value at its first starts.
    fn evaluates(&self, own: &Own, fmu: &Spanned<String>) -> Result<(), Problem> {
        let Law::Fmu(law) = &own.law else { return Ok(()) };
        let p: Vec<f64> = own.parameters.iter().map(|p| p.starts.first().copied().unwrap_or(1.0)).collect();
        let mut z = vec![0.0; own.states.len()];
        law.value([0.0; VARIABLES.len()], &z, &p);
        law.advance([0.0; VARIABLES.len()], &mut z, &p, 1e-3);
        match law.problem() {
            Some(problem) => Err(self.refuse(fmu, problem)),
            None => Ok(()),
        }
    }

    /// An effect that is a formula.
    fn by_formula(&self, formula: &Spanned<String>) -> Result<Own, Problem> {
        let (file, port) = (self.file, self.port()?);
        for (key, at) in [("output", file.output.as_ref()), ("inputs", file.inputs.values().next())] {
            if let Some(at) = at {
                return Err(self.refuse(at, format!("`{key}` belongs to an `fmu`, and here is a formula")));
            }
        }
        let names = self.names()?;
        let units = self.units(port)?;
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
        let expression = read(formula, formula.get_ref(), "formula")?;
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
            let Some(unit) = &entry.get_ref().unit else {
                return Err(self.refuse(at, format!("`{name}` needs its `unit`; that of a number is \"1\"")));
            };
            own_units.push(dimension(unit).map_err(|problem| self.refuse(at, problem))?);
            let (bounds, starts) = self.range(name, at)?;
            let (name, unit) = (name.clone(), unit.clone());
            parameters.push(Parameter { name, unit, bounds, starts, linear: false });
        }
        let mut own = Own {
            kind: file.kind.get_ref().clone(),
            port,
            units,
            formula: formula.get_ref().clone(),
            words: file.words.clone(),
            dissipative: self.dissipative(port)?,
            states,
            parameters,
            law: Law::Formula { expression, rates },
        };
        units::check(&own, [&known, &own_units], &given).map_err(|(state, problem)| {
            let at = state.and_then(|i| file.states.values().nth(i)).map(|at| self.refuse(at, &problem));
            at.unwrap_or_else(|| self.refuse(formula, &problem))
        })?;
        let motion = VARIABLES[..2].iter().enumerate().find(|(place, _)| own.uses(*place));
        if let Some((_, name)) = motion.filter(|_| port == PortKind::Sensor) {
            let problem = format!("a sensor has f, the output that it shows, and t, but no {name}");
            return Err(self.refuse(formula, problem));
        }
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
    let Law::Formula { expression, rates } = &own.law else { return false };
    let place = VARIABLES.len() + own.states.len() + index;
    if rates.iter().any(|rate| rate.uses(place)) {
        return false;
    }
    // Points without meaning, away from zero and from each other.
    (1..=4).all(|draw| {
        let at = |value: f64| {
            let mut values: [f64; VALUES] =
                std::array::from_fn(|i| 0.3 + 0.37 * (1.7 * i as f64 + 2.9 * f64::from(draw)).sin().abs());
            values[place] = value;
            expression.value(&values)
        };
        let [zero, one, two, back] = [0.0, 1.0, 2.0, -3.0].map(at);
        let size = [zero, one, two, back].iter().fold(1e-300, |a: f64, b| a.max(b.abs()));
        let straight = |far: f64, times: f64| (far - zero - times * (one - zero)).abs() < 1e-9 * size;
        straight(two, 2.0) && straight(back, -3.0)
    })
}
