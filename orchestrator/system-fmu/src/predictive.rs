//! The FMU as a model predictive controller: the system inside is its model.
//!
//! Inputs `y[i]` and `noise[i]`, outputs `u[j]` and `x_hat[i]` as those of the FMU `tvlqr-controller`, so that one
//! wiring serves both; and `solve_time`, `iterations` and `feasible` of the last solve.

use std::sync::{Mutex, PoisonError};

use airloop_cosim::coupled::{Options, System};
use airloop_cosim::master::embedded::{Place, Value};
use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::graph::DataType;
use airloop_dynamics::Dynamics;
use airloop_fmi::Variability;
use airloop_ocp::control::nmpc;
use airloop_ocp::control::nmpc::family::{Family, Member};

use crate::instance::Refused;
use crate::recipe::{Nmpc, Parameter};
use crate::table::{Role, Table, Variable};

/// A part of a sample that is rounding.
const ROUNDING: f64 = 1e-6;

/// The model as declared, and for every parameter above and below.
type Models = (System, Vec<(System, Option<System>)>);

/// A controller in the life of an FMU.
pub(crate) struct Predictive {
    recipe: Nmpc,
    guid: String,
    graph: SystemGraph,
    controller: Option<nmpc::Nmpc>,
    measured: Vec<f64>,
    noise: Vec<f64>,
    feedback: bool,
    /// Time since the start \[s\].
    elapsed: f64,
    /// Number of the next sample.
    sample: u64,
    /// Sum of `measured` and `noise`.
    seen: Vec<f64>,
}

/// Its variables, in the order of [`Predictive::get`].
pub(crate) fn table(recipe: &Nmpc) -> Table {
    let (m, p) = (recipe.inputs.len(), recipe.plant.measured.len());
    let variable = |name: String, description: String, role: Role, start: Option<Value>| Variable {
        name,
        description,
        role,
        variability: match role {
            Role::Parameter => Variability::Fixed,
            Role::Input => Variability::Continuous,
            _ => Variability::Discrete,
        },
        data_type: DataType::Real,
        place: Place::Variable { component: 0, variable: 0 },
        start,
        unit: None,
        min: None,
        max: None,
        nominal: None,
        shown: false,
    };
    let zero = || Some(Value::Real(0.0));
    let mut variables = Vec::new();
    for i in 1..=p {
        variables.push(variable(format!("y[{i}]"), format!("measured signal {i}"), Role::Input, zero()));
    }
    for i in 1..=p {
        let about = format!("added to y[{i}]: sensor noise for trials");
        variables.push(variable(format!("noise[{i}]"), about, Role::Input, zero()));
    }
    for j in 1..=m {
        variables.push(variable(format!("u[{j}]"), format!("input {j} of the plant"), Role::Output, None));
    }
    for (i, name) in recipe.estimates.iter().enumerate() {
        let about = format!("estimate of {name}");
        variables.push(variable(format!("x_hat[{}]", i + 1), about, Role::Output, None));
    }
    let second = Some("s".to_owned());
    let solve_time =
        variable("solve_time".into(), "wall-clock time of the last solve".into(), Role::Output, None);
    variables.push(Variable { unit: second.clone(), ..solve_time });
    let about = "Gauss-Newton iterations of the last solve".into();
    let iterations = variable("iterations".into(), about, Role::Output, None);
    variables.push(Variable { data_type: DataType::Integer, ..iterations });
    let about = "whether the plan of the last solve keeps all bounds".into();
    let feasible = variable("feasible".into(), about, Role::Output, None);
    variables.push(Variable { data_type: DataType::Boolean, ..feasible });
    let about = "time between samples; that of the design".into();
    let sample_time = Some(Value::Real(recipe.plant.sample_time));
    let sample_time = variable("sample_time".into(), about, Role::Parameter, sample_time);
    variables.push(Variable { unit: second, ..sample_time });
    let about = "false: the nominal inputs alone, open loop; the estimate goes on".into();
    let feedback = variable("feedback".into(), about, Role::Parameter, Some(Value::Boolean(true)));
    variables.push(Variable { data_type: DataType::Boolean, ..feedback });
    Table { variables, ..Table::default() }
}

impl Predictive {
    /// Of the system in the resources, whose models are made at the start.
    pub fn open(graph: &SystemGraph, recipe: &Nmpc, guid: &str) -> Result<Predictive, Refused> {
        let p = recipe.plant.measured.len();
        Ok(Predictive {
            recipe: recipe.clone(),
            guid: guid.to_owned(),
            graph: graph.clone(),
            controller: None,
            measured: vec![0.0; p],
            noise: vec![0.0; p],
            feedback: true,
            elapsed: 0.0,
            sample: 0,
            seen: vec![0.0; p],
        })
    }

    pub fn reset(&mut self) {
        self.controller = None;
        self.measured.fill(0.0);
        self.noise.fill(0.0);
        (self.feedback, self.elapsed, self.sample) = (true, 0.0, 0);
    }

