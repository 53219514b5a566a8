//! A first `study.toml` from the columns of records and a system, so that nobody begins with an empty file.
//!
//! Columns belong to inputs and outputs of the same name, or to those that the user names. The file holds, as comments,
//! what else a study may say: the parameters of the system with their values, sensor noise, free parameters. It is
//! written only if it can be read as a study.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::PathBuf;

use airloop_cosim::system::SystemGraph;
use airloop_cosim::system::graph::{DataType, Source};
use airloop_fmi::{Causality, InterfaceKind, Variability, VariableKind, template_folder};
use airloop_series::units::{self, Compatibility};
use airloop_series::{Channel, TimeSeries, csv};

use crate::relative_path::relative_path;

/// Name of the file.
pub const FILE: &str = "study.toml";
/// FMUs of this project: `airloop:NAME`.
const OWN: &str = "airloop:";
/// Part of a single record that is fitted; the rest judges.
const ESTIMATION_SHARE: f64 = 0.7;
/// Parameters that are listed.
const MAX_PARAMETERS: usize = 40;
/// Points of the derivative that stands for an unmeasured velocity.
const DERIVATIVE_POINTS: usize = 9;

/// Records and a system that make no study.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "file, column and signal, as in each message")]
pub enum Error {
    /// A study is there already.
    #[error("{} is there already; choose another folder, or remove it", file.display())]
    Present { file: PathBuf },
    /// The folder or a file in it cannot be written.
    #[error("{}: {problem}", file.display())]
    Write { file: PathBuf, problem: String },
    /// A signal that the system does not have.
    #[error("--signal {name}={column}: the system has no input or output `{name}`; it has: {known}")]
    NoSignal { name: String, column: String, known: String },
    /// A column that no record has.
    #[error("--signal {name}={column}: {} has no column `{column}`; it has: {columns}", file.display())]
    NoColumn { name: String, column: String, file: PathBuf, columns: String },
    /// Nothing to compare with.
    #[error(
        "{}: none of its columns ({columns}) is an output of the system ({known}); name a pair with --signal OUTPUT=COLUMN",
        file.display()
    )]
    NothingMeasured { file: PathBuf, columns: String, known: String },
    /// Two records of one name.
    #[error("two records have the name {name}; rename one of the files")]
    Twice { name: String },
    /// The records have other columns than the first.
    #[error("{}: it has no column `{column}`, which {} has; records of a study have the same columns", file.display(), first.display())]
    Columns { file: PathBuf, column: String, first: PathBuf },
}

/// Wishes for a study.
#[derive(Debug, Clone, Default)]
pub struct Request {
    /// Folder that is made.
    pub folder: PathBuf,
    /// CSV files of the records; they are copied into the folder.
    pub records: Vec<PathBuf>,
    /// `.ssd`, `.ssp`, `.fmu`, or `airloop:NAME`.
    pub system: String,
    /// Columns of another name, by input or output of the system.
    pub signals: BTreeMap<String, String>,
}

