//! The model against all records: fits, tables and figures in one pass over each.

use std::io::{BufWriter, Write};

use nalgebra::DVector;
use serde_json::{Value, json};
use tempfile::NamedTempFile;

use super::Args;
use super::estimate::Estimated;
use crate::identify::data::Loaded;
use crate::identify::output::Results;
use airloop::Error;
use airloop_ident::diagnostics;
use airloop_ident::diagnostics::response::Family;
use airloop_ident::model::{Linear, Model, NamedModel};
use airloop_ident::parameters::{Interval, Parameters};
use airloop_ident::playback::{Playback, Played};
use airloop_ident::score::{RecordScore, Score, Tally};
use airloop_ident::source::Source;
use airloop_ident::summary::{SCHEMA_VERSION, Summary, coefficients};
use airloop_report::plot::envelope::Envelope;
use airloop_report::plot::fit_page::{Compared, Table, compared};
use airloop_report::plot::identification;
use airloop_report::plot::run::short;
use airloop_series::{csv, rows};

/// Longest record \[samples\] that is written as a table.
const LONGEST_TABLE: usize = 200_000;
/// Samples of all records together whose residuals are tested in full.
const LONGEST_TEST: usize = 100_000;
/// Samples of all records together whose residuals are tested where there are more, so that memory goes to the data.
const PART_TESTED: usize = 20_000;

/// Results of an estimated model.
///
/// # Errors
/// A file that cannot be read again, or a table that cannot be written.
pub fn results(args: &Args, loaded: &Loaded, estimated: Estimated) -> Result<Results, Error> {
    let data = &loaded.data;
    let stable = estimated.model.is_stable();
    let mut summary = Summary {
        schema_version: SCHEMA_VERSION,
        airloop_version: env!("CARGO_PKG_VERSION").into(),
        method: estimated.method.clone(),
        inputs: data.inputs.clone(),
        outputs: data.outputs.clone(),
        sample_time: data.sample_time,
        structure: json!({
            "na": estimated.structure.na,
            "nb": estimated.structure.nb,
            "nk": estimated.structure.nk,
        }),
        stable,
        diagnostics: estimated.diagnostics.clone(),
        verdict: estimated.verdict.clone(),
        warnings: estimated.warnings.clone(),
        ..Summary::default()
    };
    let figures = judge(args, loaded, &estimated, &mut summary)?;
    let mut results = Results {
        summary,
        model: NamedModel {
            model: Linear::Arx(estimated.model.clone()),
            inputs: data.inputs.clone(),
            outputs: data.outputs.clone(),
            units: data.units.clone(),
        },
        series: Vec::new(),
        ready: Vec::new(),
        texts: Vec::new(),
        figures: Vec::new(),
        tables: Vec::new(),
    };
    results.summary.coefficients = coefficients(&results.model.model);
    results.tables.push(coefficients_table(&estimated.parameters));
    let playback = Playback::new(&estimated.model, stable);
    let (estimation, validation) = (loaded.estimation(), loaded.validation());
    for (set, sources, judges) in
        [("estimation", &estimation, validation.is_empty()), ("validation", &validation, true)]
    {
        let mut records = Vec::new();
        for (index, source) in sources.iter().enumerate() {
            let name = if sources.len() == 1 { set.to_owned() } else { format!("{set}_{}", index + 1) };
            let figures = judges && !args.data.no_plots;
            records.push(play(args, loaded, *source, &name, &playback, figures, &mut results)?);
        }
        let score = Score::of_records(records, &data.outputs);
        match set {
            "estimation" => results.summary.estimation = score,
            _ if !sources.is_empty() => results.summary.validation = Some(score),
            _ => {}
        }
    }
    results.figures.extend(figures);
    Ok(results)
}

/// Residual tests, poles and zeros, responses: into the summary, and as figures (name and SVG).
fn judge(
    args: &Args,
    loaded: &Loaded,
    estimated: &Estimated,
    summary: &mut Summary,
) -> Result<Vec<(String, String)>, Error> {
    let sources = loaded.estimation();
    let all: usize = sources.iter().map(|source| source.samples()).sum();
    let share = if all > LONGEST_TEST { PART_TESTED / sources.len().max(1) } else { all };
    let records = sources.iter().map(|source| source.head(share)).collect::<Result<Vec<_>, _>>()?;
    if sources.iter().any(|source| source.samples() > share) {
        summary
            .warnings
            .push(format!("the residuals are tested on the first {share} samples of each record"));
    }
    let at = |parameters: &DVector<f64>| estimated.mask.model(&estimated.model, parameters).to_state_space();
    let family = Family { parameters: &estimated.parameters, at: &at };
    let (kind, fitted_lags) = estimated.residuals;
    let options = diagnostics::Options { kind, fitted_lags, ..diagnostics::Options::default() };
    let (inputs, outputs) = (&loaded.data.inputs, &loaded.data.outputs);
    let found = diagnostics::diagnose(&estimated.model, Some(family), &records, inputs, outputs, &options);
    let verdict = diagnostics::verdict::verdict(&estimated.structure.to_string(), &found);
    summary.verdict.splice(0..0, verdict.sentences.iter().cloned());
    if let (Value::Object(all), Value::Object(more)) = (&mut summary.diagnostics, json!(found)) {
        all.extend(more);
        all.insert("verdict".into(), json!(verdict));
    }
    if args.data.no_plots {
        return Ok(Vec::new());
    }
    let figures = [
        ("residual_autocorrelation", identification::autocorrelations(&found.autocorrelation)),
        ("residual_cross_correlation", identification::cross_correlations(&found.cross_correlation)),
        ("poles_and_zeros", identification::pole_zero_map(&found.poles, &found.channel_zeros)),
        ("step_responses", identification::step_responses(&found.step)),
        ("frequency_responses", identification::frequency_responses(&found.frequency)),
    ];
    Ok(figures.into_iter().map(|(name, svg)| (name.to_owned(), svg)).collect())
}

