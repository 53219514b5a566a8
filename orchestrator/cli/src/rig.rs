//! `airloop rig`: records of a virtual rig.

#![allow(
    rustdoc::broken_intra_doc_links,
    reason = "these texts are the help of the program, brackets are units"
)]

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args as Arguments, Subcommand, ValueEnum};

use super::args::parse_assignment;
use super::excite::parse_band;
use super::{folder, output};
use airloop::Error;
use airloop::rig::sensor::{self, Sensor};
use airloop::rig::{Recording, case, coupled, rod_fixed, sweep};
use airloop_fmi::template_folder;
use airloop_ident::excite::Band;
use airloop_series::csv;
use airloop_series::units::parse_duration;

/// `airloop rig ...`
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Record an experiment: simulated by FMUs, with the noise and the steps of sensors.
    ///
    /// Writes CSV files at the sample rate (time, command, sensors) and case.toml with what an experimenter knows:
    /// sensors and their noise, and the role of each file. The same options give the same files.
    Record(Box<RecordArgs>),
}

/// `airloop rig record`
#[derive(Debug, Arguments)]
#[command(
    after_help = "Exit codes: 0 success, 1 failure, 2 wrong usage.\n\nExamples:\n  airloop rig record --plan rod-fixed -o out/rod\n  airloop rig record --plan friction-sweep -o out/sweep\n  airloop rig record --plan coupled --system examples/01_run/system.ssd --vary cart_pole.x=0.005 -o out/coupled"
)]
pub struct RecordArgs {
    /// Experiment.
    #[arg(long, value_enum)]
    pub plan: PlanChoice,
    /// FMU or system. Default: pneumatic-cylinder for rod-fixed, friction for friction-sweep (as for `airloop derive`).
    #[arg(long, value_name = "FILE", required_if_eq("plan", "coupled"))]
    pub system: Option<PathBuf>,
    /// Start value of the FMU or system. May be repeated.
    #[arg(long, value_name = "NAME=VALUE", value_parser = parse_assignment)]
    pub set: Vec<(String, String)>,
    /// Amplitudes: of the chirps [N] for rod-fixed (default 10,20,40; the stairs have the largest), of the velocity
    /// [m/s] for friction-sweep (default 0.3,0.12,0.2; the last is for validation), of the command for coupled (one,
    /// default 25).
    #[arg(long, value_delimiter = ',', value_name = "NUMBER,...")]
    pub amplitude: Option<Vec<f64>>,
    /// Band of the command. Default: 0.1..12Hz (rod-fixed), 0.4..1.5Hz (friction-sweep), 0.5..4Hz (coupled).
    #[arg(long, value_parser = parse_band, value_name = "FROM..TO")]
    pub band: Option<Band>,
    /// Length of each record. Default: 20s, or 4s for coupled.
    #[arg(long, value_parser = parse_duration, value_name = "TIME")]
    pub duration: Option<f64>,
    /// Sample time.
    #[arg(long, value_parser = parse_duration, value_name = "TIME", default_value = "1ms")]
    pub step: f64,
    /// Noise of a sensor (rms, in its unit), e.g. F_p=0.3. May be repeated. Usual: F_hat, F_p 0.3 N, x 0.1 mm, v 1
    /// mm/s.
    #[arg(long, value_name = "SIGNAL=RMS", value_parser = parse_number)]
    pub noise: Vec<(String, f64)>,
    /// Step of the values of a sensor, 0 for none. May be repeated. Usual: F 0.01 N, x 0.01 mm, v 0.1 mm/s, theta 2
    /// pi/4096, u 0.001 N.
    #[arg(long, value_name = "SIGNAL=STEP", value_parser = parse_number)]
    pub quantize: Vec<(String, f64)>,
    /// Mass that the load cell moves with the cart in friction-sweep [kg].
    /// Default: 0.399.
    #[arg(long, value_name = "KG")]
    pub mass: Option<f64>,
    /// Start value that varies from trial to trial within plus and minus this spread (coupled). May be repeated.
    #[arg(long, value_name = "NAME=SPREAD", value_parser = parse_number)]
    pub vary: Vec<(String, f64)>,
    /// Middle of the command (coupled).
    /// Default: 0.
    #[arg(long, value_name = "NUMBER", allow_hyphen_values = true)]
    pub offset: Option<f64>,
    /// Command per meter that pulls x back to the middle (coupled).
    /// Default: 60.
    #[arg(long, value_name = "NUMBER")]
    pub centering: Option<f64>,
    /// Seed of commands and noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Folder for the records; it is made if it is not there.
    #[arg(short, long, value_name = "DIR", default_value = "out/rig")]
    pub output: PathBuf,
    /// Print nothing but errors.
    #[arg(short, long)]
    pub quiet: bool,
}

