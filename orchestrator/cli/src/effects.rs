//! `airloop effects`: effects of the program and of one's own, listed, checked, explained and drawn.

#![allow(
    rustdoc::broken_intra_doc_links,
    reason = "these texts are the help of the program, brackets are units"
)]

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Subcommand};

use super::{output, table};
use airloop::Error;
use airloop_refine::vocabulary::builtin::{BUILTIN, Builtin};
use airloop_refine::vocabulary::folder::Folder;
use airloop_refine::vocabulary::own::{Law, Own, Parameter, VARIABLES};
use airloop_report::plot::formula;
use airloop_series::file::{make_folder_of, write_whole};
use airloop_series::names;

/// Points of a figure.
const POINTS: usize = 301;

/// Actions on effects.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// List the effects that a search looks for: those of the program, and those of a folder.
    ///
    /// The formula is taken off the force, torque, flow or voltage at the port; at a signal, command or sensor it
    /// replaces f. One without a formula is computed by the program alone.
    #[command(after_help = "Example: airloop effects list effects/")]
    List {
        /// Folder with effects as .toml files, or one such file.
        path: Option<PathBuf>,
    },
    /// Check effects: keys, names, formulas, units, bounds, starts.
    ///
    /// An effect is a TOML file:
    ///
    /// kind = "bristle"              (its name)
    ///
    /// port = "force"                (force, torque, flow, voltage: formula taken off; signal, sensor: it replaces f)
    ///
    /// formula = "k*z"               (over x, v, f (the value that passes), t, states, parameters)
    ///
    /// words = "elastic bristles"    (for reports)
    ///
    /// [states]  z = "v - abs(v)*z/d"                          (name = rate; starts at 0)
    ///
    /// [parameters.k]  unit = "N/m", bounds = [0, 1e6], start = [100, 1000]
    ///
    /// [signs]  dissipative = true   (of a force or torque: over the records it has to take energy)
    ///
    /// [variables]  f = "Pa"         (units of x, v, f where they are not those of the port)
    ///
    /// Operators + - * / ^; functions sin cos tan tanh exp ln sqrt abs sign floor min max clamp, and curve(x, x1, y1,
    /// x2, y2, ...) through points; a number with a unit is a parameter. `start` may be left out where the formula is
    /// proportional to the parameter. At most 3 states and 12 parameters. A sensor shows an output as f; it has t, but
    /// no x and v.
    ///
    /// In place of the formula an FMU for Model Exchange may give the value; units, ranges and starts of parameters
    /// that the file leaves out are those of the FMU, which may have 8 states:
    ///
    /// fmu = "bristle.fmu"           (beside the file)
    ///
    /// output = "force"              (its output)
    ///
    /// inputs = { v = "speed" }      (its inputs that get x, v, f)
    ///
    /// [parameters]  stiffness = {}
    #[command(
        after_help = "Exit codes: 0 all are effects, 1 some are not.\n\nExample: airloop effects check effects/"
    )]
    Check {
        /// Folder with effects as .toml files, or one such file.
        path: PathBuf,
    },
    /// Explain an effect, of the program or of a file, and draw it.
    #[command(
        after_help = "Examples:\n  airloop effects show stribeck --figure stribeck.svg\n  airloop effects show effects/bristle.toml\n  airloop effects show coulomb --toml > effects/own.toml"
    )]
    Show(Show),
}

/// `airloop effects show`
#[derive(Debug, Args)]
pub struct Show {
    /// Kind of the program's list, file of an effect, or a folder with several.
    #[arg(value_name = "KIND|PATH")]
    pub path: PathBuf,
    /// Name of the effect, where the folder has several.
    pub kind: Option<String>,
    /// SVG file for a figure of the formula at the first start of each parameter (1 where the formula is proportional
    /// to it). An effect with states is drawn along a sine of the position, or of f where the formula replaces it, that
    /// lasts 1 s.
    #[arg(long, value_name = "FILE")]
    pub figure: Option<PathBuf>,
    /// Variable that the figure is over: x, v, f or t [default: the first that the formula uses].
    #[arg(long, value_name = "NAME")]
    pub over: Option<String>,
    /// Largest magnitude of that variable in the figure; of the position for an effect with states.
    #[arg(long, value_name = "NUMBER", default_value_t = 0.1)]
    pub range: f64,
    /// Print the effect as a TOML file, to begin one of your own from.
    #[arg(long)]
    pub toml: bool,
}

/// Runs the command.
///
/// # Errors
/// A folder or file that cannot be read, a figure that cannot be written.
pub fn run(command: &Command) -> Result<ExitCode, Error> {
    match command {
        Command::List { path } => list(path.as_ref()),
        Command::Check { path } => check(path),
        Command::Show(args) => show(args),
    }
}

