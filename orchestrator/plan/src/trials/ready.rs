//! A closed loop with everything that trials need looked up.

use std::path::Path;

use super::judge::Check;
use crate::Error;
use crate::catalog::Catalog;
use crate::file::{Quantity, Text};
use crate::stabilize::settings::{Perturb, Settings, Spread, Trials};
use crate::stabilize::wiring::{COMPONENT, find, noise_input};
use crate::task::seconds;
use airloop_cosim::master::Algorithm;
use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::graph::{Source, Start, unit_of};
use airloop_fmi::{InterfaceKind, VariableKind};
use airloop_series::TimeSeries;
use airloop_series::units::{Compatibility, compatible, lookup};

/// A variable that is perturbed.
#[derive(Debug, Clone, PartialEq)]
pub struct Place {
    /// Component and variable.
    pub component: usize,
    /// See `component`.
    pub variable: usize,
    /// Value of the model.
    pub value: f64,
    /// Half width of the perturbation.
    pub width: f64,
    /// Smallest and largest value that the FMU declares; infinite where it declares none.
    pub range: [f64; 2],
}

impl Place {
    /// The value with a part, -1..1, of the perturbation.
    pub(crate) fn perturbed(&self, part: f64) -> f64 {
        self.value + part * self.width
    }
}

/// Variables that are perturbed by one number.
#[derive(Debug, Clone, PartialEq)]
pub struct Perturbation {
    /// Names of the variables.
    pub name: String,
    /// The variables.
    pub places: Vec<Place>,
}

impl Perturbation {
    /// Whether all variables stay within their ranges.
    pub(crate) fn allows(&self, part: f64) -> bool {
        self.places.iter().all(|place| (place.range[0]..=place.range[1]).contains(&place.perturbed(part)))
    }
}

/// Noise of a sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct Noise {
    /// Input of the system.
    pub name: String,
    /// Its index.
    pub input: usize,
    /// Standard deviation.
    pub deviation: f64,
}

/// A closed loop that is ready for trials.
#[derive(Debug)]
pub struct Ready {
    /// The closed loop.
    pub graph: SystemGraph,
    /// The controller and its parameter `feedback`.
    pub controller: usize,
    /// See `controller`.
    pub feedback: usize,
    /// Sample time of the controller \[s\].
    pub sample_time: f64,
    /// Begin of a trial \[s\].
    pub start: f64,
    /// End of a trial \[s\].
    pub stop: f64,
    /// Perturbations in the order of the file.
    pub perturbations: Vec<Perturbation>,
    /// Sensor noise.
    pub noise: Vec<Noise>,
    /// Criteria of a successful trial.
    pub criteria: Vec<Check>,
}

/// Opens a closed loop and looks up what the settings name.
///
/// # Errors
/// A system that cannot be opened or has no controller, settings without trials, or names and units with their place.
pub fn prepare(system: &Path, settings: &Settings, algorithm: Algorithm) -> Result<Ready, Error> {
    let interface = match algorithm {
        Algorithm::Monolithic => InterfaceKind::ModelExchange,
        _ => InterfaceKind::CoSimulation,
    };
    let graph = SystemGraph::open_for(system, interface)?;
    let source = &settings.source;
    let start = crate::file::Place(0);
    let trials = settings.trials.as_ref();
    let trials = trials.ok_or_else(|| source.error_at(start, "the file has no table [trials]; add it"))?;
    let place = |problem: String| Error::Place { place: system.display().to_string(), problem };
    let feedback =
        |component: &airloop_cosim::system::graph::Component| component.fmu.description.index_of("feedback");
    let controller =
        graph.components.iter().position(|one| one.name.starts_with(COMPONENT) && feedback(one).is_some());
    let controller = controller.ok_or_else(|| {
        place(
            "the system has no controller of `airloop stabilize`; give the closed loop that it wrote".into(),
        )
    })?;
    let feedback = feedback(&graph.components[controller]).unwrap_or_default();
    let catalog = Catalog::new(&graph);
    let sample_time = graph.components[controller]
        .fmu
        .description
        .index_of("sample_time")
        .and_then(|index| value_of(&graph, controller, index))
        .ok_or_else(|| place("the controller has no sample time".into()))?;
    let begin = graph.experiment.start.unwrap_or(0.0);
    let stop = begin + seconds(source, &trials.duration)?;
    let perturbations = trials
        .perturb
        .iter()
        .map(|one| perturbation(settings, &graph, one))
        .collect::<Result<Vec<_>, _>>()?;
    let noise = settings.sensors.iter().map(|sensor| noise(settings, &graph, &catalog, sensor));
    let noise = noise.collect::<Result<Vec<_>, _>>()?;
    let criteria = checks(settings, trials, &catalog, (begin, stop))?;
    Ok(Ready { graph, controller, feedback, sample_time, start: begin, stop, perturbations, noise, criteria })
}

