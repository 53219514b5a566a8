//! `airloop identify state-space`: subspace identification.

#![allow(
    rustdoc::broken_intra_doc_links,
    reason = "these texts are the help of the program, brackets are units"
)]

use std::process::ExitCode;

use clap::ValueEnum;
use nalgebra::DVector;
use serde_json::{Map, Value, json};

use super::data::DataArgs;
use super::linear_fmu::Wanted;
use super::output::Results;
use super::report;
use crate::output;
use airloop::Error;
use airloop_ident::diagnostics::verdict::{self, Verdict};
use airloop_ident::diagnostics::{self, Diagnostics, Kind, diagnose, response};
use airloop_ident::model::{Linear, Model, NamedModel};
use airloop_ident::record::{Experiments, Record};
use airloop_ident::subspace::{self, Estimate, Options, Order, Refined, Refinement, Weighting};
use airloop_report::plot::fit_page::Table;
use airloop_report::plot::identification::{
    Family, OrderFit, autocorrelations, cross_correlations, fit_against_order, frequency_responses,
    pole_zero_map, step_responses,
};
use airloop_report::plot::singular_values::singular_values;

/// `airloop identify state-space`
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Exit codes: 0 success, 1 failure, 2 wrong usage.\n\nExample: airloop identify state-space chirp.csv stairs.csv --inputs u --outputs F_hat,F_p --order auto --validate check.csv -o out/state-space"
)]
pub struct Args {
    /// Data to use, and the folder of the results.
    #[command(flatten)]
    pub data: DataArgs,
    /// Method by which the model is estimated.
    #[command(flatten)]
    pub method: MethodArgs,
    /// Number of states, or auto: the smallest order whose simulation error on held-out data is at most 2 % above the
    /// least (every second file is held out, or the last third of each if their lengths differ much); the model is then
    /// estimated from all data.
    #[arg(long, default_value = "auto", value_name = "ORDER", value_parser = parse_order)]
    pub order: OrderChoice,
    /// Highest order that --order auto tries.
    #[arg(long, default_value = "10", value_name = "ORDER", value_parser = clap::value_parser!(u16).range(1..=40))]
    pub max_order: u16,
    /// Also write the model as NAME.fmu, a linear-state-space, into the folder of the results.
    #[arg(long, value_name = "NAME")]
    pub fmu: Option<String>,
}

/// Method by which a state-space model is estimated.
#[derive(Debug, Clone, clap::Args)]
pub struct MethodArgs {
    /// Weighting of the projection; best tries all and takes that with the least simulation error on the estimation
    /// data.
    #[arg(long, value_enum, default_value_t = WeightingChoice::Best)]
    pub weighting: WeightingChoice,
    /// Past and future samples of the Hankel matrices. Default: of the longest that the data allow (twice as many rows
    /// as columns, no more than 200 columns) a quarter, half, three quarters and all are tried, as for --weighting.
    #[arg(long, value_name = "SAMPLES", value_parser = clap::value_parser!(u16).range(2..))]
    pub horizon: Option<u16>,
    /// Without D: the outputs do not depend on the inputs of the same sample.
    #[arg(long)]
    pub no_direct_term: bool,
    /// Criterion of the refinement after the subspace estimate: the simulation (output error), the one-step
    /// prediction (prediction error), or nothing. The refined model is taken only if that costs no more than 0.25
    /// points of fit on held-out data.
    #[arg(long, value_enum, default_value_t = RefineChoice::OutputError)]
    pub refine: RefineChoice,
    /// Action if no estimate is stable: it is kept and reported as unstable, or its poles outside the unit circle
    /// are mirrored at it, and B and D fitted again.
    #[arg(long, value_enum, default_value_t = UnstableChoice::Keep)]
    pub unstable: UnstableChoice,
}

/// Simulation error relative to the signal above which a model explains next to nothing.
const MAX_ERROR_OF_A_MODEL: f64 = 0.9;

/// `--order`
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OrderChoice {
    /// Found from the data.
    Auto,
    /// Given.
    Fixed(usize),
}

