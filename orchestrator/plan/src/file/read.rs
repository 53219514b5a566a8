//! From the text of a problem file to a [`Statement`].

use std::path::{Path, PathBuf};

use toml::de::DeTable;

use super::feed_forward;
use super::read_phase;
use super::source::Source;
use super::statement::{
    Animation, Guess, GuessLine, MeshRefinement, Others, Pass, Phase, Settings, Statement, TRANSCRIPTIONS,
    Verification,
};
use super::table::{Table, Text, Value};
use crate::Error;
use airloop_cosim::master::Algorithm;
use airloop_ocp::transcription::Transcription;
use airloop_optim::Method;

/// Guesses that every problem has.
pub const BUILT_IN: [&str; 1] = ["linear"];

/// Reads a problem file.
///
/// # Errors
/// [`Error::Io`], or [`Error::File`] with line, column, value and remedy.
pub fn read(file: &Path) -> Result<Statement, Error> {
    parse(Source::read(file)?)
}

/// The file of a variant that a problem file names.
///
/// # Errors
/// [`Error::Place`] with the names that there are.
pub fn variant(statement: &Statement, name: &str) -> Result<PathBuf, Error> {
    let folder = statement.source.file.parent().unwrap_or(Path::new(""));
    let found = statement.variants.iter().find(|(own, _)| own.text == name);
    found.map(|(_, file)| folder.join(&file.text)).ok_or_else(|| {
        let known: Vec<&str> = statement.variants.iter().map(|(own, _)| own.text.as_str()).collect();
        let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
        let problem = format!("{} has no variant `{name}`; it has: {known}", statement.source.file.display());
        Error::Place { place: "--variant".into(), problem }
    })
}

/// Reads the text of a problem file.
///
/// # Errors
/// Same as [`read`].
pub fn parse(source: Source) -> Result<Statement, Error> {
    let document = DeTable::parse(&source.text).map_err(|error| {
        let end = source.text.len();
        source.error(&error.span().unwrap_or(end..end), error.message())
    })?;
    let root = Table::root(&source, document.get_ref());
    let name = root.maybe("name", |value| value.text())?.map(|text| text.text);
    let system = root.need("system")?.text()?;
    let parameters = root.maybe("parameters", |value| parameters(value, "[parameters]"))?.unwrap_or_default();
    let inputs = root.maybe("inputs", texts)?;
    let states = root.maybe("states", texts)?;
    let settings = root.get("settings");
    let settings = settings.map_or_else(|| Ok(Settings::default()), settings_of)?;
    let phases = phases(&root)?;
    let guesses = root.maybe("guess", guesses)?.unwrap_or_default();
    let verification = root.maybe("verification", verification)?.unwrap_or_default();
    let animation = root.maybe("animation", animation)?;
    let stick_figure = root.maybe("stick_figure", super::stick_figure::read)?;
    let variants = root.maybe("variants", |value| texts_of_pairs(value, "[variants]"))?.unwrap_or_default();
    let feed_forward = root.maybe("feed_forward", feed_forward::read)?;
    root.finish()?;
    let folder = source.file.parent().unwrap_or(Path::new(""));
    let stem = source.file.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    Ok(Statement {
        name: name.or(stem).unwrap_or_default(),
        system_file: folder.join(&system.text),
        system,
        parameters,
        inputs,
        states,
        settings,
        phases,
        guesses,
        verification,
        animation,
        stick_figure,
        variants,
        feed_forward,
        source: source.clone(),
    })
}

/// `[[phase]]`, or the one phase that the keys of the file make.
fn phases(root: &Table) -> Result<Vec<Phase>, Error> {
    let Some(list) = root.get("phase") else { return Ok(vec![read_phase::read(root, "motion", false)?]) };
    let mut phases = Vec::new();
    for (number, value) in list.list()?.into_iter().enumerate() {
        let table = value.table(&format!("[[phase]] number {}", number + 1))?;
        phases.push(read_phase::read(&table, &format!("phase {}", number + 1), true)?);
        table.finish()?;
    }
    if phases.is_empty() {
        return Err(list.error("a problem has at least one phase"));
    }
    Ok(phases)
}

/// A list of texts.
fn texts(value: Value) -> Result<Vec<Text>, Error> {
    value.list()?.iter().map(Value::text).collect()
}

/// `name = "other name"`.
pub fn texts_of_pairs(value: Value, name: &str) -> Result<Vec<(Text, Text)>, Error> {
    value.table(name)?.entries().into_iter().map(|(name, value)| Ok((name, value.text()?))).collect()
}

/// `name = value` with plain values, as text.
pub fn parameters(value: Value, name: &str) -> Result<Vec<(Text, String)>, Error> {
    let one = |(name, value): (Text, Value)| {
        let text = value.text().map(|text| text.text);
        let truth = || value.truth().map(|truth| truth.to_string());
        let number = || value.number().map(|number| number.to_string());
        let text = text.or_else(|_| truth()).or_else(|_: Error| number())?;
        Ok((name, text))
    };
    value.table(name)?.entries().into_iter().map(one).collect()
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            transcription: Transcription::HermiteSimpson,
            intervals: 100,
            before: Vec::new(),
            guess: None,
            method: Method::InteriorPoint,
            tolerance: 1e-8,
            scaled: false,
            max_iterations: 500,
            sampled: None,
            sample_time: None,
            mesh: None,
        }
    }
}

