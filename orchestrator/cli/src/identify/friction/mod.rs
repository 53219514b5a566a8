//! `airloop identify friction`: eq. 2 from force and motion.

#![allow(
    rustdoc::broken_intra_doc_links,
    reason = "these texts are the help of the program, brackets are units"
)]

mod results;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::ValueEnum;

use crate::output;
use airloop::Error;
use airloop_ident::friction::law::{self, MASS};
use airloop_ident::friction::read::{Columns, sweep};
use airloop_ident::friction::report::identify;
use airloop_ident::friction::{Law, Mass, Predict, Settings, Sweep};
use airloop_series::csv;
use airloop_series::units::{parse_duration, parse_time};

/// `airloop identify friction`
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Exit codes: 0 success, 1 failure, 2 wrong usage.\n\nExamples:\n  airloop identify friction piston_1.csv piston_2.csv --force F_p --velocity v --validate piston_3.csv -o out/piston --fmu piston\n  airloop identify friction cart_1.csv --force F_p --velocity v --mass 0.399 -o out/cart"
)]
pub struct Args {
    /// CSV files of the estimation: first column `time` [s], then a column per signal; steps may be uneven.
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// CSV files that only judge the friction law, and decide whether an alternative is offered.
    #[arg(long, num_args = 1.., value_name = "FILE")]
    pub validate: Vec<PathBuf>,
    /// Column of the force that moves the part against its friction [N].
    #[arg(long, value_name = "COLUMN")]
    pub force: String,
    /// Column of the velocity [m/s]. Without it the velocity comes from the position.
    #[arg(long, value_name = "COLUMN", required_unless_present = "position")]
    pub velocity: Option<String>,
    /// Column of the position [m].
    #[arg(long, value_name = "COLUMN")]
    pub position: Option<String>,
    /// Column of the acceleration [m/s2].
    #[arg(long, value_name = "COLUMN")]
    pub acceleration: Option<String>,
    /// Column of a pressure [Pa]; with --area it adds pressure times area to the force.
    #[arg(long, value_name = "COLUMN")]
    pub pressure: Option<String>,
    /// Area on which the pressure pushes [m2]: force = area pressure + m a + friction.
    #[arg(long, value_name = "M2", requires = "pressure", allow_hyphen_values = true)]
    pub area: Option<f64>,
    /// Moving mass [kg], where the part accelerates. Default: inertia is left out.
    #[arg(long, value_name = "KG", value_parser = parse_mass, allow_hyphen_values = true)]
    pub mass: Option<f64>,
    /// Estimate the moving mass as well.
    #[arg(long, conflicts_with = "mass")]
    pub fit_mass: bool,
    /// Hold a parameter at a value, e.g. c3=0. May be repeated.
    #[arg(long, num_args = 1.., value_name = "NAME=VALUE", value_parser = parse_fixed)]
    pub fix: Vec<(String, f64)>,
    /// Friction law.
    #[arg(long, value_enum, default_value_t = LawChoice::CoulombViscous)]
    pub law: LawChoice,
    /// Predicted quantity: the force from the motion, or the motion from the force, anew in every --window.
    #[arg(long, value_enum, default_value_t = PredictChoice::Force)]
    pub predict: PredictChoice,
    /// Length of the windows of --predict motion.
    #[arg(long, value_name = "TIME", value_parser = parse_duration, default_value = "1s")]
    pub window: f64,
    /// The force is held between its samples (a drive that is commanded in steps); else it runs straight.
    #[arg(long)]
    pub hold: bool,
    /// Compare forces below this frequency [Hz] only (Butterworth of order 4, forwards and backwards).
    #[arg(long, value_name = "HZ")]
    pub low_pass: Option<f64>,
    /// Take a measured velocity as it is: no smoothing, no account of its noise.
    #[arg(long, requires = "velocity")]
    pub no_smoothing: bool,
    /// Leave out what comes before this time.
    #[arg(long, value_name = "TIME", value_parser = parse_time, allow_hyphen_values = true)]
    pub from: Option<f64>,
    /// Leave out what comes after this time.
    #[arg(long, value_name = "TIME", value_parser = parse_time, allow_hyphen_values = true)]
    pub to: Option<f64>,
    /// Do not try what might be added to eq. 2.
    #[arg(long)]
    pub no_alternatives: bool,
    /// Write an FMU of this name with the friction found, as NAME.fmu into the folder of the results.
    #[arg(long, value_name = "NAME")]
    pub fmu: Option<String>,
    /// Folder for the results; it is made if it is not there.
    #[arg(short, long, value_name = "DIR", default_value = "out/friction")]
    pub output: PathBuf,
    /// Draw no figures.
    #[arg(long)]
    pub no_plots: bool,
    /// Print nothing but errors.
    #[arg(short, long)]
    pub quiet: bool,
}