/// Writes the folder of a study and returns the path of its file, and a sentence for each column without signal
/// and where nothing drives the system.
///
/// # Errors
/// Records that cannot be read, a system that cannot be opened, nothing to compare with, a file that is in the way.
pub fn write(request: &Request) -> Result<(PathBuf, Vec<String>), crate::Error> {
    let file = request.folder.join(FILE);
    if file.exists() {
        return Err(Error::Present { file }.into());
    }
    let records: Vec<(PathBuf, TimeSeries)> = request
        .records
        .iter()
        .map(|path| Ok((path.clone(), csv::read(path)?)))
        .collect::<Result<_, crate::Error>>()?;
    let system = match request.system.strip_prefix(OWN) {
        Some(name) => template_folder::template(name, None)?,
        None => PathBuf::from(&request.system),
    };
    let graph = SystemGraph::open_to_read(&system)?;
    let names = file_names(&records)?;
    let shown = match request.system.strip_prefix(OWN) {
        Some(_) => request.system.clone(),
        None => relative_path(&system, &request.folder)
            .map_err(|error| Error::Write { file: system.clone(), problem: error.to_string() })?,
    };
    let matched = Matched::new(&graph, &records, &request.signals)?;
    let text = text(&graph, &shown, &matched, &names);
    let problem =
        |error: std::io::Error| Error::Write { file: request.folder.clone(), problem: error.to_string() };
    std::fs::create_dir_all(&request.folder).map_err(problem)?;
    for ((path, _), name) in records.iter().zip(&names) {
        let copy = request.folder.join(name);
        let same = copy.canonicalize().is_ok_and(|copy| path.canonicalize().is_ok_and(|path| path == copy));
        if copy.exists() && !same {
            return Err(Error::Present { file: copy }.into());
        }
        if !same {
            let write =
                |source: std::io::Error| Error::Write { file: copy.clone(), problem: source.to_string() };
            let mut record = airloop_series::file::open(path).map_err(write)?;
            airloop_series::file::write_whole(&copy, |out| std::io::copy(&mut record, out).map(drop))
                .map_err(write)?;
        }
    }
    airloop_series::file::write_whole(&file, |out| std::io::Write::write_all(out, text.as_bytes()))
        .map_err(problem)?;
    airloop_refine::study::find(&file)?;
    let unused =
        matched.unused.iter().map(|name| format!("the column `{name}` belongs to no signal of the system"));
    let mut notes: Vec<String> = unused.collect();
    if let (true, Some(first), false) =
        (matched.inputs.is_empty(), graph.inputs.first(), matched.unused.is_empty())
    {
        let inputs = joined(graph.inputs.iter().map(|input| input.name.as_str()));
        let first = &first.name;
        notes.push(format!(
            "no input of the system has a column ({inputs}), so nothing drives it; name a pair with --signal {first}=COLUMN"
        ));
    }
    Ok((file, notes))
}

fn file_names(records: &[(PathBuf, TimeSeries)]) -> Result<Vec<String>, Error> {
    let mut names: Vec<String> = Vec::new();
    for (path, _) in records {
        let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        if names.contains(&name) {
            return Err(Error::Twice { name });
        }
        names.push(name);
    }
    Ok(names)
}

/// A signal of the system and the column that shows it.
struct Pair {
    name: String,
    unit: Option<String>,
    column: String,
    /// Unit of the column where it is another.
    column_unit: Option<String>,
    /// Discrete, no Real, the input of a system that samples, or a column of steps: held between samples.
    held: bool,
    /// Name as a state, where it is one.
    state: Option<String>,
}

struct Matched {
    inputs: Vec<Pair>,
    outputs: Vec<Pair>,
    /// States without column: name and unit, and the column whose derivative they are.
    rates: Vec<(String, String)>,
    unused: Vec<String>,
    spans: Vec<(f64, f64)>,
}

fn joined<'a>(names: impl Iterator<Item = &'a str>) -> String {
    names.collect::<Vec<_>>().join(", ")
}