    /// Makes the models.
    pub fn start(&mut self) -> Result<(), Refused> {
        let family = self.family()?;
        self.controller = Some(nmpc::Nmpc::new(self.recipe.plant.clone(), family));
        (self.elapsed, self.sample) = (0.0, 0);
        Ok(())
    }

    /// Models of this system; what their making learns is kept for further instances of the process.
    fn family(&self) -> Result<Family, Refused> {
        static MADE: Mutex<Vec<(String, Models)>> = Mutex::new(Vec::new());
        let mut made = MADE.lock().unwrap_or_else(PoisonError::into_inner);
        if !made.iter().any(|(guid, _)| *guid == self.guid) {
            let open = |parameter: Option<(&Parameter, bool)>| {
                let mut graph = self.graph.clone();
                for (name, high, low) in parameter.iter().flat_map(|(parameter, _)| &parameter.variables) {
                    let value = if parameter.is_some_and(|(_, above)| above) { high } else { low };
                    let set = graph.set_start(name, &value.to_string(), "resources/system.toml");
                    set.map_err(|error| error.to_string())?;
                }
                let options = Options {
                    states: Some(self.recipe.states.clone()),
                    inputs: Some(self.recipe.inputs.clone()),
                    outputs: self.recipe.outputs.clone(),
                    time: 0.0,
                };
                System::open(&graph, &options).map_err(|error| error.to_string())
            };
            let members = self.recipe.parameters.iter().map(|parameter| {
                let low = (!parameter.linear).then(|| open(Some((parameter, false)))).transpose()?;
                Ok::<_, Refused>((open(Some((parameter, true)))?, low))
            });
            let models = (open(None)?, members.collect::<Result<Vec<_>, _>>()?);
            made.push((self.guid.clone(), models));
        }
        let Some((_, (nominal, members))) = made.iter().find(|(guid, _)| *guid == self.guid) else {
            return Err("the model was not made".into());
        };
        let copy = |system: &System| system.duplicate().map_err(|error| error.to_string());
        let members = members.iter().map(|(high, low)| {
            Ok::<_, Refused>(Member { high: copy(high)?, low: low.as_ref().map(copy).transpose()? })
        });
        Ok(Family::new(copy(nominal)?, members.collect::<Result<Vec<_>, _>>()?))
    }

    /// The value of a variable by its position in the table.
    pub fn get(&self, position: usize) -> Value {
        let (p, m, estimates) = (self.measured.len(), self.recipe.inputs.len(), self.recipe.estimates.len());
        let statistics = self.controller.as_ref().map(nmpc::Nmpc::statistics).unwrap_or_default();
        let of = |position: usize, end: usize| position.checked_sub(end);
        if position < p {
            return Value::Real(self.measured[position]);
        }
        if position < 2 * p {
            return Value::Real(self.noise[position - p]);
        }
        if position < 2 * p + m {
            let plan = &self.recipe.plant.inputs[0];
            let inputs = self.controller.as_ref().map_or(&plan[..], nmpc::Nmpc::inputs);
            return Value::Real(inputs[position - 2 * p]);
        }
        match of(position, 2 * p + m) {
            Some(i) if i < estimates => {
                let estimate = self.controller.as_ref().map(nmpc::Nmpc::estimate);
                Value::Real(estimate.map_or(0.0, |estimate| estimate[i]))
            }
            Some(i) => match i - estimates {
                0 => Value::Real(statistics.solve_time),
                1 => Value::Integer(statistics.iterations as i64),
                2 => Value::Boolean(statistics.feasible),
                3 => Value::Real(self.recipe.plant.sample_time),
                _ => Value::Boolean(self.feedback),
            },
            None => Value::Real(0.0),
        }
    }

    /// Sets a variable: inputs always, `feedback` before the start.
    pub fn set(&mut self, position: usize, value: f64, before: bool) -> Result<(), Refused> {
        let p = self.measured.len();
        let last = 2 * p + self.recipe.inputs.len() + self.recipe.estimates.len() + 4;
        if position < p {
            self.measured[position] = value;
        } else if position < 2 * p {
            self.noise[position - p] = value;
        } else if position == last && before {
            self.feedback = value != 0.0;
        } else if position + 1 == last && before && value == self.recipe.plant.sample_time {
            return Ok(());
        } else if position + 1 == last {
            let own = self.recipe.plant.sample_time;
            return Err(format!(
                "`sample_time` is {own} s by design; run `airloop stabilize` with another one"
            ));
        } else {
            return Err("only inputs can be set, and `feedback` before the start".into());
        }
        Ok(())
    }

    /// A communication step: all samples that are due in it, each with the inputs that are set.
    pub fn advance(&mut self, h: f64) {
        let Some(controller) = &mut self.controller else { return };
        let sample_time = self.recipe.plant.sample_time;
        let end = self.elapsed + h;
        for (seen, (measured, noise)) in self.seen.iter_mut().zip(self.measured.iter().zip(&self.noise)) {
            *seen = measured + noise;
        }
        while self.sample as f64 * sample_time < end - ROUNDING * sample_time {
            controller.update(&self.seen, self.feedback);
            self.sample += 1;
        }
        self.elapsed = end;
    }
}
