//! `airloop excite`: write a command for an experiment.

#![allow(
    rustdoc::broken_intra_doc_links,
    reason = "these texts are the help of the program, brackets are units"
)]

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args as Arguments, Subcommand, ValueEnum};

use super::output;
use airloop::Error;
use airloop_ident::excite::{Band, Settings, Signal, Size, chirp, prbs, supply, times};
use airloop_report::plot::run::short;
use airloop_series::units::parse_duration;
use airloop_series::{TimeSeries, csv};

/// `airloop excite`
#[derive(Debug, Arguments)]
pub struct Args {
    /// Kind of signal.
    #[command(subcommand)]
    pub kind: Kind,
}

/// Kinds of signals.
#[derive(Debug, Subcommand)]
pub enum Kind {
    /// A sine whose frequency runs through a band.
    #[command(
        after_help = "Example: airloop excite chirp --band 0.1..12Hz --amplitude 10,20,40 --duration 30s -o chirp.csv"
    )]
    Chirp {
        /// First and last frequency, e.g. 0.1..12Hz; the last may be the lower.
        #[arg(long, value_parser = parse_band, value_name = "FROM..TO")]
        band: Band,
        /// Change of the frequency over time.
        #[arg(long, value_enum, default_value_t = SweepChoice::Linear)]
        sweep: SweepChoice,
        /// Options of all signals.
        #[command(flatten)]
        common: Common,
    },
    /// Random levels within the amplitude, each held for a random time.
    #[command(
        after_help = "Example: airloop excite stairs --hold 0.2s..1s --amplitude 40 --duration 30s --seed 3 -o stairs.csv"
    )]
    Stairs {
        /// Time at a level: one, or the shortest and the longest, e.g. 0.2s..1s.
        #[arg(long, value_parser = parse_times, value_name = "TIME[..TIME]")]
        hold: std::ops::Range<f64>,
        /// Options of all signals.
        #[command(flatten)]
        common: Common,
    },
    /// Sines of equal amplitude at all multiples of 1/period in a band, with phases for a low peak.
    #[command(
        after_help = "Example: airloop excite multisine --band 0.1..12Hz --period 10s --duration 30s --amplitude 40 -o multisine.csv"
    )]
    Multisine {
        /// Lowest and highest frequency, e.g. 0.1..12Hz.
        #[arg(long, value_parser = parse_band, value_name = "FROM..TO")]
        band: Band,
        /// Period, e.g. 10s; the signal repeats after it. Default: the duration.
        #[arg(long, value_parser = parse_duration, value_name = "TIME")]
        period: Option<f64>,
        /// Options of all signals.
        #[command(flatten)]
        common: Common,
    },
    /// Two levels, switched in a pseudo-random order of maximal length.
    #[command(
        after_help = "Example: airloop excite prbs --band 0.1..12Hz --amplitude 20 --duration 40s -o prbs.csv"
    )]
    Prbs {
        /// Band to excite: sets the time between switches to 0.44 / highest frequency, and the order so that the period
        /// holds the lowest.
        #[arg(long, value_parser = parse_band, value_name = "FROM..TO", required_unless_present_all = ["clock", "order"])]
        band: Option<Band>,
        /// Time between possible switches; instead of what follows from the band.
        #[arg(long, value_parser = parse_duration, value_name = "TIME")]
        clock: Option<f64>,
        /// Order n, 2 to 20: the sequence repeats after 2^n - 1 clock times; instead of what follows from the band.
        #[arg(long)]
        order: Option<u32>,
        /// Options of all signals.
        #[command(flatten)]
        common: Common,
    },
}

/// Options of all signals.
#[derive(Debug, Clone, Arguments)]
pub struct Common {
    /// Largest deviation from the offset, in the unit of the column. Several, as in 10,20,40, give one file each
    /// (command_10.csv ...), or one after another with --join.
    #[arg(short, long, required = true, value_delimiter = ',', value_name = "NUMBER,...")]
    pub amplitude: Vec<f64>,
    /// Length of the signal without rests.
    #[arg(short, long, value_parser = parse_duration, value_name = "TIME", default_value = "20s")]
    pub duration: f64,
    /// Sample time.
    #[arg(long, value_parser = parse_duration, value_name = "TIME", default_value = "1ms")]
    pub step: f64,
    /// Level in the middle, also that of the rests.
    #[arg(long, default_value_t = 0.0, value_name = "NUMBER", allow_hyphen_values = true)]
    pub offset: f64,
    /// Time at the offset before each signal.
    #[arg(long, value_parser = parse_duration, value_name = "TIME", default_value = "0s")]
    pub rest_before: f64,
    /// Time at the offset after each signal.
    #[arg(long, value_parser = parse_duration, value_name = "TIME", default_value = "0s")]
    pub rest_after: f64,
    /// Seed of random choices; the same seed gives the same file. Further amplitudes use the seeds that follow.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Lowest and highest value that may be commanded, e.g. -60..60 or 60; a command beyond is refused.
    #[arg(long, value_parser = parse_limits, value_name = "LIMIT", allow_hyphen_values = true, conflicts_with = "supply")]
    pub limit: Option<(f64, f64)>,
    /// Supply pressure above ambient in Pa, e.g. 0.5e6: the command must be a force that it can give (paper eq. 3).
    #[arg(long, value_name = "PASCAL", requires = "areas")]
    pub supply: Option<f64>,
    /// Areas of the two chambers in m2, e.g. 3.1416e-4,2.6389e-4.
    #[arg(long, value_parser = parse_pair, value_name = "S1,S2", requires = "supply")]
    pub areas: Option<(f64, f64)>,
    /// Name of the column, with its unit if wanted, e.g. "v [m/s]".
    #[arg(long, default_value = "u [N]", value_name = "NAME")]
    pub column: String,
    /// Write several amplitudes one after another into one file.
    #[arg(long)]
    pub join: bool,
    /// CSV file to write: first column time [s]. It can be fed to `airloop run --input`.
    #[arg(short, long, value_name = "FILE", default_value = "command.csv")]
    pub output: PathBuf,
    /// Print nothing but errors.
    #[arg(short, long)]
    pub quiet: bool,
}

