//! `airloop identify arx`: orders given or searched, least squares, refinement if wanted.

#![allow(
    rustdoc::broken_intra_doc_links,
    reason = "these texts are the help of the program, brackets are units"
)]

mod estimate;
mod fmu;
mod orders;
mod play;

use std::process::ExitCode;

use clap::ValueEnum;

use super::data::DataArgs;
use super::linear_fmu::Wanted;
use super::output::Results;
use super::report;
use crate::output;
use airloop::Error;
use airloop_ident::arx::Names;
use airloop_ident::order_search::{self, Ranges};
use airloop_ident::structure::{self, Structure};

/// `airloop identify arx`
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Exit codes: 0 success, 1 failure, 2 wrong usage, 130 interrupted.\n\nExamples:\n  airloop identify arx chirp.csv stairs.csv --inputs u --outputs F_hat,F_p --na 1 --nb 2 --validate check.csv -o out/actuator\n  airloop identify arx chirp.csv --inputs u --outputs F_hat,F_p --order auto --na 1..6 --nk 0..10"
)]
pub struct Args {
    /// Data to use, and the folder of the results.
    #[command(flatten)]
    pub data: DataArgs,
    /// Search the orders: all combinations of the ranges of --na, --nb and --nk (default 1..4, 1..4, 0..3) are ranked
    /// by the simulated fit on the validation files, or else on the last third of every file. Taken is the one with the
    /// least BIC of those within 0.5 points of the best.
    #[arg(long, value_enum)]
    pub order: Option<OrderChoice>,
    /// Number of coefficients on past outputs: one number, or a matrix with a row for each output, as "2,1;1,2"; with
    /// --order auto a range as 1..4. Default: 1.
    #[arg(long, value_name = "ORDERS")]
    pub na: Option<String>,
    /// Number of coefficients on inputs, from u(k - nk) on: one number, or a row for each output and a number for each
    /// input, as "2;3"; with --order auto a range. Default: 2.
    #[arg(long, value_name = "ORDERS")]
    pub nb: Option<String>,
    /// Delay of the inputs in samples; 0 is a direct term. As --nb. Default: 0.
    #[arg(long, value_name = "DELAYS")]
    pub nk: Option<String>,
    /// Method by which the coefficients are estimated.
    #[arg(long, value_enum, default_value_t = MethodChoice::LeastSquares)]
    pub method: MethodChoice,
    /// Also write the model as NAME.fmu: an arx-actuator for one input and at most two outputs about zero, else a
    /// linear-state-space (12 states, 4 inputs, 4 outputs at most). It starts at rest at the operating point.
    #[arg(long, value_name = "NAME")]
    pub fmu: Option<String>,
    /// Read the files anew for every pass instead of keeping them in memory; done without asking above 1 GB.
    #[arg(long)]
    pub stream: bool,
}

/// `--order`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum OrderChoice {
    /// Search.
    Auto,
}

/// `--method`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum MethodChoice {
    /// Least one-step error. Right for noise that acts inside the system; noise on the sensors biases it.
    LeastSquares,
    /// Refined instrumental variables: no bias by noise on the sensors.
    InstrumentalVariables,
    /// Least error of the free simulation, from least squares on; the choice for noise on the sensors.
    OutputError,
}

impl MethodChoice {
    fn name(self) -> &'static str {
        match self {
            MethodChoice::LeastSquares => "least squares",
            MethodChoice::InstrumentalVariables => "instrumental variables",
            MethodChoice::OutputError => "output error",
        }
    }
}

