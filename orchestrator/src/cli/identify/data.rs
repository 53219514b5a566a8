//! Options that say which data, and where the results go.

#![allow(
    rustdoc::broken_intra_doc_links,
    reason = "these texts are the help of the program, brackets are units"
)]

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::Error;
use crate::ident::record::set::Request;
use crate::ident::record::{Detrend, Experiments};

/// Which data, and where the results go.
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
    /// CSV files that only judge the model.
    #[arg(long, num_args = 1.., value_name = "FILE")]
    pub validate: Vec<PathBuf>,
    /// What is taken away first: nothing; the mean over the estimation files, which becomes the operating point of
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
    /// What is to be read.
    pub fn request(&self) -> Request {
        Request {
            estimation: self.files.clone(),
            validation: self.validate.clone(),
            inputs: self.inputs.clone(),
            outputs: self.outputs.clone(),
            detrend: self.detrend.into(),
        }
    }

    /// Numbers of inputs and outputs.
    pub fn channels(&self) -> (usize, usize) {
        (self.inputs.len(), self.outputs.len())
    }

    /// Reads and checks all files.
    ///
    /// # Errors
    /// A file that cannot be used, or files that do not belong together.
    pub fn read(&self) -> Result<Experiments, Error> {
        Ok(Experiments::read(&self.request())?)
    }
}