impl Matched {
    fn new(
        graph: &SystemGraph,
        records: &[(PathBuf, TimeSeries)],
        signals: &BTreeMap<String, String>,
    ) -> Result<Matched, Error> {
        let empty = (PathBuf::new(), TimeSeries::default());
        let (first, series) = records.first().unwrap_or(&empty);
        let inputs = graph.inputs.iter().map(|one| one.name.as_str());
        let outputs = graph.outputs.iter().map(|one| one.name.as_str());
        let columns = || joined(series.channels().iter().map(|channel| channel.name.as_str()));
        for (name, column) in signals {
            let (name, column) = (name.clone(), column.clone());
            if !inputs.clone().chain(outputs.clone()).any(|known| known == name) {
                let known = joined(inputs.chain(outputs));
                return Err(Error::NoSignal { name, column, known });
            }
            if series.channel(&column).is_none() {
                return Err(Error::NoColumn { name, column, file: first.clone(), columns: columns() });
            }
        }
        let column_of = |name: &str| {
            let column = signals.get(name).map_or(name, String::as_str);
            series.channel(column)
        };
        let states = states(graph);
        let pair =
            |name: &str, unit: &Option<String>, channel: &Channel, held: bool, source: Option<Source>| {
                let state =
                    states.iter().find(|(_, _, at)| source == Some(*at)).map(|(state, ..)| state.clone());
                Pair {
                    name: name.to_owned(),
                    unit: unit.clone(),
                    column: channel.name.clone(),
                    column_unit: channel.unit.clone(),
                    held,
                    state,
                }
            };
        let sampled = is_sampled(graph);
        let with_inputs = graph.inputs.iter().enumerate().filter_map(|(index, one)| {
            let channel = column_of(&one.name)?;
            let stepped = || records.iter().filter_map(|(_, own)| own.channel(&channel.name)).any(is_stepped);
            let held = sampled || graph.input_is_held(index) || stepped();
            Some(pair(&one.name, &one.unit, channel, held, None))
        });
        let with_outputs =
            graph.outputs.iter().filter(|one| one.data_type != DataType::String).filter_map(|one| {
                let channel = column_of(&one.name)?;
                Some(pair(&one.name, &one.unit, channel, false, Some(one.source)))
            });
        let (inputs, outputs): (Vec<Pair>, Vec<Pair>) = (with_inputs.collect(), with_outputs.collect());
        if outputs.is_empty() {
            let known = joined(graph.outputs.iter().map(|one| one.name.as_str()));
            return Err(Error::NothingMeasured { file: first.clone(), columns: columns(), known });
        }
        for (file, other) in &records[1.min(records.len())..] {
            let missing = inputs.iter().chain(&outputs).find(|pair| other.channel(&pair.column).is_none());
            if let Some(pair) = missing {
                let (file, column, first) = (file.clone(), pair.column.clone(), first.clone());
                return Err(Error::Columns { file, column, first });
            }
        }
        let used = |name: &str| inputs.iter().chain(&outputs).any(|pair| pair.column == name);
        let unused = series.channels().iter().map(|channel| channel.name.clone()).filter(|name| !used(name));
        let span = |series: &TimeSeries| {
            let time = series.time();
            (time.first().copied().unwrap_or(0.0), time.last().copied().unwrap_or(0.0))
        };
        Ok(Matched {
            rates: rates(&states, &outputs),
            unused: unused.collect(),
            spans: records.iter().map(|(_, series)| span(series)).collect(),
            inputs,
            outputs,
        })
    }
}

/// Whether all that a system shows changes at samples only, as that of an identified model does.
fn is_sampled(graph: &SystemGraph) -> bool {
    let discrete = |source: &Source| match source {
        Source::Output { component, variable } => {
            let description = &graph.components[*component].fmu.description;
            description.variables[*variable].variability == Variability::Discrete
        }
        Source::Input(_) => false,
    };
    !graph.outputs.is_empty() && graph.outputs.iter().all(|one| discrete(&one.source))
}

/// Shortest mean plateau of a column of steps \[samples\].
const MIN_PLATEAU: usize = 5;
/// Fewest steps, and the middle one of their sizes over the range of the column: a slow sensor of coarse resolution
/// goes in smaller ones.
const MIN_STEPS: usize = 3;
const MIN_STEP_OVER_RANGE: f64 = 0.05;

/// Whether a column goes in steps and stays where it is between them, as a command of a computer does.
fn is_stepped(channel: &Channel) -> bool {
    let values = &channel.values;
    let mut steps: Vec<f64> =
        values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|step| *step != 0.0).collect();
    if steps.len() < MIN_STEPS || steps.len() * MIN_PLATEAU > values.len() {
        return false;
    }
    steps.sort_by(f64::total_cmp);
    let (least, most) = values.iter().fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(*v), b.max(*v)));
    steps[steps.len() / 2] >= MIN_STEP_OVER_RANGE * (most - least)
}