fn list(path: Option<&PathBuf>) -> Result<ExitCode, Error> {
    let folder = path.map(|path| Folder::read(path)).transpose()?.unwrap_or_default();
    let own = folder.effects.iter().map(|(_, own)| row(&own.kind, own.port.word(), Some(own), &own.words));
    let builtin = BUILTIN.iter().map(|own| row(own.kind, own.ports, own.own().as_ref(), own.words));
    let rows: Vec<Vec<String>> = own.chain(builtin).collect();
    output::print(
        &(table::table(&["kind", "port", "formula", "states (rates)", "what"], &rows, &[]) + "\n"),
    )?;
    Ok(told(&folder))
}

/// Kind, ports, formula, states, words.
fn row(kind: &str, ports: &str, own: Option<&Own>, words: &str) -> Vec<String> {
    let state = |(name, rate): &(String, String)| match own.map(|own| &own.law) {
        Some(Law::Fmu(_)) => name.clone(),
        _ => format!("{name} = {rate}"),
    };
    let formula = own.map_or_else(String::new, |own| own.formula.clone());
    let states: Vec<String> = own.map_or_else(Vec::new, |own| own.states.iter().map(state).collect());
    vec![kind.into(), ports.into(), formula, states.join("; "), words.into()]
}

/// Says what is no effect; the exit code.
fn told(folder: &Folder) -> ExitCode {
    folder.problems().iter().for_each(|problem| output::to_stderr(&format!("error: {problem}")));
    if folder.refused.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn check(path: &Path) -> Result<ExitCode, Error> {
    let folder = Folder::read(path)?;
    for (file, own) in &folder.effects {
        let (states, parameters) =
            (names::counted(own.states.len(), "state"), names::counted(own.parameters.len(), "parameter"));
        output::print(&format!(
            "{}: {} at a {} port, {states}, {parameters}\n",
            file.display(),
            own.kind,
            own.port.word()
        ))?;
    }
    Ok(told(&folder))
}

fn show(args: &Show) -> Result<ExitCode, Error> {
    let builtin = BUILTIN.iter().find(|own| Path::new(own.kind) == args.path && !args.path.exists());
    if let Some(builtin) = builtin {
        return match (builtin.own(), builtin.toml) {
            (Some(own), Some(toml)) if args.toml => {
                output::print(&toml.replace(&format!("{:?}", own.kind), &format!("\"own_{}\"", own.kind)))?;
                Ok(ExitCode::SUCCESS)
            }
            (Some(own), _) => shown(&own, args),
            _ => without_formula(builtin, args),
        };
    }
    if !args.path.exists() {
        let problem = neither(&args.path);
        return Err(airloop_refine::Error::Case { path: args.path.clone(), problem }.into());
    }
    let folder = Folder::read(&args.path)?;
    let found =
        folder.effects.iter().find(|(_, own)| args.kind.as_ref().is_none_or(|kind| *kind == own.kind));
    let Some((_, own)) = found else {
        // What is no effect is the reason where a file was meant, and may be where a name is not found.
        told(&folder);
        if args.kind.is_some() || folder.refused.is_empty() {
            output::to_stderr(&format!("error: {}: {}", args.path.display(), not_there(&folder, args)));
        }
        return Ok(ExitCode::FAILURE);
    };
    if args.toml {
        let starts: Vec<f64> = own.parameters.iter().map(start).collect();
        output::print(&own.to_toml(&starts))?;
        return Ok(ExitCode::SUCCESS);
    }
    shown(own, args)
}

/// Says which effect a folder does not have, and which it has.
fn not_there(folder: &Folder, args: &Show) -> String {
    let known = names::suggestion(
        args.kind.as_deref().unwrap_or_default(),
        folder.effects.iter().map(|(_, own)| own.kind.as_str()),
    );
    match &args.kind {
        Some(kind) => format!("there is no effect `{kind}`; {known}"),
        None => "there is no effect".into(),
    }
}

/// Says that a path is neither a file nor a kind; the names of effects in reports of `refine` have their place in
/// front of the kind (`cart.spring`) or behind it (`spring@cart.f`).
fn neither(path: &Path) -> String {
    let name = path.to_string_lossy();
    let known = || BUILTIN.iter().map(|own| own.kind);
    let is_meant = |kind: &&str| name.ends_with(&format!(".{kind}")) || name.starts_with(&format!("{kind}@"));
    let meant = known().filter(is_meant).max_by_key(|kind| kind.len());
    let meant =
        meant.map_or_else(|| names::suggestion(&name, known()), |kind| format!("did you mean `{kind}`?"));
    format!("there is no such file or folder, and no effect of the program of that name; {meant}")
}

/// Prints an effect and draws its figure.
fn shown(own: &Own, args: &Show) -> Result<ExitCode, Error> {
    output::print(&explained(own))?;
    if let Some(file) = &args.figure {
        super::folder::check_file(file, &[])?;
        let (points, labels) = match drawn(own, args.over.as_deref(), args.range) {
            Ok(found) => found,
            Err(problem) => {
                output::to_stderr(&format!("error: {problem}"));
                return Ok(ExitCode::from(super::USAGE));
            }
        };
        let svg = formula::curve(&points, &title(own), (&labels[0], &labels[1]));
        let written =
            make_folder_of(file).and_then(|()| write_whole(file, |out| out.write_all(svg.as_bytes())));
        written.map_err(|source| airloop_refine::Error::Case {
            path: file.clone(),
            problem: format!("the figure cannot be written: {source}"),
        })?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Says what an effect does that no formula can say.
fn without_formula(builtin: &Builtin, args: &Show) -> Result<ExitCode, Error> {
    output::print(&format!("{}  {}\nport  {}\n", builtin.kind, builtin.words, builtin.ports))?;
    if args.figure.is_none() && !args.toml {
        return Ok(ExitCode::SUCCESS);
    }
    output::to_stderr(&format!(
        "error: `{}` is no formula over x, v, f, t and states; it has no figure and no file",
        builtin.kind
    ));
    Ok(ExitCode::from(super::USAGE))
}

/// Title of a figure.
pub(crate) fn title(own: &Own) -> String {
    format!("{} = {}", own.kind, own.formula)
}

/// Value of a parameter in figures.
fn start(parameter: &Parameter) -> f64 {
    parameter.starts.first().copied().unwrap_or(1.0)
}

/// An effect in words.
fn explained(own: &Own) -> String {
    let effect = if own.port.replaces() { "the value becomes" } else { "taken off" };
    let mut text = format!("{}  {}\n{effect}  {} [{}]\n", own.kind, own.words, own.formula, own.units[2]);
    for (name, rate) in &own.states {
        text += &match own.law {
            Law::Formula { .. } => format!("state  d{name}/dt = {rate}, 0 at the start\n"),
            Law::Fmu(_) => format!("state  {name} of the FMU\n"),
        };
    }
    let rows: Vec<Vec<String>> = own
        .parameters
        .iter()
        .map(|p| {
            let starts: Vec<String> = p.starts.iter().map(f64::to_string).collect();
            let starts = if p.linear { "linear step".into() } else { starts.join(", ") };
            vec![p.name.clone(), p.unit.clone(), p.bounds.0.to_string(), p.bounds.1.to_string(), starts]
        })
        .collect();
    text += &table::table(&["parameter", "unit", "from", "to", "starts"], &rows, &[2, 3]);
    if own.dissipative {
        text += "\nIt takes energy: over the records, the effect times v is not negative on average.";
    }
    text + "\n"
}

/// Points of a figure and the labels of its axes.
pub(crate) type Drawn = (Vec<(f64, f64)>, [String; 2]);

/// The curve of an effect over a variable (the first that it uses, where none is named) from `-range` to `range`, of
/// time from 0, beside a value and, over the position, a velocity of `range`; with states along a sine of the position
/// that lasts 1 s, of the value itself where the effect replaces it.
///
/// # Errors
/// A range that is not above zero, a variable that is none.
pub(crate) fn drawn(own: &Own, over: Option<&str>, range: f64) -> Result<Drawn, String> {
    const X: usize = 0;
    const V: usize = 1;
    const F: usize = 2;
    const T: usize = 3;
    if !(range > 0.0 && range.is_finite()) {
        return Err(format!("--range {range} must be above zero"));
    }
    let used = (0..VARIABLES.len()).find(|&place| own.uses(place));
    let memory = !own.states.is_empty();
    let over = match over {
        _ if memory && own.port.replaces() => F,
        _ if memory => X,
        None => used.unwrap_or(X),
        Some(name) => VARIABLES
            .iter()
            .position(|own| *own == name)
            .ok_or_else(|| format!("--over {name}: known are {}", VARIABLES.join(", ")))?,
    };
    let p: Vec<f64> = own.parameters.iter().map(start).collect();
    let mut z = vec![0.0; own.states.len()];
    let mut points = Vec::with_capacity(POINTS);
    for k in 0..POINTS {
        let part = k as f64 / (POINTS - 1) as f64;
        let (sine, cosine) = (std::f64::consts::TAU * part).sin_cos();
        let mut at = [0.0; 4];
        at[F] = if own.port.replaces() { range } else { 0.0 };
        at[V] = if over == X { range } else { 0.0 };
        match (memory, over) {
            (true, F) => (at[F], at[T]) = (range * sine, part),
            (true, _) => (at[X], at[V], at[T]) = (range * sine, std::f64::consts::TAU * range * cosine, part),
            (false, T) => at[T] = range * part,
            (false, _) => at[over] = range * (2.0 * part - 1.0),
        }
        points.push((at[over], own.value(at, &z, &p)));
        own.advance(at, &mut z, &p, 1.0 / (POINTS - 1) as f64);
    }
    points.retain(|(_, value)| value.is_finite());
    let unit = own.units.get(over).map_or("s", String::as_str);
    Ok((points, [format!("{} [{unit}]", VARIABLES[over]), format!("{} [{}]", own.kind, own.units[2])]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_reports_lead_to_the_kind() {
        for name in ["cart.spring", "spring@cart.f", "spirng"] {
            assert!(
                neither(Path::new(name)).contains("did you mean `spring`"),
                "{}",
                neither(Path::new(name))
            );
        }
        assert!(neither(Path::new("arm.sensor.lag")).contains("`sensor.lag`"));
    }
}