/// `--plan`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum PlanChoice {
    /// The actuator with its rod held: chirps and random stairs; others for validation.
    RodFixed,
    /// Piston and cart moved at an imposed velocity, each with the friction of the paper (eq. 10 and 11); with
    /// --system, the friction of that FMU alone.
    FrictionSweep,
    /// A whole system under a command with weak centering.
    Coupled,
}

/// Friction of the cart (paper eq. 11), as start values of the FMU.
const CART: [(&str, &str); 5] =
    [("c1", "5.7910"), ("c2", "63.7045"), ("c3", "0.0064"), ("c4", "0"), ("c5", "-2.3170")];

/// Runs one of the commands.
///
/// # Errors
/// Fails if the records cannot be made or written.
pub fn run(command: &Command) -> Result<ExitCode, Error> {
    match command {
        Command::Record(args) => record(args),
    }
}

fn record(args: &RecordArgs) -> Result<ExitCode, Error> {
    check_options(args)?;
    let (source, kind, recordings) = recordings(args)?;
    let sensors = sensors(args);
    sensor::check(&recordings, &sensors)?;
    let names: Vec<String> = recordings.iter().map(|recording| recording.name.clone()).collect();
    let names = [names, vec!["case.toml".to_owned()]].concat();
    let results = folder::Results::open_where(&args.output, std::slice::from_ref(&source), &names, earlier)?;
    let mut text = String::new();
    for recording in &recordings {
        let path = results.path().join(&recording.name);
        let measured = sensor::measure(recording, &sensors, args.seed)?;
        csv::write(&measured, &path)?;
        let role = if recording.estimation { "estimation" } else { "validation" };
        let columns: Vec<&str> = measured.channels().iter().map(|channel| channel.name.as_str()).collect();
        text += &format!(
            "{}: {} samples of {}, {role}\n",
            args.output.join(&recording.name).display(),
            measured.len(),
            columns.join(", ")
        );
    }
    let id = args.output.file_name().map_or("rig".into(), |name| name.to_string_lossy().into_owned());
    let source = source.file_name().map_or("".into(), |name| name.to_string_lossy().into_owned());
    let case = case::text(&id, kind, &source, args.seed, args.step, &sensors, &recordings);
    let path = results.path().join("case.toml");
    airloop_series::file::write_whole(&path, |out| std::io::Write::write_all(out, case.as_bytes()))
        .map_err(|source| csv::Error::Io { path: path.clone(), source })?;
    results.commit()?;
    if !args.quiet {
        output::print(&format!("{text}{}\n", args.output.join("case.toml").display()))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Refuses options that the plan does not use.
fn check_options(args: &RecordArgs) -> Result<(), Error> {
    let coupled = args.plan == PlanChoice::Coupled;
    let cart = args.plan == PlanChoice::FrictionSweep && args.system.is_none() && args.set.is_empty();
    let several = args.amplitude.as_ref().is_some_and(|all| all.len() > 1);
    let unused = [
        ("--mass", args.mass.is_some() && !cart, "friction-sweep without --system and --set"),
        ("--vary", !args.vary.is_empty() && !coupled, "coupled"),
        ("--offset", args.offset.is_some() && !coupled, "coupled"),
        ("--centering", args.centering.is_some() && !coupled, "coupled"),
        ("--amplitude with several values", several && coupled, "rod-fixed or friction-sweep"),
    ];
    match unused.into_iter().find(|(_, unused, _)| *unused) {
        Some((option, _, plan)) => Err(airloop::rig::Error::Unused { option, plan }.into()),
        None => Ok(()),
    }
}

/// Files of an earlier record of a virtual rig in the folder.
fn earlier(folder: &Path) -> BTreeSet<String> {
    let text = std::fs::read_to_string(folder.join("case.toml")).unwrap_or_default();
    let case: toml::Table = toml::from_str(&text).unwrap_or_default();
    if !case.contains_key("virtual_rig") {
        return BTreeSet::new();
    }
    let files = case.get("files").and_then(toml::Value::as_array).into_iter().flatten();
    let named = files.filter_map(|file| file.get("name").and_then(toml::Value::as_str));
    named.chain(["case.toml"]).map(str::to_owned).collect()
}

/// File that was simulated, kind of case, records without noise.
fn recordings(args: &RecordArgs) -> Result<(PathBuf, &'static str, Vec<Recording>), Error> {
    let file = |usual: &str| -> Result<PathBuf, Error> {
        match &args.system {
            Some(file) => Ok(file.clone()),
            None => Ok(template_folder::template(usual, None)?),
        }
    };
    match args.plan {
        PlanChoice::RodFixed => {
            let mut plan = rod_fixed::Plan { sample_time: args.step, seed: args.seed, ..Default::default() };
            if let Some(amplitudes) = &args.amplitude {
                plan.stairs = amplitudes.iter().copied().fold(0.0, f64::max);
                plan.chirps.clone_from(amplitudes);
            }
            plan.band = args.band.clone().unwrap_or(plan.band);
            plan.duration = args.duration.unwrap_or(plan.duration);
            let file = file("pneumatic-cylinder")?;
            let recordings = rod_fixed::record(&file, &plan, &args.set)?;
            Ok((file, "actuator", recordings))
        }
        PlanChoice::FrictionSweep => {
            let mut plan = sweep::Plan { sample_time: args.step, ..Default::default() };
            plan.amplitudes = args.amplitude.clone().unwrap_or(plan.amplitudes);
            plan.band = args.band.clone().unwrap_or(plan.band);
            plan.duration = args.duration.unwrap_or(plan.duration);
            let file = file("friction")?;
            let part = |name, experiment, set, mass| sweep::Part { name, experiment, set, mass };
            let mut recordings =
                sweep::record(&file, &part("piston", "sweep_piston", args.set.clone(), 0.0), &plan)?;
            if args.system.is_none() && args.set.is_empty() {
                let cart = CART.iter().map(|(name, value)| ((*name).into(), (*value).into())).collect();
                recordings.extend(sweep::record(
                    &file,
                    &part("cart", "sweep_cart", cart, args.mass.unwrap_or(0.399)),
                    &plan,
                )?);
            }
            Ok((file, "friction", recordings))
        }
        PlanChoice::Coupled => {
            let mut plan = coupled::Plan {
                sample_time: args.step,
                seed: args.seed,
                vary: args.vary.clone(),
                offset: args.offset.unwrap_or(0.0),
                centering: args.centering.unwrap_or(60.0),
                ..Default::default()
            };
            plan.amplitude =
                args.amplitude.as_ref().and_then(|a| a.first().copied()).unwrap_or(plan.amplitude);
            plan.band = args.band.clone().unwrap_or(plan.band);
            plan.duration = args.duration.unwrap_or(plan.duration);
            let file = args.system.clone().unwrap_or_else(|| Path::new("system.ssd").into());
            let recordings = coupled::record(&file, &plan, &args.set)?;
            Ok((file, "cartpole", recordings))
        }
    }
}

/// Sensors that differ from the usual ones.
fn sensors(args: &RecordArgs) -> Vec<Sensor> {
    let mut sensors: Vec<Sensor> = Vec::new();
    let mut change = |name: &String, apply: &dyn Fn(&mut Sensor)| {
        if let Some(sensor) = sensors.iter_mut().find(|sensor| sensor.signal == *name) {
            return apply(sensor);
        }
        let mut sensor = sensor::usual(name);
        apply(&mut sensor);
        sensors.push(sensor);
    };
    for (name, noise) in &args.noise {
        change(name, &|sensor| sensor.noise = *noise);
    }
    for (name, step) in &args.quantize {
        change(name, &|sensor| sensor.step = *step);
    }
    sensors
}

fn parse_number(text: &str) -> Result<(String, f64), String> {
    let wanted = || "write SIGNAL=NUMBER, the number not negative".to_owned();
    let (name, value) = text.split_once('=').ok_or_else(wanted)?;
    match value.trim().parse() {
        Ok(value) if f64::is_finite(value) && value >= 0.0 => Ok((name.trim().into(), value)),
        _ => Err(wanted()),
    }
}