/// Which of several records are for validation: those whose names say so, else the last of every kind (names that
/// differ in their last digits), else the last.
fn validation(names: &[String]) -> Vec<bool> {
    let stem = |name: &String| name.rsplit_once('.').map_or(name.as_str(), |(stem, _)| stem).to_lowercase();
    let says = |name: &String| {
        let stem = stem(name);
        stem.split(|c: char| !c.is_alphabetic())
            .any(|word| ["v", "val", "valid", "validation", "test"].contains(&word))
    };
    let chosen: Vec<bool> = names.iter().map(says).collect();
    if chosen.contains(&true) && chosen.contains(&false) {
        return chosen;
    }
    let kind = |name: &String| stem(name).trim_end_matches(|c: char| c.is_ascii_digit()).to_owned();
    let last_of_several = |(index, name): (usize, &String)| {
        let same = |other: &&String| kind(other) == kind(name);
        names[..index].iter().any(|other| same(&other))
            && !names[index + 1..].iter().any(|other| same(&other))
    };
    let mut chosen: Vec<bool> = names.iter().enumerate().map(last_of_several).collect();
    if let (false, Some(last)) = (chosen.contains(&true), chosen.last_mut()) {
        *last = true;
    }
    chosen
}

/// Continuous states: name in a study, unit, and where they stand. An FMU of Co-Simulation only shows none.
fn states(graph: &SystemGraph) -> Vec<(String, Option<String>, Source)> {
    let of = |(component, owner): (usize, &airloop_cosim::system::graph::Component)| {
        let description = &owner.fmu.description;
        let named = |variable: usize| {
            let own = &description.variables[variable];
            let name = if graph.single { own.name.clone() } else { owner.path_of(variable) };
            let unit = airloop_cosim::system::graph::unit_of(own).map(str::to_owned);
            (name, unit, Source::Output { component, variable })
        };
        description.continuous_states().map(named).collect::<Vec<_>>()
    };
    let with_equations = |owner: &airloop_cosim::system::graph::Component| {
        owner.fmu.interface(InterfaceKind::ModelExchange).is_some()
    };
    let all = graph.components.iter().enumerate().filter(|(_, owner)| with_equations(owner));
    all.flat_map(of).collect()
}

/// States that nobody measured and whose unit is that of exactly one measured state by second.
fn rates(states: &[(String, Option<String>, Source)], outputs: &[Pair]) -> Vec<(String, String)> {
    let measured = |name: &String| outputs.iter().any(|pair| pair.state.as_ref() == Some(name));
    let is_rate = |unit: &Option<String>, of: &Option<String>| {
        let (Some(unit), Some(of)) =
            (unit.as_deref().and_then(units::lookup), of.as_deref().and_then(units::lookup))
        else {
            return false;
        };
        let mut by_second = of;
        by_second.exponents.s -= 1;
        units::compatible(&unit, &by_second) == Compatibility::Equal
    };
    let mut found = Vec::new();
    for (name, unit, at) in states.iter().filter(|(name, ..)| !measured(name)) {
        let component = |source: &Source| match source {
            Source::Output { component, .. } => Some(*component),
            Source::Input(_) => None,
        };
        let near = |pair: &&Pair| {
            let own = states.iter().find(|(state, ..)| pair.state.as_ref() == Some(state));
            own.is_some_and(|(_, own, place)| component(place) == component(at) && is_rate(unit, own))
        };
        let mut candidates = outputs.iter().filter(near);
        if let (Some(pair), None) = (candidates.next(), candidates.next()) {
            found.push((name.clone(), pair.column.clone()));
        }
    }
    found
}

fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

/// A key of a table.
fn key(text: &str) -> String {
    let bare = !text.is_empty() && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
    if bare { text.to_owned() } else { quoted(text) }
}