/// Start value of a Real.
fn value_of(graph: &SystemGraph, component: usize, variable: usize) -> Option<f64> {
    let component = &graph.components[component];
    let set = component.start_values.iter().find(|start| start.variable == variable);
    match (set.map(|start| &start.value), &component.fmu.description.variables[variable].kind) {
        (Some(Start::Real(value)), _) => Some(*value),
        (_, VariableKind::Real(real)) => real.start,
        _ => None,
    }
}

/// Smallest and largest value of a Real.
fn range_of(graph: &SystemGraph, component: usize, variable: usize) -> [f64; 2] {
    match &graph.components[component].fmu.description.variables[variable].kind {
        VariableKind::Real(real) => {
            [real.min.unwrap_or(f64::NEG_INFINITY), real.max.unwrap_or(f64::INFINITY)]
        }
        _ => [f64::NEG_INFINITY, f64::INFINITY],
    }
}

/// Variables of a perturbation with their values and widths.
pub(crate) fn perturbation(
    settings: &Settings,
    graph: &SystemGraph,
    one: &Perturb,
) -> Result<Perturbation, Error> {
    let source = &settings.source;
    let place = |name: &Text| -> Result<Place, Error> {
        let found = find(graph, &name.text);
        let value = found.and_then(|(component, variable)| value_of(graph, component, variable));
        match (found, value) {
            (Some((component, variable)), Some(value)) => {
                let range = range_of(graph, component, variable);
                Ok(Place { component, variable, value, width: 0.0, range })
            }
            _ => {
                let problem = format!(
                    "the system has no Real `{}` with a start value; write component.variable",
                    name.text
                );
                Err(source.error_at(name.place, problem))
            }
        }
    };
    let mut places = one.variables.iter().map(place).collect::<Result<Vec<_>, _>>()?;
    for (i, place) in places.iter_mut().enumerate() {
        place.width = match &one.spread {
            Spread::Relative(part) => part * place.value,
            Spread::Absolute(width) => in_unit_of(settings, graph, width, place)?,
            Spread::Each(widths) => in_unit_of(settings, graph, &widths[i], place)?,
        };
    }
    let names: Vec<&str> = one.variables.iter().map(|name| name.text.as_str()).collect();
    Ok(Perturbation { name: names.join(", "), places })
}

/// A width in the unit of the variable that it belongs to.
fn in_unit_of(
    settings: &Settings,
    graph: &SystemGraph,
    width: &Quantity,
    place: &Place,
) -> Result<f64, Error> {
    let Some(unit) = &width.unit else { return Ok(width.value) };
    let variable = &graph.components[place.component].fmu.description.variables[place.variable];
    let own = match &variable.kind {
        VariableKind::Real(real) => real.unit.as_deref().unwrap_or("1"),
        _ => "1",
    };
    if own == unit {
        return Ok(width.value);
    }
    let known = lookup(unit).zip(lookup(own)).map(|(unit, own)| compatible(&unit, &own));
    match known {
        Some(Compatibility::Equal) => Ok(width.value),
        Some(Compatibility::Convertible { factor, .. }) => Ok(factor * width.value),
        _ => {
            let problem = format!("`{unit}` is not a unit for `{}`, which is in `{own}`", variable.name);
            Err(settings.source.error_at(width.place, problem))
        }
    }
}

