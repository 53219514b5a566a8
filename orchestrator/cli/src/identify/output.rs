//! The folder of the results: model, summary, tables, figures, page.

use std::io::Write;
use std::path::Path;

use super::report;
use crate::folder;
use airloop::Error;
use airloop_ident::model::{NamedModel, file};
use airloop_ident::record::Experiments;
use airloop_ident::responses::{Responses, responses};
use airloop_ident::summary::{self, Summary};
use airloop_report::plot;
use airloop_report::plot::fit_page::{self, Page, Table};
use airloop_series::file::{persist, write_whole};
use airloop_series::{TimeSeries, csv};
use tempfile::NamedTempFile;

/// Files and figures of an identification.
#[derive(Debug)]
pub struct Results {
    /// Contents of summary.json; figures and files are filled in by [`Results::write`].
    pub summary: Summary,
    /// Contents of model.toml.
    pub model: NamedModel,
    /// Further tables: file name and contents.
    pub series: Vec<(String, TimeSeries)>,
    /// Tables that are written already: name and temporary file in the folder of the results.
    pub ready: Vec<(String, NamedTempFile)>,
    /// Further texts: file name and contents.
    pub texts: Vec<(String, String)>,
    /// Figures: name and SVG.
    pub figures: Vec<(String, String)>,
    /// Further tables of the page.
    pub tables: Vec<Table>,
}

impl Results {
    /// Results of any linear model: its fits, its responses to all records as tables, and figures of those that judge
    /// it (validation, or else estimation).
    pub fn of(method: &str, model: NamedModel, data: &Experiments, plots: bool) -> Results {
        let summary = Summary::of(method, &model, data);
        let (mut series, mut figures) = (Vec::new(), Vec::new());
        let sets = [("estimation", &data.estimation), ("validation", &data.validation)];
        let judging = if data.validation.is_empty() { "estimation" } else { "validation" };
        for (set, records) in sets {
            for (index, record) in records.iter().enumerate() {
                let name = if records.len() == 1 { set.to_owned() } else { format!("{set}_{}", index + 1) };
                let Responses { table, warm_up } = responses(model.model.as_model(), record, data);
                if plots && set == judging {
                    figures.extend(fit_page::comparisons(&name, &table, &data.outputs, warm_up));
                }
                series.push((format!("{name}.csv"), table));
            }
        }
        Results { summary, model, series, ready: Vec::new(), texts: Vec::new(), figures, tables: Vec::new() }
    }

    /// Writes everything for `folder`; gives the summary as written, and the files that are still to be put there.
    ///
    /// # Errors
    /// Fails if a file or the folder cannot be made, removed or written.
    pub fn write(mut self, folder: &Path) -> Result<(Summary, folder::Results), Error> {
        let named = self.figures.iter().map(|(name, _)| name.as_str());
        self.summary.figures = plot::run::unique_files(named);
        let tables = self.series.iter().map(|(name, _)| name.clone());
        let tables = tables.chain(self.ready.iter().map(|(name, _)| name.clone()));
        let texts = self.texts.iter().map(|(name, _)| name.clone());
        self.summary.files.splice(0..0, ["model.toml".to_owned()].into_iter().chain(tables).chain(texts));
        let all = [&self.summary.figures, &self.summary.files].into_iter().flatten().cloned();
        let all: Vec<String> = all.chain(["index.html", "summary.json"].map(str::to_owned)).collect();
        // Names of figures are known only now.
        let results = folder::Results::open(folder, &[], &all)?;
        let folder = results.path();
        let write = |name: &str, text: &str| write_text(&folder.join(name), text);
        let path = folder.join("summary.json");
        summary::write(&self.summary, &path).map_err(|source| csv::Error::Io { path, source })?;
        file::save(&self.model, &folder.join("model.toml"))?;
        for (name, series) in &self.series {
            csv::write(series, &folder.join(name))?;
        }
        for (name, file) in std::mem::take(&mut self.ready) {
            let path = folder.join(&name);
            persist(file, &path).map_err(|source| csv::Error::Io { path, source })?;
        }
        for (name, text) in &self.texts {
            write(name, text)?;
        }
        for (name, (_, svg)) in self.summary.figures.iter().zip(&self.figures) {
            write(name, svg)?;
        }
        write("index.html", &fit_page::html(&self.page()))?;
        Ok((self.summary, results))
    }

    fn page(&self) -> Page {
        let summary = &self.summary;
        let mut tables = vec![report::fits_table(summary)];
        tables.extend(self.tables.iter().cloned());
        Page {
            title: format!("{} from {}", summary.outputs.join(", "), summary.inputs.join(", ")),
            lead: report::headline(summary),
            remarks: vec![
                ("Verdict".into(), summary.verdict.clone()),
                ("Warnings".into(), summary.warnings.clone()),
            ],
            tables,
            figures: self.figures.iter().map(|(_, svg)| svg.clone()).collect(),
            ..Page::default()
        }
    }
}

fn write_text(path: &Path, text: &str) -> Result<(), Error> {
    write_whole(path, |out| out.write_all(text.as_bytes()))
        .map_err(|source| csv::Error::Io { path: path.into(), source }.into())
}