fn unit_part(pair: &Pair) -> String {
    match (&pair.column_unit, &pair.unit) {
        // The header of the file states it.
        (Some(_), _) | (None, None) => String::new(),
        (None, Some(unit)) => format!(", unit = {}", quoted(unit)),
    }
}

/// The file.
fn text(graph: &SystemGraph, system: &str, matched: &Matched, names: &[String]) -> String {
    let mut out = String::new();
    let mut line = |text: &str| {
        let _ = writeln!(out, "{text}");
    };
    line("# What does this system lack? Run: airloop refine FOLDER -o OUT");
    line("# Every key: airloop refine --schema study. Lines that begin with # are suggestions.");
    line(&format!("name = {}", quoted(&graph.name)));
    line(&format!("system = {}", quoted(system)));
    line("");
    line("# Parameters as they are known, in the units of the system; here its own start values.");
    line("[parameters]");
    for (name, value, unit) in parameters(graph).into_iter().take(MAX_PARAMETERS) {
        line(&format!(
            "# {} = {value}{}",
            key(&name),
            unit.map_or(String::new(), |unit| format!("   # [{unit}]"))
        ));
    }
    line("");
    if !graph.inputs.is_empty() {
        line(
            "# Inputs of the system and their columns; an input without keeps its start value. With hold = true a value stays",
        );
        line(
            "# up to the next sample, as that of a computer's command does; without, it goes there on a straight line.",
        );
        line("[inputs]");
        for pair in &matched.inputs {
            let held = if pair.held { ", hold = true" } else { "" };
            line(&format!(
                "{} = {{ column = {}{}{held} }}",
                key(&pair.name),
                quoted(&pair.column),
                unit_part(pair)
            ));
        }
        for input in
            graph.inputs.iter().filter(|input| matched.inputs.iter().all(|pair| pair.name != input.name))
        {
            line(&format!("# {} = {{ column = \"...\" }}", key(&input.name)));
        }
        line("");
    }
    line(
        "# Outputs that are compared. The noise of a sensor is estimated from the scatter of its samples unless it is",
    );
    line(
        "# given: noise = 0.001, in the unit of the column; offset = \"fit\" lets a constant offset of the sensor be fitted.",
    );
    line("[outputs]");
    for pair in &matched.outputs {
        line(&format!("{} = {{ column = {}{} }}", key(&pair.name), quoted(&pair.column), unit_part(pair)));
    }
    for output in
        graph.outputs.iter().filter(|output| matched.outputs.iter().all(|pair| pair.name != output.name))
    {
        line(&format!("# {} = {{ column = \"...\" }}", key(&output.name)));
    }
    line("");
    line("# States that the columns show: where records and windows begin.");
    line("[states]");
    for pair in &matched.outputs {
        if let Some(state) = &pair.state {
            line(&format!("{} = {{ column = {}{} }}", key(state), quoted(&pair.column), unit_part(pair)));
        }
    }
    for (state, column) in &matched.rates {
        let points = DERIVATIVE_POINTS;
        let column = quoted(column);
        line(&format!("{} = {{ derivative_of = {column}, savitzky_golay_points = {points} }}", key(state)));
    }
    line("");
    line("# A parameter that is not known well and may be fitted anew with every candidate:");
    line("# [[free]]");
    line("# parameter = \"...\"");
    line("# min = 0.0");
    line("");
    line(
        "# A system that drifts away (an axis that only a force moves) is compared in windows that begin anew. Effects of",
    );
    line(
        "# sensors (offset, lag, gain) are not tested then, as every window begins at what the sensors show:",
    );
    line("# [error]");
    line("# windows_s = 1.0");
    line("");
    line(
        "# Records: effects are chosen on estimation, and judged on validation. initial = \"fit\" fits the states at the",
    );
    line("# begin of each, \"measured\" takes them from [states].");
    let validation = validation(names);
    for (index, (name, &(from, to))) in names.iter().zip(&matched.spans).enumerate() {
        let mut segment = |role: &str, from: Option<f64>, to: Option<f64>| {
            line("[[segment]]");
            line(&format!("file = {}", quoted(name)));
            line(&format!("role = {}", quoted(role)));
            if let Some(from) = from {
                line(&format!("from_s = {from:?}"));
            }
            if let Some(to) = to {
                line(&format!("to_s = {to:?}"));
            }
            line("initial = \"fit\"");
            line("");
        };
        if names.len() == 1 {
            let cut = from + ESTIMATION_SHARE * (to - from);
            // Two digits are enough for a cut that the user may move.
            let cut = (cut * 100.0).round() / 100.0;
            segment("estimation", None, Some(cut));
            segment("validation", Some(cut), None);
        } else {
            segment(if validation[index] { "validation" } else { "estimation" }, None, None);
        }
    }
    line(
        "# Places where something may be missing. Without any, every real input of the system and of its components is one:",
    );
    line("# airloop refine FOLDER --plan lists them with the effects that are tried.");
    line("# [[attachment]]");
    let port = graph.inputs.iter().find(|input| input.data_type == DataType::Real);
    line(&format!("# input = {}", quoted(port.map_or("...", |input| input.name.as_str()))));
    out
}