fn settings_of(value: Value) -> Result<Settings, Error> {
    let table = value.table("[settings]")?;
    let default = Settings::default();
    let transcription = table.maybe("transcription", |value| value.choice(&TRANSCRIPTIONS))?;
    let transcription = transcription.unwrap_or(default.transcription);
    let intervals = table.maybe("intervals", |value| value.whole(1))?.unwrap_or(default.intervals);
    let methods = [("interior-point", Method::InteriorPoint), ("sqp", Method::Sqp)];
    let scalings = [("none", false), ("nominal", true)];
    let settings = Settings {
        transcription,
        intervals,
        before: table.maybe("start_with", |value| passes(value, transcription))?.unwrap_or_default(),
        guess: table.maybe("guess", |value| value.text())?,
        method: table.maybe("method", |value| value.choice(&methods))?.unwrap_or(default.method),
        tolerance: table.maybe("tolerance", tolerance)?.unwrap_or(default.tolerance),
        scaled: table.maybe("scaling", |value| value.choice(&scalings))?.unwrap_or(default.scaled),
        max_iterations: table
            .maybe("max_iterations", |value| value.whole(1))?
            .unwrap_or(default.max_iterations),
        sampled: table.maybe("sampled", texts)?,
        sample_time: table.maybe("sample_time", |value| value.quantity())?,
        mesh: table.maybe("mesh", mesh)?,
    };
    table.finish()?;
    Ok(settings)
}

fn tolerance(value: Value) -> Result<f64, Error> {
    let tolerance = value.number()?;
    if tolerance > 0.0 && tolerance < 1.0 {
        return Ok(tolerance);
    }
    Err(value.error(format!("the tolerance is {tolerance}; it must lie between 0 and 1")))
}

fn passes(value: Value, default: Transcription) -> Result<Vec<Pass>, Error> {
    let one = |value: &Value| {
        let table = value.table("an entry of `start_with`")?;
        let transcription = table.maybe("transcription", |value| value.choice(&TRANSCRIPTIONS))?;
        let intervals = table.need("intervals")?.whole(1)?;
        table.finish()?;
        Ok(Pass { transcription: transcription.unwrap_or(default), intervals, place: value.place() })
    };
    value.list()?.iter().map(one).collect()
}

fn mesh(value: Value) -> Result<MeshRefinement, Error> {
    let table = value.table("`mesh`")?;
    let tolerance = tolerance(table.need("tolerance")?)?;
    let rounds = table.maybe("rounds", |value| value.whole(1))?.unwrap_or(5);
    table.finish()?;
    Ok(MeshRefinement { tolerance, rounds })
}

fn guesses(value: Value) -> Result<Vec<Guess>, Error> {
    let mut guesses = Vec::new();
    for (name, value) in value.table("[guess]")?.entries() {
        if BUILT_IN.contains(&name.text.as_str()) {
            let problem = format!("the guess `{}` is built in; choose another name", name.text);
            return Err(value.error(problem));
        }
        guesses.push(guess(name, value)?);
    }
    Ok(guesses)
}

fn guess(name: Text, value: Value) -> Result<Guess, Error> {
    let table = value.table(&format!("[guess.{}]", name.text))?;
    let (mut trajectories, mut others) = (Vec::new(), Others::Zero);
    for (variable, value) in table.entries() {
        if variable.text == "others" {
            others = value.choice(&[("zero", Others::Zero), ("linear", Others::Linear)])?;
        } else {
            trajectories.push(trajectory(variable, value)?);
        }
    }
    Ok(Guess { name, trajectories, others })
}

fn trajectory(variable: Text, value: Value) -> Result<GuessLine, Error> {
    let table = value.table(&format!("the trajectory of `{}`", variable.text))?;
    let numbers = |value: Value| value.list()?.iter().map(Value::number).collect::<Result<Vec<f64>, Error>>();
    let (times, values) = (table.need("t")?, table.need("value")?);
    let (t, value) = (numbers(times)?, numbers(values)?);
    let unit = table.maybe("unit", |value| value.text())?.map(|text| text.text);
    table.finish()?;
    if t.len() != value.len() {
        let problem =
            format!("`t` has {} values and `value` has {}; give as many of each", t.len(), value.len());
        return Err(values.error(problem));
    }
    if t.len() < 2 {
        return Err(times.error("a trajectory needs at least two points"));
    }
    if let Some(at) = (1..t.len()).find(|&k| t[k] <= t[k - 1]) {
        let problem = format!("`t` must increase, but {} does not come after {}", t[at], t[at - 1]);
        return Err(times.error(problem));
    }
    if t[0] < 0.0 || t[t.len() - 1] > 1.0 {
        return Err(times.error("`t` is the part of the whole duration, from 0 to 1"));
    }
    Ok(GuessLine { variable, t, value, unit })
}

impl Default for Verification {
    fn default() -> Verification {
        Verification { run: true, master: Algorithm::Monolithic, step: None, tolerance: None, balance: None }
    }
}

fn verification(value: Value) -> Result<Verification, Error> {
    let table = value.table("[verification]")?;
    let masters =
        [Algorithm::Monolithic, Algorithm::GaussSeidel, Algorithm::Jacobi, Algorithm::InterfaceJacobian];
    let names = masters.map(|master| master.to_string());
    let masters: Vec<(&str, Algorithm)> = names.iter().map(String::as_str).zip(masters).collect();
    let default = Verification::default();
    let verification = Verification {
        run: table.maybe("run", |value| value.truth())?.unwrap_or(default.run),
        master: table.maybe("master", |value| value.choice(&masters))?.unwrap_or(default.master),
        step: table.maybe("step", |value| value.quantity())?,
        tolerance: table.maybe("tolerance", tolerance)?,
        balance: table.maybe("balance", super::balance::read)?,
    };
    table.finish()?;
    Ok(verification)
}

fn animation(value: Value) -> Result<Animation, Error> {
    let table = value.table("[animation]")?;
    let animation = Animation {
        cart: table.need("cart")?.text()?,
        angle: table.need("angle")?.text()?,
        length: table.need("length")?.number()?,
    };
    table.finish()?;
    Ok(animation)
}