fn coefficients_table(parameters: &Parameters) -> Table {
    let number = |value: Option<f64>| value.map_or("-".to_owned(), short);
    let row = |interval: Interval| {
        let [low, high] = interval.interval_95.map_or([None, None], |ends| ends.map(Some));
        let deviation = number(interval.standard_deviation);
        vec![interval.name, format!("{:.8}", interval.value), deviation, number(low), number(high)]
    };
    Table {
        sentences: false,
        heading: "Coefficients with 95 % intervals".into(),
        header: ["coefficient", "value", "standard deviation", "from", "to"].map(str::to_owned).into(),
        rows: parameters.intervals().into_iter().map(row).collect(),
    }
}

/// Plays one record.
fn play(
    args: &Args,
    loaded: &Loaded,
    source: &dyn Source,
    name: &str,
    playback: &Playback,
    figures: bool,
    results: &mut Results,
) -> Result<RecordScore, Error> {
    let data = &loaded.data;
    let (n_y, samples) = (data.outputs.len(), source.samples());
    let mut tally = Tally::new(source.name(), n_y, playback.warm_up());
    // Measured, response and residual of every output.
    let mut envelope = figures.then(|| Envelope::new(3 * n_y, samples));
    let mut table =
        (samples <= LONGEST_TABLE).then(|| table(args, data, results.summary.stable)).transpose()?;
    let mut written = Ok(());
    playback.run(source, &mut |played| {
        tally.add(&played);
        if let Some(envelope) = &mut envelope {
            draw(envelope, source, &played, playback.warm_up());
        }
        if let Some(table) = table.as_mut().filter(|_| written.is_ok()) {
            written = write(table, source, &played);
        }
    })?;
    let io =
        |source| Error::from(csv::Error::Io { path: args.data.output.join(format!("{name}.csv")), source });
    written.map_err(io)?;
    if let Some(table) = table {
        let file = table.into_inner().map_err(|error| io(error.into_error()))?;
        results.ready.push((format!("{name}.csv"), file));
    } else {
        results.summary.warnings.push(format!(
            "{name}.csv is not written: {samples} samples are more than the {LONGEST_TABLE} of a table"
        ));
    }
    let score = tally.finish(&data.outputs);
    if let Some(envelope) = envelope {
        let curves = envelope.finish();
        for (i, (output, curves)) in data.outputs.iter().zip(curves.chunks_exact(3)).enumerate() {
            let fits = if results.summary.stable { &score.fit_simulated } else { &score.fit_one_step };
            let svg = compared(&Compared {
                record: name,
                output,
                unit: data.units.get(data.inputs.len() + i).map_or("", String::as_str),
                simulated: results.summary.stable,
                fit: fits.get(output).copied().flatten(),
                curves,
            });
            results.figures.push((format!("{name}_{output}"), svg));
        }
    }
    Ok(score)
}

fn draw(envelope: &mut Envelope, source: &dyn Source, played: &Played, warm_up: usize) {
    let responses = played.simulated.unwrap_or(played.one_step);
    let n = played.outputs.first().map_or(0, |output| output.len());
    for k in warm_up.saturating_sub(played.at).min(n)..n {
        let values = played.outputs.iter().zip(responses);
        let values = values.flat_map(|(y, y_hat)| [y[k], y_hat[k], y[k] - y_hat[k]]);
        envelope.push(source.time(played.at + k), values);
    }
}

type TableWriter = BufWriter<NamedTempFile>;

/// A table in the folder of the results, without a name yet.
fn table(
    args: &Args,
    data: &airloop_ident::record::Experiments,
    simulated: bool,
) -> Result<TableWriter, Error> {
    // Next to the folder of the results, which is made and taken when they are complete.
    let folder = args.data.output.ancestors().find(|folder| folder.is_dir());
    let refuse = |error: std::io::Error| Error::OutputFolder {
        folder: args.data.output.clone(),
        problem: format!("nothing can be written there: {error}"),
    };
    let file = airloop_series::file::temporary(folder.unwrap_or(std::path::Path::new(".")));
    let file = file.map_err(refuse)?;
    let mut out = BufWriter::with_capacity(1 << 16, file);
    let suffixes =
        ["_simulated", "_one_step"].into_iter().filter(|suffix| simulated || *suffix == "_one_step");
    let responses =
        suffixes.flat_map(|suffix| data.outputs.iter().map(move |name| format!("{name}{suffix}")));
    let names: Vec<String> = data.inputs.iter().chain(&data.outputs).cloned().chain(responses).collect();
    rows::write_header(&mut out, names.iter().map(String::as_str)).map_err(refuse)?;
    Ok(out)
}

fn write(out: &mut TableWriter, source: &dyn Source, played: &Played) -> std::io::Result<()> {
    let n = played.outputs.first().map_or(0, |output| output.len());
    for k in 0..n {
        let measured = played.inputs.iter().chain(played.outputs).map(|column| column[k]);
        let responses = played.simulated.into_iter().flatten().chain(played.one_step).map(|column| column[k]);
        rows::write_row(out, source.time(played.at + k), measured.chain(responses))?;
    }
    out.flush()
}