fn parse_order(text: &str) -> Result<OrderChoice, String> {
    match text.parse() {
        _ if text == "auto" => Ok(OrderChoice::Auto),
        Ok(order @ 1..=40) => Ok(OrderChoice::Fixed(order)),
        _ => Err("write a number from 1 to 40, or auto".into()),
    }
}

/// `--weighting`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum WeightingChoice {
    /// Oblique projection.
    N4sid,
    /// PO-MOESP.
    Moesp,
    /// Canonical variates.
    Cva,
    /// All of them are tried.
    Best,
}

/// `--refine`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum RefineChoice {
    /// Nothing.
    None,
    /// The one-step prediction.
    PredictionError,
    /// The free simulation.
    OutputError,
}

/// `--unstable`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum UnstableChoice {
    /// Kept and reported.
    Keep,
    /// Mirrored at the unit circle.
    Mirror,
}

impl MethodArgs {
    /// Settings for the library.
    pub fn options(&self, order: Order, data: &Experiments) -> Options {
        let weightings = match self.weighting {
            WeightingChoice::N4sid => vec![Weighting::N4sid],
            WeightingChoice::Moesp => vec![Weighting::Moesp],
            WeightingChoice::Cva => vec![Weighting::Cva],
            WeightingChoice::Best => Weighting::ALL.to_vec(),
        };
        Options {
            weightings,
            horizon: self.horizon.map(usize::from),
            direct: !self.no_direct_term,
            mirror_unstable: self.unstable == UnstableChoice::Mirror,
            ..Options::new(order, &data.input_offset, &data.output_offset)
        }
    }

    /// Refinement for the library.
    pub fn refinement(&self) -> Refinement {
        match self.refine {
            RefineChoice::None => Refinement::None,
            RefineChoice::OutputError => Refinement::OutputError,
            RefineChoice::PredictionError => Refinement::PredictionError,
        }
    }
}