/// `--sweep`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum SweepChoice {
    /// The same time for every hertz.
    Linear,
    /// The same time for every octave.
    Logarithmic,
}

/// Writes the commands.
///
/// # Errors
/// A setting out of range, a command beyond the limits, a file that cannot be written.
pub fn run(args: &Args) -> Result<ExitCode, Error> {
    let (signal, common) = args.kind.signal();
    let limits = match (&common.supply, &common.areas) {
        (Some(supply), Some((s1, s2))) => Some(supply::force_limits(*s1, *s2, *supply)?),
        _ => common.limit,
    };
    check_files(common)?;
    let mut pieces = Vec::new();
    for (index, &amplitude) in common.amplitude.iter().enumerate() {
        let settings = Settings {
            amplitude,
            offset: common.offset,
            duration: common.duration,
            sample_time: common.step,
            rest_before: common.rest_before,
            rest_after: common.rest_after,
            seed: common.seed.wrapping_add(index as u64),
        };
        let samples = signal.samples(&settings)?;
        if let Some((lower, upper)) = limits {
            Size::of(&samples, common.offset).within(lower, upper, common.offset)?;
        }
        pieces.push((amplitude, samples));
    }
    let mut text = String::new();
    if common.join || pieces.len() == 1 {
        let samples = pieces.into_iter().flat_map(|(_, samples)| samples).collect();
        text += &write(samples, &common.output, &signal, common)?;
    } else {
        for (amplitude, samples) in pieces {
            text += &write(samples, &numbered(&common.output, amplitude), &signal, common)?;
        }
    }
    if !common.quiet {
        output::print(&text)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Refuses two amplitudes for one file, and a file that is there and is not a command of this column.
fn check_files(common: &Common) -> Result<(), Error> {
    let one = common.join || common.amplitude.len() == 1;
    for (index, &amplitude) in common.amplitude.iter().enumerate() {
        if !one && common.amplitude[..index].contains(&amplitude) {
            return Err(airloop_ident::excite::Error::Repeated { amplitude }.into());
        }
        let path = if one { common.output.clone() } else { numbered(&common.output, amplitude) };
        airloop_series::file::check_place(&path)
            .map_err(|source| csv::Error::Io { path: path.clone(), source })?;
        let Ok(found) = csv::read(&path) else {
            if path.metadata().is_ok_and(|file| file.len() > 0) {
                return Err(airloop_ident::excite::Error::File { path }.into());
            }
            continue;
        };
        let name = common.column.split(" [").next().unwrap_or_default();
        let command = matches!(found.channels(), [channel] if channel.name == name);
        if !command {
            return Err(airloop_ident::excite::Error::File { path }.into());
        }
    }
    Ok(())
}

/// Writes one file; what is printed about it.
fn write(samples: Vec<f64>, path: &Path, signal: &Signal, common: &Common) -> Result<String, Error> {
    let size = Size::of(&samples, common.offset);
    let n = samples.len();
    let mut series = TimeSeries::new(times(n, common.step))?;
    series.push(common.column.as_str(), None, samples)?;
    let io = |source| csv::Error::Io { path: path.into(), source };
    airloop_series::file::make_folder_of(path).map_err(io)?;
    csv::write(&series, path)?;
    let unit = common.column.rsplit_once(" [").map_or("", |(_, unit)| unit.trim_end_matches(']'));
    let in_unit = |value| format!("{} {unit}", short(value)).trim_end().to_owned();
    Ok(format!(
        "{}: {} s, {n} samples, {}, {} to {}, rms {}, crest factor {:.2}\n",
        path.display(),
        short(n as f64 * common.step),
        content(signal, common.step),
        short(size.lowest),
        in_unit(size.highest),
        in_unit(size.rms),
        size.crest_factor,
    ))
}

/// Frequencies of a signal in words.
fn content(signal: &Signal, step: f64) -> String {
    match signal {
        Signal::Chirp { band, .. } | Signal::Multisine { band, .. } => {
            format!("{} to {} Hz", band.start, band.end)
        }
        Signal::Stairs { hold } => format!("levels held {} to {} s", hold.start, hold.end),
        Signal::Prbs { clock, order } => {
            let clock = (clock / step).round() * step;
            let lowest = 1.0 / (clock * ((1u64 << order) - 1) as f64);
            format!("order {order}, {} to {} Hz", short(lowest), short(0.44 / clock))
        }
    }
}

/// `command.csv` for amplitude 10 is `command_10.csv`.
fn numbered(path: &Path, amplitude: f64) -> PathBuf {
    let stem = path.file_stem().map_or("command".into(), |stem| stem.to_string_lossy().into_owned());
    let ending = path.extension().map_or("csv".into(), |ending| ending.to_string_lossy().into_owned());
    path.with_file_name(format!("{stem}_{amplitude}.{ending}"))
}

impl Kind {
    fn signal(&self) -> (Signal, &Common) {
        match self {
            Kind::Chirp { band, sweep, common } => {
                let sweep = match sweep {
                    SweepChoice::Linear => chirp::Sweep::Linear,
                    SweepChoice::Logarithmic => chirp::Sweep::Logarithmic,
                };
                (Signal::Chirp { band: band.clone(), sweep }, common)
            }
            Kind::Stairs { hold, common } => (Signal::Stairs { hold: hold.clone() }, common),
            Kind::Multisine { band, period, common } => {
                (Signal::Multisine { band: band.clone(), period: *period }, common)
            }
            Kind::Prbs { band, clock, order, common } => {
                let usual = band.as_ref().map(|band| prbs::for_band(band, common.step));
                let (usual_clock, usual_order) = usual.unwrap_or((common.step, 2));
                let signal =
                    Signal::Prbs { clock: clock.unwrap_or(usual_clock), order: order.unwrap_or(usual_order) };
                (signal, common)
            }
        }
    }
}

/// `0.1..12Hz`, `0.1Hz..12Hz`, `0.1..12`.
pub(super) fn parse_band(text: &str) -> Result<Band, String> {
    let wanted = || format!("`{text}` is not a band; write it like 0.1..12Hz");
    let (from, to) = text.split_once("..").ok_or_else(wanted)?;
    let frequency = |text: &str| {
        let text = text.trim();
        let (digits, factor) = match text.strip_suffix("kHz") {
            Some(digits) => (digits, 1e3),
            None => (text.strip_suffix("Hz").unwrap_or(text), 1.0),
        };
        let value: f64 = digits.trim().parse().map_err(|_| wanted())?;
        if value.is_finite() && value > 0.0 {
            Ok(value * factor)
        } else {
            Err(format!("frequencies of a band are above zero, found {value}"))
        }
    };
    Ok(frequency(from)?..frequency(to)?)
}

/// `0.5s` or `0.2s..1s`.
fn parse_times(text: &str) -> Result<std::ops::Range<f64>, String> {
    let time = |text: &str| parse_duration(text).map_err(|error| error.to_string());
    match text.split_once("..") {
        Some((from, to)) => Ok(time(from)?..time(to)?),
        None => time(text).map(|held| held..held),
    }
}

/// `3.1e-4,2.6e-4`.
fn parse_pair(text: &str) -> Result<(f64, f64), String> {
    let pair = text.split_once(',').and_then(|(a, b)| a.trim().parse().ok().zip(b.trim().parse().ok()));
    pair.ok_or_else(|| format!("`{text}` are not two numbers; write them like 3.1416e-4,2.6389e-4"))
}

/// `60` or `-60..80`.
fn parse_limits(text: &str) -> Result<(f64, f64), String> {
    let number = |text: &str| -> Result<f64, String> {
        text.trim().parse().map_err(|_| format!("`{text}` is not a number; write a limit like 60 or -60..80"))
    };
    match text.split_once("..") {
        Some((from, to)) => Ok((number(from)?, number(to)?)),
        None => number(text).map(|limit| (-limit.abs(), limit.abs())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_times_and_limits_are_read_as_users_write_them() {
        assert_eq!(parse_band("0.1..12Hz"), Ok(0.1..12.0));
        assert_eq!(parse_band("100Hz..1kHz"), Ok(100.0..1000.0));
        assert!(parse_band("12").is_err() && parse_band("0..5Hz").is_err());
        assert_eq!(parse_times("200ms..1s"), Ok(0.2..1.0));
        assert_eq!(parse_limits("60"), Ok((-60.0, 60.0)));
        assert_eq!(parse_limits("-50..60"), Ok((-50.0, 60.0)));
    }

    #[test]
    fn files_of_several_amplitudes_carry_them_in_their_name() {
        assert_eq!(numbered(Path::new("out/chirp.csv"), 2.5), Path::new("out/chirp_2.5.csv"));
    }
}
