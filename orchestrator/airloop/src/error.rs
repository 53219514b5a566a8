//! Errors that a user of the library sees: one variant per module.

/// Any error of this library; the messages are those of the modules.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Files of signals.
    #[error(transparent)]
    Csv(#[from] airloop_series::csv::Error),
    /// Signals.
    #[error(transparent)]
    Series(#[from] airloop_series::Error),
    /// Units and durations.
    #[error(transparent)]
    Duration(#[from] airloop_series::units::DurationError),
    /// FMUs.
    #[error(transparent)]
    Fmu(#[from] airloop_fmi::Error),
    /// Derived FMUs.
    #[error(transparent)]
    Derive(#[from] airloop_fmi::derive::DeriveError),
    /// Systems as FMUs.
    #[error(transparent)]
    SystemFmu(#[from] airloop_system::Error),
    /// FMUs to derive from.
    #[error(transparent)]
    Template(#[from] airloop_fmi::template_folder::TemplateNotFound),
    /// Run summaries.
    #[error(transparent)]
    Summary(#[from] airloop_cosim::results::summary::Error),
    /// Saved states of runs.
    #[error(transparent)]
    States(#[from] airloop_cosim::results::states::Error),
    /// Command signals.
    #[error(transparent)]
    Excite(#[from] airloop_ident::excite::Error),
    /// System descriptions.
    #[error(transparent)]
    System(#[from] airloop_cosim::system::Error),
    /// Systems as one dynamics.
    #[error(transparent)]
    Coupled(#[from] airloop_cosim::coupled::Error),
    /// Fits.
    #[error(transparent)]
    Fit(#[from] airloop_ident::fit::Error),
    /// Records for an identification.
    #[error(transparent)]
    Record(#[from] airloop_ident::record::Error),
    /// Orders of an ARX model.
    #[error(transparent)]
    Structure(#[from] airloop_ident::structure::Error),
    /// Estimation of an ARX model.
    #[error(transparent)]
    Arx(#[from] airloop_ident::arx::Error),
    /// Estimation of a state-space model.
    #[error(transparent)]
    Subspace(#[from] airloop_ident::subspace::Error),
    /// Files of identified models.
    #[error(transparent)]
    Model(#[from] airloop_ident::model::file::Error),
    /// Friction.
    #[error(transparent)]
    Friction(#[from] airloop_ident::friction::Error),
    /// Columns of friction records.
    #[error(transparent)]
    Sweep(#[from] airloop_ident::friction::read::Error),
    /// An FMU of an identified model.
    #[error("FMU `{name}`: {problem}")]
    LinearFmu {
        /// Name that was wanted.
        name: String,
        /// Obstacle and remedy.
        problem: String,
    },
    /// Output error.
    #[error(transparent)]
    Refinement(#[from] airloop_ident::output_error::Error),
    /// Simulation.
    #[error(transparent)]
    Master(#[from] airloop_cosim::master::Error),
    /// Measurement against simulation.
    #[error(transparent)]
    Discrepancy(#[from] crate::discrepancy::Error),
    /// Virtual rig.
    #[error(transparent)]
    Rig(#[from] crate::rig::Error),
    /// The folder of the results.
    #[error("output folder {}: {problem}", folder.display())]
    OutputFolder {
        /// Folder.
        folder: std::path::PathBuf,
        /// Obstacle.
        problem: String,
    },
    /// A single file that is to be written.
    #[error("output file {}: {problem}", file.display())]
    OutputFile {
        /// File.
        file: std::path::PathBuf,
        /// Obstacle.
        problem: String,
    },
    /// A record cannot be put on a grid.
    #[error("{}: {problem}", file.display())]
    Resample {
        /// File.
        file: std::path::PathBuf,
        /// Problem of the grid.
        problem: airloop_series::uniform::Problem,
    },
    /// The standard output.
    #[error("the standard output cannot be written: {0}")]
    Output(std::io::Error),
    /// Missing effects.
    #[error(transparent)]
    Refine(#[from] airloop_refine::Error),
    /// New studies.
    #[error(transparent)]
    NewStudy(#[from] crate::new_study::Error),
    /// Plans.
    #[error(transparent)]
    Plan(#[from] airloop_plan::Error),
    /// Amended systems.
    #[error(transparent)]
    Amend(#[from] airloop_refine::amend::Error),
    /// Reports.
    #[error(transparent)]
    Report(#[from] airloop_report::Error),
    /// Figures.
    #[error(transparent)]
    Plot(#[from] airloop_report::plot::Error),
}
