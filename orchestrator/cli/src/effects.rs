//! `airloop effects`: effects of one's own, read, checked and explained.

#![allow(
    rustdoc::broken_intra_doc_links,
    reason = "these texts are the help of the program, brackets are units"
)]

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Subcommand};

use super::{output, table};
use airloop::Error;
use airloop_refine::vocabulary::builtin::BUILTIN;
use airloop_refine::vocabulary::folder::Folder;
use airloop_refine::vocabulary::own::{Own, VARIABLES};
use airloop_report::plot::formula;

/// Points of a figure.
const POINTS: usize = 601;

/// Actions on effects.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// List the effects that a formula can say: those of the program, and those of a folder.
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
    /// port = "force"                (force, torque or flow: the formula is taken off; signal: the formula replaces f)
    ///
    /// formula = "k*z"               (over x, v, f (the value that passes), t, states, parameters)
    ///
    /// words = "elastic bristles"    (for reports)
    ///
    /// [states]  z = "v - abs(v)*z/d"                          (name = rate; starts at 0)
    ///
    /// [parameters.k]  unit = "N/m", bounds = [0, 1e6], start = [100, 1000]
    ///
    /// [signs]  dissipative = true   (takes energy)
    ///
    /// [variables]  f = "Pa"         (units of x, v, f where they are not those of the port)
    ///
    /// Operators + - * / ^; functions sin cos tan tanh exp ln sqrt abs sign min max clamp, and curve(x, x1, y1, x2, y2,
    /// ...) through points; a number with a unit is a parameter. `start` may be left out where the formula is
    /// proportional to the parameter. At most 3 states and 12 parameters.
    #[command(
        after_help = "Exit codes: 0 all are effects, 1 some are not.\n\nExample: airloop effects check effects/"
    )]
    Check {
        /// Folder with effects as .toml files, or one such file.
        path: PathBuf,
    },
    /// Explain an effect and draw it.
    #[command(after_help = "Example: airloop effects show effects/bristle.toml --figure bristle.svg")]
    Show(Show),
}

/// `airloop effects show`
#[derive(Debug, Args)]
pub struct Show {
    /// File of an effect, or a folder with several.
    pub path: PathBuf,
    /// Name of the effect, where the folder has several.
    pub kind: Option<String>,
    /// SVG file for a figure of the formula at the first start of each parameter (1 where the formula is proportional to
    /// it). An effect with states is drawn along a sine of the position that lasts 1 s.
    #[arg(long, value_name = "FILE")]
    pub figure: Option<PathBuf>,
    /// Variable that the figure is over: x, v, f or t [default: the first that the formula uses].
    #[arg(long, value_name = "NAME")]
    pub over: Option<String>,
    /// Largest magnitude of that variable in the figure; of the position for an effect with states.
    #[arg(long, value_name = "NUMBER", default_value_t = 0.1)]
    pub range: f64,
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
    let own = folder.effects.iter().map(|(_, own)| {
        let states: Vec<String> = own.states.iter().map(|(name, rate)| format!("{name} = {rate}")).collect();
        vec![
            own.kind.clone(),
            own.port.word().into(),
            own.formula.clone(),
            states.join("; "),
            own.words.clone(),
        ]
    });
    let builtin = BUILTIN
        .iter()
        .map(|own| [own.kind, own.port, own.formula, own.states, own.words].map(str::to_owned).to_vec());
    let rows: Vec<Vec<String>> = own.chain(builtin).collect();
    output::print(
        &(table::table(&["kind", "port", "formula", "states (rates)", "what"], &rows, &[]) + "\n"),
    )?;
    Ok(told(&folder))
}