fn noise(
    settings: &Settings,
    graph: &SystemGraph,
    catalog: &Catalog,
    (name, quantity): &(Text, Quantity),
) -> Result<Noise, Error> {
    let found = catalog.want(&settings.source, name)?;
    let input = noise_input(&catalog.variables()[found.0].name);
    let position = graph.inputs.iter().position(|one| one.name == input).ok_or_else(|| {
        let problem =
            format!("the closed loop does not measure `{}`; stabilize with these settings", name.text);
        settings.source.error_at(name.place, problem)
    })?;
    Ok(Noise { name: input, input: position, deviation: catalog.value(&settings.source, quantity, found)? })
}

fn checks(
    settings: &Settings,
    trials: &Trials,
    catalog: &Catalog,
    (start, stop): (f64, f64),
) -> Result<Vec<Check>, Error> {
    let source = &settings.source;
    let mut checks = Vec::new();
    for criterion in &trials.criteria {
        let found = catalog.want(source, &criterion.signal)?;
        let limit = |quantity: &Option<Quantity>, none: f64| match quantity {
            Some(quantity) => catalog.value(source, quantity, found),
            None => Ok(none),
        };
        let time = |quantity: &Option<Quantity>, none: f64| match quantity {
            Some(quantity) => seconds(source, quantity),
            None => Ok(none),
        };
        checks.push(Check {
            name: criterion.name.clone(),
            column: catalog.variables()[found.0].name.clone(),
            limits: (limit(&criterion.min, f64::NEG_INFINITY)?, limit(&criterion.max, f64::INFINITY)?),
            span: (time(&criterion.from, start)?, time(&criterion.to, stop)?),
        });
    }
    Ok(checks)
}

impl Ready {
    /// Links of the noise to the inputs of the system.
    pub(super) fn noise_links(&self) -> Vec<(usize, usize, f64, f64)> {
        let link = |(channel, noise): (usize, &Noise)| (noise.input, channel, 1.0, 0.0);
        self.noise.iter().enumerate().map(link).collect()
    }

    /// Names of criteria, each once.
    pub fn criteria_names(&self) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for check in &self.criteria {
            if !names.contains(&check.name) {
                names.push(check.name.clone());
            }
        }
        names
    }

    /// Columns that are judged, and the outputs of the system that come from the controller, with their units.
    pub fn shown(&self) -> Vec<(String, Option<String>)> {
        let commands = self.graph.outputs.iter().filter(
            |output| matches!(output.source, Source::Output { component, .. } if component == self.controller),
        );
        let mut shown: Vec<(String, Option<String>)> = Vec::new();
        for name in self.criteria.iter().map(|check| &check.column).chain(commands.map(|output| &output.name))
        {
            if shown.iter().all(|(other, _)| other != name) {
                shown.push((name.clone(), self.unit(name)));
            }
        }
        shown
    }

    /// Unit of a column of the result.
    fn unit(&self, name: &str) -> Option<String> {
        if let Some(output) = self.graph.outputs.iter().find(|output| output.name == name) {
            return output.unit.clone();
        }
        let (component, variable) = find(&self.graph, name)?;
        unit_of(&self.graph.components[component].fmu.description.variables[variable]).map(str::to_owned)
    }

    /// The columns of [`Ready::shown`].
    pub(super) fn trajectory(&self, result: &TimeSeries) -> Result<TimeSeries, Error> {
        let mut trajectory = TimeSeries::new(result.time().to_vec())?;
        for channel in self.shown().iter().filter_map(|(name, _)| result.channel(name)) {
            trajectory.push(channel.name.clone(), channel.unit.clone(), channel.values.clone())?;
        }
        Ok(trajectory)
    }
}
