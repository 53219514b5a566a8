//! Options that say which data, and where the results go.

#![allow(
    rustdoc::broken_intra_doc_links,
    reason = "these texts are the help of the program, brackets are units"
)]

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use tempfile::TempDir;

use crate::{folder, output, resample};
use airloop::Error;
use airloop_ident::record;
use airloop_ident::record::set::Request;
use airloop_ident::record::{Detrend, Experiments, Record};
use airloop_ident::source::{FileSource, Source};
use airloop_series::scratch;
use airloop_series::uniform::Method;
use airloop_series::units::parse_duration;

/// Data to use, and the folder of the results.
#[derive(Debug, Clone, Args)]
pub struct DataArgs {
    /// CSV files of the estimation, one experiment each: first column `time` [s] (or for example `time [ms]`), then a
    /// column per signal, evenly sampled.
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// Columns of the inputs, separated by commas.
    #[arg(long, value_delimiter = ',', required = true, value_name = "NAMES")]
    pub inputs: Vec<String>,
    /// Columns of the outputs, separated by commas.
    #[arg(long, value_delimiter = ',', required = true, value_name = "NAMES")]
    pub outputs: Vec<String>,
    /// Put all records on a grid of this step first, as `airloop resample` does: by their time stamps, with a low-pass
    /// where it is coarser.
    #[arg(long, value_parser = parse_duration, value_name = "TIME")]
    pub resample: Option<f64>,
    /// Columns that keep their last sample when records are put on a grid, separated by commas: commands that are held.
    #[arg(long, value_delimiter = ',', value_name = "NAMES", requires = "resample")]
    pub held: Vec<String>,
    /// CSV files that only judge the model.
    #[arg(long, num_args = 1.., value_name = "FILE")]
    pub validate: Vec<PathBuf>,
    /// Trend that is removed first: nothing; the mean over the estimation files, which becomes the operating point of
    /// the model; or also the straight line of every file.
    #[arg(long, value_enum, default_value_t = DetrendChoice::None)]
    pub detrend: DetrendChoice,
    /// Folder for the results; it is made if it is not there.
    #[arg(short, long, value_name = "DIR", default_value = "out/identify")]
    pub output: PathBuf,
    /// Draw no figures.
    #[arg(long)]
    pub no_plots: bool,
    /// Print nothing but errors.
    #[arg(short, long)]
    pub quiet: bool,
}

/// `--detrend`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum DetrendChoice {
    /// Nothing; the model has its rest at zero.
    None,
    /// Mean over the estimation files.
    Mean,
    /// Mean, and the slope of every file.
    Linear,
}

impl From<DetrendChoice> for Detrend {
    fn from(choice: DetrendChoice) -> Detrend {
        match choice {
            DetrendChoice::None => Detrend::None,
            DetrendChoice::Mean => Detrend::Mean,
            DetrendChoice::Linear => Detrend::Linear,
        }
    }
}

impl DataArgs {
    /// Request for the records to read.
    pub fn request(&self) -> Request {
        Request {
            estimation: self.files.clone(),
            validation: self.validate.clone(),
            inputs: self.inputs.clone(),
            outputs: self.outputs.clone(),
            detrend: self.detrend.into(),
        }
    }

    /// Puts the files on the grid of `--resample` in a folder of their own, and names those instead.
    ///
    /// # Errors
    /// Same as [`resample::run`].
    pub fn resample_files(&mut self) -> Result<Option<TempDir>, Error> {
        let Some(step) = self.resample else { return Ok(None) };
        self.check_output(&[])?;
        let io = |source: std::io::Error| Error::OutputFolder {
            folder: std::env::temp_dir(),
            problem: source.to_string(),
        };
        let folder = scratch::folder().map_err(io)?;
        for (index, path) in self.files.iter_mut().chain(&mut self.validate).enumerate() {
            let name = path.file_name().unwrap_or_default();
            // Two files may have one name in different folders.
            let target = folder.path().join(index.to_string()).join(name);
            let notes = resample::write(path, &target, step, Method::Filter, &self.held)?;
            if !self.quiet {
                notes.iter().for_each(|note| output::to_stderr(&format!("note: {}: {note}", path.display())));
            }
            *path = target;
        }
        Ok(Some(folder))
    }