/// Runs the command.
///
/// # Errors
/// Fails if there is no model, or its results cannot be written.
pub fn run(args: &Args) -> Result<ExitCode, Error> {
    let fmu = args.fmu.as_ref().map(|name| Wanted::new(name, args.data.channels())).transpose()?;
    let files: Vec<String> = fmu.iter().map(Wanted::file).collect();
    args.data.check_output(&files)?;
    let data = args.data.read()?;
    let order = match args.order {
        OrderChoice::Auto => Order::UpTo(args.max_order.into()),
        OrderChoice::Fixed(order) => Order::Fixed(order),
    };
    let options = args.method.options(order, &data);
    let estimate = subspace::estimate(&data.estimation, &options)?;
    let refined = subspace::refine(&data.estimation, &estimate, &options, args.method.refinement())?;
    let mut results = results(&estimate, &refined, &data, !args.data.no_plots);
    if let Some(fmu) = &fmu {
        fmu.check(refined.model.order(), &[])?;
    }
    results.summary.files.extend(files);
    let (summary, written) = results.write(&args.data.output)?;
    let mut text = report::report(&summary, &args.data.output);
    if let Some(fmu) = &fmu {
        fmu.write(&refined.model, &report::headline(&summary), written.path())?;
        text += &format!("FMU:     {}\n", args.data.output.join(fmu.file()).display());
    }
    written.commit()?;
    if !args.data.quiet {
        output::print(&text)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn results(estimate: &Estimate, refined: &Refined, data: &Experiments, plots: bool) -> Results {
    let model = &refined.model;
    let order = model.order();
    let named = NamedModel {
        model: Linear::StateSpace(model.clone()),
        inputs: data.inputs.clone(),
        outputs: data.outputs.clone(),
        units: data.units.clone(),
    };
    let method = format!("state space of order {order}, subspace ({})", estimate.method.describe());
    let method = method + if refined.taken { ", refined" } else { "" };
    let mut results = Results::of(&method, named, data, plots);
    let found = found(refined, data);
    let judged = verdict::verdict(&format!("order {order}"), &found);
    let summary = &mut results.summary;
    summary.structure = json!({
        "order": order,
        "direct_term": model.d.amax() > 0.0,
        "weighting": estimate.method.weighting,
        "horizon": estimate.method.horizon,
        "realization": estimate.method.realization,
        "poles_mirrored": estimate.method.stabilized && !refined.taken,
        "refined": refined.taken,
    });
    summary.diagnostics = diagnostics(estimate, refined, data, &found, &judged);
    summary.verdict.extend(sentences(estimate, refined));
    summary.verdict.extend(judged.sentences);
    let mended = refined.taken && model.is_stable();
    let concerns_poles = |warning: &String| warning.contains("stable model") || warning.contains("mirrored");
    summary
        .warnings
        .extend(estimate.warnings.iter().filter(|warning| !(mended && concerns_poles(warning))).cloned());
    if !model.is_stable() {
        let remedy = "options that give a stable model: --unstable mirror, or --refine output-error";
        summary.warnings.push(remedy.into());
    }
    if !estimate.orders.is_empty() {
        results.tables.push(orders_table(estimate));
    }
    if plots {
        results.figures.extend(figures(estimate, order, &found));
    }
    results
}

fn sentences(estimate: &Estimate, refined: &Refined) -> Vec<String> {
    let order = estimate.model.order();
    let mut sentences = Vec::new();
    if !estimate.orders.is_empty() {
        sentences.push(order_sentence(&estimate.orders, order));
    }
    let values = &estimate.singular_values;
    if let (Some(first), Some(last)) = (values.first(), values.get(order - 1)) {
        let next = values.get(order).copied().unwrap_or(0.0);
        sentences.push(format!(
            "singular values: number {order} is {} of the largest, number {} is {}",
            of_largest(last / first),
            order + 1,
            of_largest(next / first)
        ));
    }
    sentences.extend(Some(refined.note.clone()).filter(|note| !note.is_empty()));
    sentences
}

/// A share of the largest as a number that reads well.
fn of_largest(value: f64) -> String {
    if value >= 0.01 { format!("{value:.2}") } else { format!("{value:.1e}") }
}

/// Result of the order search in a sentence, `order` being the one taken.
fn order_sentence(orders: &[subspace::OrderError], order: usize) -> String {
    let highest = orders.len();
    let remedy = "the plant may be unstable, an input may not reach the outputs, or means are large against the spread of the signals (--detrend mean)";
    let error = |order: usize| orders.get(order.wrapping_sub(1)).and_then(|found| found.held_out);
    let least = orders.iter().filter_map(|found| found.held_out).fold(f64::INFINITY, f64::min);
    let Some(own) = error(order) else {
        return format!(
            "no order up to {highest} explains the data: none gives a stable model that simulates the held-out data; {remedy}; order {order} is given to look at"
        );
    };
    if least > MAX_ERROR_OF_A_MODEL {
        return format!(
            "no order up to {highest} explains the data: on held-out data the least simulation error is {:.0} % of the signal; {remedy}; order {order} is given to look at",
            100.0 * least
        );
    }
    let below = match error(order.wrapping_sub(1)) {
        Some(error) => format!(", order {} {}", order - 1, share(error)),
        None => String::new(),
    };
    format!(
        "order {order} of 1 to {highest} is enough: on held-out data its simulation error is {} of the signal{below}, and no order is more than 2 % (of that) better",
        share(own)
    )
}

/// A share in percent; one at rounding level is not given digits that it does not have.
fn share(value: f64) -> String {
    if value < subspace::EXACT_RELATIVE_ERROR {
        "0 % (to rounding)".into()
    } else {
        format!("{:.2} %", 100.0 * value)
    }
}

/// Residual tests, poles, zeros and responses; with bands if the refinement gave a covariance.
fn found(refined: &Refined, data: &Experiments) -> Diagnostics {
    let options = diagnostics::Options { kind: Kind::Simulated, ..diagnostics::Options::default() };
    let at = refined.details.as_ref().map(|details| (details, |p: &DVector<f64>| details.at(p)));
    let family = at.as_ref().map(|(details, at)| response::Family { parameters: &details.parameters, at });
    diagnose(&refined.model, family, &data.estimation, &data.inputs, &data.outputs, &options)
}

fn diagnostics(
    estimate: &Estimate,
    refined: &Refined,
    data: &Experiments,
    found: &Diagnostics,
    judged: &Verdict,
) -> Value {
    let model = &refined.model;
    let initial = |records: &[Record]| -> Vec<Vec<f64>> {
        records.iter().map(|record| model.initial_state(record).iter().copied().collect()).collect()
    };
    let mut values = match json!(found) {
        Value::Object(values) => values,
        _ => Map::new(),
    };
    // Directions of a local basis mean nothing to a reader.
    values.remove("parameters");
    values.insert("verdict".into(), json!(judged));
    values.insert("singular_values".into(), json!(estimate.singular_values));
    values.insert("orders".into(), json!(estimate.orders));
    let (before, after) = refined.held_out.unzip();
    let finite = |fit: Option<f64>| fit.filter(|fit| fit.is_finite());
    values.insert(
        "refinement".into(),
        json!({
            "taken": refined.taken,
            "fit_held_out_without": finite(before),
            "fit_held_out_with": finite(after),
            "outcome": refined.details.as_ref().map(|details| details.outcome),
            "iterations": refined.details.as_ref().map(|details| details.iterations),
        }),
    );
    values.insert(
        "initial_states".into(),
        json!({"estimation": initial(&data.estimation), "validation": initial(&data.validation)}),
    );
    Value::Object(values)
}

fn orders_table(estimate: &Estimate) -> Table {
    let row = |found: &subspace::OrderError| {
        let error = found.held_out.map_or("unstable".into(), |error| format!("{:.2}", 100.0 * error));
        vec![found.order.to_string(), error]
    };
    Table {
        sentences: false,
        heading: "Orders, estimated from a part of the data and judged on the rest".into(),
        header: vec!["order".into(), "held-out simulation error [%]".into()],
        rows: estimate.orders.iter().map(row).collect(),
    }
}

fn figures(estimate: &Estimate, order: usize, found: &Diagnostics) -> Vec<(String, String)> {
    let mut figures = vec![
        ("singular_values".to_owned(), singular_values(&estimate.singular_values, order)),
        ("poles_and_zeros".into(), pole_zero_map(&found.poles, &found.channel_zeros)),
        ("residuals".into(), autocorrelations(&found.autocorrelation)),
        ("residuals_and_inputs".into(), cross_correlations(&found.cross_correlation)),
        ("step_responses".into(), step_responses(&found.step)),
        ("frequency_responses".into(), frequency_responses(&found.frequency)),
    ];
    if !estimate.orders.is_empty() {
        let fit = |found: &subspace::OrderError| OrderFit {
            order: found.order,
            fit: found.held_out.map(|error| 100.0 * (1.0 - error)),
            stable: found.held_out.is_some(),
        };
        let fits: Vec<OrderFit> = estimate.orders.iter().map(fit).collect();
        let family = Family { name: "state space", fits: &fits };
        let title = "Simulated fit on held-out data";
        figures.push(("orders".into(), fit_against_order(title, "before refinement", &[family])));
    }
    figures
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_are_numbers_or_auto() {
        assert_eq!(parse_order("auto"), Ok(OrderChoice::Auto));
        assert_eq!(parse_order("4"), Ok(OrderChoice::Fixed(4)));
        assert!(parse_order("0").is_err() && parse_order("41").is_err() && parse_order("four").is_err());
    }

    #[test]
    fn an_order_is_called_enough_only_if_it_explains_the_data() {
        let orders = |errors: [Option<f64>; 2]| {
            let all = errors.iter().enumerate();
            let all: Vec<_> =
                all.map(|(index, &held_out)| subspace::OrderError { order: index + 1, held_out }).collect();
            order_sentence(&all, 1)
        };
        for unusable in [[None, None], [Some(0.97), Some(0.99)]] {
            let sentence = orders(unusable);
            assert!(sentence.starts_with("no order up to 2 explains the data"), "{sentence}");
            assert!(!sentence.contains("NaN") && !sentence.contains("is enough"), "{sentence}");
        }
        assert!(orders([Some(0.1), None]).contains("error is 10.00 % of the signal"));
    }
}