/// Tunable parameters with their values and units.
fn parameters(graph: &SystemGraph) -> Vec<(String, String, Option<String>)> {
    let mut found = Vec::new();
    for component in &graph.components {
        for (index, variable) in component.fmu.description.variables.iter().enumerate() {
            let VariableKind::Real(real) = &variable.kind else { continue };
            // Elements of matrices are no values that anybody looks up.
            let looked_up = !variable.name.contains("solver.") && !variable.name.contains('[');
            if variable.causality != Causality::Parameter || !looked_up {
                continue;
            }
            let set = component.start_values.iter().find(|start| start.variable == index);
            let value = set
                .map(|start| start.value.to_string())
                .or_else(|| real.start.map(|value| format!("{value}")));
            let Some(value) = value else { continue };
            // A TOML number needs its decimals.
            let value = if value.contains(['.', 'e']) { value } else { format!("{value}.0") };
            let name = if graph.single { variable.name.clone() } else { component.path_of(index) };
            found.push((name, value, real.unit.clone()));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use airloop_series::Channel;

    use super::{is_stepped, validation};

    fn chosen(names: &[&str]) -> Vec<usize> {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        validation(&names).into_iter().enumerate().filter_map(|(index, own)| own.then_some(index)).collect()
    }

    #[test]
    fn a_column_of_steps_is_a_command_that_is_held() {
        let channel = |values: Vec<f64>| Channel { name: "u".into(), unit: None, values, words: false };
        let steps = (0..200).map(|k| [0.0, 3.0, -1.0, 2.0, 0.5][k / 40]).collect();
        assert!(is_stepped(&channel(steps)));
        let sine = (0..200).map(|k| (0.1 * k as f64).sin());
        assert!(!is_stepped(&channel(sine.clone().collect())));
        // A slow signal in the steps of its resolution.
        assert!(!is_stepped(&channel((0..2000).map(|k| (0.02 * k as f64).floor() * 0.1).collect())));
        assert!(!is_stepped(&channel(vec![1.0; 200])));
    }

    #[test]
    fn records_for_validation_follow_from_their_names() {
        assert_eq!(chosen(&["a_test.csv", "a_1.csv"]), [0]);
        assert_eq!(chosen(&["sine_v.csv", "sine_1.csv", "stairs_v.csv"]), [0, 2]);
        assert_eq!(chosen(&["stairs_1.csv", "stairs_2.csv", "sine_1.csv", "sine_2.csv"]), [1, 3]);
        assert_eq!(chosen(&["swing.csv", "tail.csv"]), [1]);
        assert_eq!(chosen(&["v1.csv", "v2.csv"]), [1]);
    }
}