    /// Numbers of inputs and outputs.
    pub fn channels(&self) -> (usize, usize) {
        (self.inputs.len(), self.outputs.len())
    }

    /// Refuses a folder of results in which files of the user would be replaced, as far as the names of the results are
    /// known before the work: tables of the records, and `more`.
    ///
    /// # Errors
    /// [`Error::OutputFolder`].
    pub fn check_output(&self, more: &[String]) -> Result<(), Error> {
        let sets = [("estimation", self.files.len()), ("validation", self.validate.len())];
        let mut names: Vec<String> = sets.into_iter().flat_map(|(set, count)| tables(set, count)).collect();
        names.extend(["model.toml", "index.html", "summary.json"].map(str::to_owned));
        names.extend_from_slice(more);
        folder::check(&self.output, &self.inputs_read(), &names)
    }

    /// All files that are read.
    pub fn inputs_read(&self) -> Vec<PathBuf> {
        self.files.iter().chain(&self.validate).cloned().collect()
    }

    /// Reads and checks all files.
    ///
    /// # Errors
    /// A file that cannot be used, or files that do not belong together.
    pub fn read(&self) -> Result<Experiments, Error> {
        Ok(Experiments::read(&self.request())?)
    }

    /// Reads and checks all files; above a size, or if `stream` is set, they do not stay in memory.
    ///
    /// # Errors
    /// Same as [`DataArgs::read`].
    pub fn load(&self, stream: bool) -> Result<Loaded, Error> {
        let size = |path: &PathBuf| std::fs::metadata(path).map_or(0, |data| data.len());
        let all: u64 = self.files.iter().chain(&self.validate).map(size).sum();
        if !stream && all <= LARGEST_IN_MEMORY {
            return Ok(Loaded { data: self.read()?, files: None });
        }
        let (data, estimation, validation) = Experiments::stream(&self.request())?;
        Ok(Loaded { data, files: Some((estimation, validation)) })
    }
}

/// Names of the tables of a set of records: `estimation.csv`, or `estimation_1.csv` and so on.
pub fn tables(set: &str, count: usize) -> Vec<String> {
    match count {
        1 => vec![format!("{set}.csv")],
        _ => (1..=count).map(|index| format!("{set}_{index}.csv")).collect(),
    }
}

/// Files \[bytes\] that are kept in memory.
const LARGEST_IN_MEMORY: u64 = 1 << 30;

/// Experiments in memory or in files.
#[derive(Debug)]
pub struct Loaded {
    /// Names, units, operating point; the records, if they are in memory.
    pub data: Experiments,
    /// Estimation and validation in files, if they are not.
    files: Option<(Vec<FileSource>, Vec<FileSource>)>,
}

impl Loaded {
    /// Experiments of the estimation.
    pub fn estimation(&self) -> Vec<&dyn Source> {
        match &self.files {
            Some((estimation, _)) => estimation.iter().map(|file| file as &dyn Source).collect(),
            None => self.data.estimation.iter().map(|record| record as &dyn Source).collect(),
        }
    }

    /// Experiments of the validation.
    pub fn validation(&self) -> Vec<&dyn Source> {
        match &self.files {
            Some((_, validation)) => validation.iter().map(|file| file as &dyn Source).collect(),
            None => self.data.validation.iter().map(|record| record as &dyn Source).collect(),
        }
    }

    /// Operating point of inputs and outputs.
    pub fn offsets(&self) -> (&[f64], &[f64]) {
        (&self.data.input_offset, &self.data.output_offset)
    }

    /// Records of the estimation in memory.
    ///
    /// # Errors
    /// They are too long for it.
    pub fn records(&self) -> Result<&[Record], Error> {
        match self.files {
            Some(_) => Err(record::Error::NotInMemory.into()),
            None => Ok(&self.data.estimation),
        }
    }
}