/// Says what is no effect; the exit code.
fn told(folder: &Folder) -> ExitCode {
    folder.problems().iter().for_each(|problem| output::complain(&format!("error: {problem}")));
    if folder.refused.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn check(path: &Path) -> Result<ExitCode, Error> {
    let folder = Folder::read(path)?;
    for (file, own) in &folder.effects {
        let (states, parameters) = (own.states.len(), own.parameters.len());
        output::print(&format!(
            "{}: {} at a {} port, {states} states, {parameters} parameters\n",
            file.display(),
            own.kind,
            own.port.word()
        ))?;
    }
    Ok(told(&folder))
}

fn show(args: &Show) -> Result<ExitCode, Error> {
    let folder = Folder::read(&args.path)?;
    let found =
        folder.effects.iter().find(|(_, own)| args.kind.as_ref().is_none_or(|kind| *kind == own.kind));
    let Some((_, own)) = found else {
        let known: Vec<&str> = folder.effects.iter().map(|(_, own)| own.kind.as_str()).collect();
        let wanted = args.kind.as_deref().unwrap_or("any");
        output::complain(&format!(
            "error: {}: there is no effect `{wanted}`; known are: {}",
            args.path.display(),
            known.join(", ")
        ));
        told(&folder);
        return Ok(ExitCode::FAILURE);
    };
    output::print(&explained(own))?;
    if let Some(file) = &args.figure {
        let (points, labels) = match drawn(own, args) {
            Ok(found) => found,
            Err(problem) => {
                output::complain(&format!("error: {problem}"));
                return Ok(ExitCode::from(super::USAGE));
            }
        };
        let title = format!("{} = {}", own.kind, own.formula);
        let svg = formula::curve(&points, &title, (&labels[0], &labels[1]));
        std::fs::write(file, svg).map_err(|source| airloop_refine::Error::Case {
            path: file.clone(),
            problem: format!("the figure cannot be written: {source}"),
        })?;
    }
    Ok(ExitCode::SUCCESS)
}

/// An effect in words.
fn explained(own: &Own) -> String {
    let effect = if own.port.replaces() { "the value becomes" } else { "taken off" };
    let mut text = format!("{}  {}\n{effect}  {} [{}]\n", own.kind, own.words, own.formula, own.units[2]);
    for (name, rate) in &own.states {
        text += &format!("state  d{name}/dt = {rate}, 0 at the start\n");
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
        text += "\nIt takes energy: formula times v is not negative on average.";
    }
    text + "\n"
}

/// Points of a figure and the labels of its axes.
type Drawn = (Vec<(f64, f64)>, [String; 2]);

fn drawn(own: &Own, args: &Show) -> Result<Drawn, String> {
    if !(args.range > 0.0 && args.range.is_finite()) {
        return Err(format!("--range {} must be above zero", args.range));
    }
    let used = (0..VARIABLES.len()).find(|&place| own.expression.uses(place));
    let over = match &args.over {
        None => used.unwrap_or(0),
        Some(name) => VARIABLES
            .iter()
            .position(|own| own == name)
            .ok_or_else(|| format!("--over {name}: known are {}", VARIABLES.join(", ")))?,
    };
    let p: Vec<f64> = own.parameters.iter().map(|p| p.starts.first().copied().unwrap_or(1.0)).collect();
    let memory = !own.states.is_empty();
    let mut z = vec![0.0; own.states.len()];
    let mut points = Vec::with_capacity(POINTS);
    for k in 0..POINTS {
        let part = k as f64 / (POINTS - 1) as f64;
        let mut at = [0.0; 4];
        if memory {
            let phase = std::f64::consts::TAU * part;
            at = [args.range * phase.sin(), std::f64::consts::TAU * args.range * phase.cos(), 0.0, part];
        } else {
            at[over] = if over == 3 { args.range * part } else { args.range * (2.0 * part - 1.0) };
        }
        points.push((at[if memory { 0 } else { over }], own.value(at, &z, &p)));
        own.advance(at, &mut z, &p, 1.0 / (POINTS - 1) as f64);
    }
    points.retain(|(_, value)| value.is_finite());
    let over = if memory { 0 } else { over };
    let unit = own.units.get(over).map_or("s", String::as_str);
    Ok((points, [format!("{} [{unit}]", VARIABLES[over]), format!("{} [{}]", own.kind, own.units[2])]))
}
