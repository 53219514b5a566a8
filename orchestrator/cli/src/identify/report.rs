//! Text that an identification prints: the model in one line, its fits, remarks, where the files are.

use std::path::Path;

use crate::table::table;
use airloop_ident::score::Score;
use airloop_ident::summary::Summary;
use airloop_report::plot::fit_page::Table;
use airloop_report::plot::run::short;

/// The identification in one sentence.
pub fn headline(summary: &Summary) -> String {
    let samples: usize = summary.estimation.records.iter().map(|record| record.samples).sum();
    let records = summary.estimation.records.len();
    format!(
        "{}: {samples} samples of {} s in {records} record{}, {}",
        summary.method,
        summary.sample_time,
        if records == 1 { "" } else { "s" },
        if summary.stable { "stable" } else { "UNSTABLE: the free simulation has no meaning and no fit" },
    )
}

/// Fits of all outputs.
pub fn fits_table(summary: &Summary) -> Table {
    let sets = [("estimation", Some(&summary.estimation)), ("validation", summary.validation.as_ref())];
    let sets: Vec<(&str, &Score)> =
        sets.into_iter().filter_map(|(name, score)| Some((name, score?))).collect();
    let mut header = vec!["fit [%]".to_owned()];
    for (name, _) in &sets {
        header.extend([format!("{name}: simulated"), "one step".into(), "RMS error".into()]);
    }
    let row = |name: &String| {
        let cells = sets.iter().flat_map(|(_, score)| {
            let fit =
                |fits: &std::collections::BTreeMap<String, Option<f64>>| fits.get(name).copied().flatten();
            [
                percent(fit(&score.fit_simulated), summary.stable),
                percent(fit(&score.fit_one_step), true),
                fit(&score.rms_simulated).map_or("-".into(), short),
            ]
        });
        std::iter::once(name.clone()).chain(cells).collect()
    };
    Table {
        sentences: false,
        heading: String::new(),
        header,
        rows: summary.outputs.iter().map(row).collect(),
    }
}

/// A fit with two digits.
pub fn percent(fit: Option<f64>, stable: bool) -> String {
    match fit {
        None if !stable => "unstable".into(),
        None => "constant".into(),
        Some(fit) if fit < -1e6 => "< -1e6".into(),
        Some(fit) => format!("{fit:.2}"),
    }
}

/// A table of texts for the terminal: the first column to the left, others to the right.
pub fn text_table(content: &Table) -> String {
    let header: Vec<&str> = content.header.iter().map(String::as_str).collect();
    table(&header, &content.rows, &(1..header.len()).collect::<Vec<_>>())
}

/// Text that is printed at the end.
pub fn report(summary: &Summary, folder: &Path) -> String {
    let mut text = format!("{}\n\n{}\n", headline(summary), text_table(&fits_table(summary)));
    for sentence in &summary.verdict {
        text += &format!("{sentence}\n");
    }
    for warning in &summary.warnings {
        text += &format!("warning: {warning}\n");
    }
    text += &format!("model:   {}\n", folder.join("model.toml").display());
    text + &format!("details: {}\n", folder.join("index.html").display())
}
