//! Words of `airloop optimize`.

#![allow(
    rustdoc::broken_intra_doc_links,
    reason = "these texts are the help of the program, brackets are units"
)]

use std::path::PathBuf;

use clap::{Args as ClapArgs, ValueEnum};

use airloop_ocp::transcription::Transcription;
use airloop_series::units::parse_duration;

/// `airloop optimize`
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "Exit codes: 0 solved, 20 infeasible (the worst constraint is named), 21 not solved (limit of iterations, no progress, objective without end), 22 the system could not be evaluated, 1 failure, 2 wrong usage, 130 interrupted (Ctrl-C; the best point so far is kept, --resume goes on from it).\n\nExample: airloop optimize examples/03_swing_up/problem.toml --intervals 200 -o out/swing_up"
)]
pub struct Args {
    /// Problem file (TOML); its keys are those of --schema.
    #[arg(required_unless_present = "schema")]
    pub problem: Option<PathBuf>,
    /// A variant of the problem that the problem file names under [variants].
    #[arg(long, value_name = "NAME")]
    pub variant: Option<String>,
    /// Transcription of the problem; default: that of the problem file.
    #[arg(long, value_enum)]
    pub transcription: Option<TranscriptionChoice>,
    /// Intervals of the mesh, of each phase where there are several (30,10,30); default: those of the problem file.
    #[arg(long, value_name = "NUMBER", value_delimiter = ',', value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub intervals: Option<Vec<u32>>,
    /// Initial guess: linear, the name of a guess of the problem file, or the CSV file of an earlier trajectory.
    #[arg(long, value_name = "NAME|FILE.csv")]
    pub guess: Option<String>,
    /// Go on from the trajectory in the folder of an earlier run.
    #[arg(long, value_name = "DIR", conflicts_with = "guess")]
    pub resume: Option<PathBuf>,
    /// Folder for the results; it is made if it is not there.
    #[arg(short, long, value_name = "DIR", default_value = "out/optimize")]
    pub output: PathBuf,
    /// Duration of the motion [s], in place of that of the problem file (which has to be a fixed one of a single
    /// phase).
    #[arg(long, value_name = "TIME", value_parser = parse_duration)]
    pub duration: Option<f64>,
    /// Scaled error of the optimality conditions at which the problem counts as solved; default: 1e-8.
    #[arg(long, value_name = "NUMBER")]
    pub tolerance: Option<f64>,
    /// Iterations of one solve, beyond which it is given up; default: 500.
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u32).range(1..))]
    pub max_iterations: Option<u32>,
    /// Solve from that many perturbed guesses as well, and list the distinct minima in multistart.csv; the best is
    /// kept.
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u32).range(1..=10_000), conflicts_with = "sweep")]
    pub multistart: Option<u32>,
    /// Seed of the perturbations; one seed gives one result, on any number of processors.
    #[arg(long, value_name = "NUMBER", default_value_t = 0)]
    pub seed: u64,
    /// Solve for a range of durations or of a parameter, each from the solution before: T=1.6..2.4, or T=1.6..2.4:17
    /// for 17 values (default 9); the table goes to sweep.csv, the last solution into the other files.
    #[arg(long, value_name = "NAME=FROM..TO", value_parser = parse_sweep)]
    pub sweep: Option<Sweep>,
    /// Threads; default: one per processor, at most 8. Results do not depend on it.
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u32).range(1..=256))]
    pub threads: Option<u32>,
    /// Do not roll the plan out.
    #[arg(long)]
    pub no_verification: bool,
    /// Draw no figures.
    #[arg(long)]
    pub no_plots: bool,
    /// Print the JSON schema of problem files, for editors that check and complete TOML.
    #[arg(long)]
    pub schema: bool,
    /// Print every iteration to the standard error; they are in iterations.csv in any case.
    #[arg(short, long, conflicts_with = "quiet")]
    pub verbose: bool,
    /// Print nothing but errors.
    #[arg(short, long)]
    pub quiet: bool,
}

/// Transcriptions by the names of problem files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[allow(missing_docs, reason = "the names are those of the library")]
pub enum TranscriptionChoice {
    Trapezoidal,
    HermiteSimpson,
    HermiteSimpsonSeparated,
    MultipleShooting,
    ShootingCollocation,
}

impl From<TranscriptionChoice> for Transcription {
    fn from(choice: TranscriptionChoice) -> Transcription {
        match choice {
            TranscriptionChoice::Trapezoidal => Transcription::Trapezoidal,
            TranscriptionChoice::HermiteSimpson => Transcription::HermiteSimpson,
            TranscriptionChoice::HermiteSimpsonSeparated => Transcription::HermiteSimpsonSeparated,
            TranscriptionChoice::MultipleShooting => Transcription::MultipleShooting,
            TranscriptionChoice::ShootingCollocation => Transcription::ShootingCollocation,
        }
    }
}

/// Values of the duration (`T`) or of a parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Sweep {
    /// `T`, or `component.variable`.
    pub name: String,
    /// First value, in s or the unit of the variable.
    pub from: f64,
    /// Last value.
    pub to: f64,
    /// Number of values, first and last included.
    pub count: usize,
}

fn parse_sweep(text: &str) -> Result<Sweep, String> {
    let form = "write NAME=FROM..TO or NAME=FROM..TO:COUNT, such as T=1.6..2.4:17";
    let (name, range) = text.split_once('=').ok_or(form)?;
    let (from, rest) = range.split_once("..").ok_or(form)?;
    let (to, count) = rest.split_once(':').unwrap_or((rest, "9"));
    let number = |text: &str| {
        let number = text.trim().parse::<f64>().ok().filter(|number| number.is_finite());
        number.ok_or_else(|| format!("`{text}` is not a finite number; {form}"))
    };
    let count: usize =
        count.trim().parse().map_err(|_| format!("`{count}` is not a whole number; {form}"))?;
    if !(2..=10_000).contains(&count) {
        return Err(format!("a sweep has 2 to 10000 values, not {count}"));
    }
    Ok(Sweep { name: name.trim().to_owned(), from: number(from)?, to: number(to)?, count })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sweeps_have_a_name_a_range_and_a_count() {
        let sweep = parse_sweep("T=1.6..2.4").unwrap();
        assert_eq!(sweep, Sweep { name: "T".into(), from: 1.6, to: 2.4, count: 9 });
        assert_eq!(parse_sweep("cart_pole.m_p=0.2..0.1:3").unwrap().count, 3);
        for text in ["T", "T=1", "T=1..b", "T=1..2:1", "T=1..inf", "T=1..2:x"] {
            assert!(parse_sweep(text).is_err(), "{text}");
        }
    }
}