/// `--law`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum LawChoice {
    /// c1 tanh(c2 (v - c3)) + c4 v + c5 (eq. 2).
    CoulombViscous,
    /// With a friction peak at low speed.
    Stribeck,
    /// With Coulomb friction that grows with the pressure.
    Pressure,
    /// With Coulomb friction that varies along the stroke.
    Position,
    /// With a force that varies along the stroke.
    Spring,
    /// With other friction in one direction.
    Asymmetry,
    /// With a hysteretic spring before sliding.
    Presliding,
}

impl From<LawChoice> for Law {
    fn from(choice: LawChoice) -> Law {
        match choice {
            LawChoice::CoulombViscous => Law::CoulombViscous,
            LawChoice::Stribeck => Law::Stribeck,
            LawChoice::Pressure => Law::Pressure,
            LawChoice::Position => Law::PositionCoulomb,
            LawChoice::Spring => Law::Spring,
            LawChoice::Asymmetry => Law::Asymmetry,
            LawChoice::Presliding => Law::Presliding,
        }
    }
}

/// `--predict`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum PredictChoice {
    /// The force.
    Force,
    /// The motion.
    Motion,
}

/// Runs the command.
///
/// # Errors
/// A file, column or setting that cannot be used, or a result that cannot be written.
pub fn run(args: &Args) -> Result<ExitCode, Error> {
    let settings = settings(args)?;
    results::check(args)?;
    let report = identify(&read(&args.files, args)?, &read(&args.validate, args)?, &settings)?;
    let text = results::write(&report, args)?;
    if !args.quiet {
        output::print(&text)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn settings(args: &Args) -> Result<Settings, Error> {
    let law = Law::from(args.law);
    if args.fmu.is_some() && law != Law::CoulombViscous {
        return Err(airloop_ident::friction::Error::NoFmu { law: law.id() }.into());
    }
    let names = law::names(law);
    let mut fixed = Vec::new();
    for (name, value) in &args.fix {
        let place = names.iter().find(|(index, known, _)| known == name && *index != MASS);
        let (index, ..) = place.ok_or_else(|| airloop_ident::friction::Error::Parameter {
            name: name.clone(),
            known: names.iter().filter(|(index, ..)| *index != MASS).map(|(_, name, _)| *name).collect(),
        })?;
        fixed.push((*index, *value));
    }
    Ok(Settings {
        law,
        fixed,
        mass: match args.mass {
            Some(mass) => Mass::Given(mass),
            None if args.fit_mass => Mass::Fit,
            None => Mass::None,
        },
        area: args.area.unwrap_or(0.0),
        predict: match args.predict {
            PredictChoice::Force => Predict::Force,
            PredictChoice::Motion => Predict::Motion { window: args.window, held: args.hold },
        },
        low_pass: args.low_pass,
        smooth: !args.no_smoothing,
        alternatives: !args.no_alternatives,
    })
}

fn read(files: &[PathBuf], args: &Args) -> Result<Vec<Sweep>, Error> {
    let columns = Columns {
        force: args.force.clone(),
        position: args.position.clone(),
        velocity: args.velocity.clone(),
        acceleration: args.acceleration.clone(),
        pressure: args.pressure.clone(),
    };
    let range = (args.from.unwrap_or(f64::NEG_INFINITY), args.to.unwrap_or(f64::INFINITY));
    let one = |path: &PathBuf| Ok(sweep(&csv::read(path)?, &name(path), &columns, range)?);
    files.iter().map(one).collect()
}

fn name(path: &Path) -> String {
    path.display().to_string()
}

fn parse_mass(text: &str) -> Result<f64, String> {
    match text.trim().parse() {
        Ok(mass) if f64::is_finite(mass) && mass > 0.0 => Ok(mass),
        _ => Err("the moving mass is a number of kilograms above zero".into()),
    }
}

fn parse_fixed(text: &str) -> Result<(String, f64), String> {
    let wanted = || "write it like c3=0".to_owned();
    let (name, value) = text.split_once('=').ok_or_else(wanted)?;
    match value.trim().parse() {
        Ok(value) if f64::is_finite(value) => Ok((name.trim().into(), value)),
        _ => Err(wanted()),
    }
}