/// Runs the command.
///
/// # Errors
/// Fails if there is no model, or its results cannot be written.
pub fn run(args: &Args) -> Result<ExitCode, Error> {
    let channels = args.data.channels();
    // What is wrong with the orders is said before long files are read.
    let ranges = ranges(args, channels)?;
    let given = if ranges.is_none() { Some(structure(args, channels)?) } else { None };
    let fmu = args.fmu.as_ref().map(|name| Wanted::new(name, channels)).transpose()?;
    let files: Vec<String> = fmu.iter().map(Wanted::file).collect();
    args.data.check_output(&files)?;
    let mut loaded = args.data.load(args.stream)?;
    let names = Names { inputs: &args.data.inputs, outputs: &args.data.outputs };
    let mut warnings = Vec::new();
    let candidates = ranges.map(|ranges| search(&ranges, &loaded, names)).transpose()?;
    let structure = match (&candidates, given) {
        (Some(candidates), _) => orders::chosen(candidates)?,
        (None, given) => given.unwrap_or_else(|| Structure::uniform(channels, 1, 2, 0)),
    };
    warnings.extend(short_validation(&loaded, &structure));
    let estimated = estimate::estimate(args, &loaded, &structure, names)?;
    let model = estimated.model.clone();
    fmu.as_ref().map_or(Ok(()), |wanted| fmu::check(wanted, &model))?;
    if candidates.is_some() && loaded.validation().is_empty() {
        warnings.push(
            "no validation files: the orders were judged on the last third of every file, the model is estimated from all of it; its estimation fits are no proof, give --validate".to_owned(),
        );
    }
    let mut results: Results = play::results(args, &loaded, estimated)?;
    warnings.append(&mut loaded.data.notes);
    results.summary.warnings.splice(0..0, warnings);
    if let Some(candidates) = &candidates {
        orders::add(&mut results, candidates, &args.data.outputs);
    }
    results.summary.files.extend(fmu.as_ref().map(Wanted::file));
    let (summary, written) = results.write(&args.data.output)?;
    if let (Some(wanted), Some(name)) = (&fmu, &args.fmu) {
        fmu::write(wanted, name, &model, written.path(), &report::headline(&summary))?;
    }
    written.commit()?;
    if !args.data.quiet {
        let table = candidates
            .as_ref()
            .map(|all| orders::table(all, &args.data.outputs, orders::CANDIDATES_ON_TERMINAL));
        let table = table.map_or(String::new(), |table| report::text_table(&table) + "\n");
        let mut text = table + &report::report(&summary, &args.data.output);
        if let Some(fmu) = &fmu {
            text += &format!("FMU:     {}\n", args.data.output.join(fmu.file()).display());
        }
        output::print(&text)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Validation records that are too short to judge a model of this structure.
fn short_validation(loaded: &super::data::Loaded, structure: &Structure) -> Vec<String> {
    let coefficients = (0..structure.n_y()).map(|output| structure.terms(output).len()).max().unwrap_or(0);
    let least = estimate::SAMPLES_PER_COEFFICIENT * coefficients;
    let short = loaded.validation().into_iter().filter(|source| source.samples() < least);
    let sentence = |source: &dyn airloop_ident::source::Source| {
        format!(
            "{}: only {} samples for {coefficients} coefficients per output: the fit on this validation record says little; record at least {least}",
            source.name(),
            source.samples()
        )
    };
    short.map(sentence).collect()
}

fn structure(args: &Args, channels: (usize, usize)) -> Result<Structure, Error> {
    let text = |option: &Option<String>, default: &str| option.clone().unwrap_or(default.into());
    let (na, nb, nk) = (text(&args.na, "1"), text(&args.nb, "2"), text(&args.nk, "0"));
    Structure::parse(channels, &na, &nb, &nk).map_err(|error| error.named(&args.data.outputs).into())
}

fn ranges(args: &Args, channels: (usize, usize)) -> Result<Option<Ranges>, Error> {
    if args.order.is_none() {
        return Ok(None);
    }
    let range = |name, option: &Option<String>, default: &str| {
        structure::range(name, option.as_deref().unwrap_or(default))
    };
    let ranges = Ranges {
        na: range("na", &args.na, "1..4")?,
        nb: range("nb", &args.nb, "1..4")?,
        nk: range("nk", &args.nk, "0..3")?,
    };
    order_search::check(&ranges, channels)?;
    Ok(Some(ranges))
}

fn search(
    ranges: &Ranges,
    loaded: &super::data::Loaded,
    names: Names,
) -> Result<Vec<order_search::Candidate>, Error> {
    let (estimation, validation) = (loaded.estimation(), loaded.validation());
    let (sample_time, offsets) = (loaded.data.sample_time, loaded.offsets());
    Ok(order_search::search_or_split(&estimation, &validation, ranges, sample_time, offsets, names)?)
}
