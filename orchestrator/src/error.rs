//! What a user of the library sees: one variant per module.

/// Any error of this library; the messages are those of the modules.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Files of signals.
    #[error(transparent)]
    Csv(#[from] crate::series::csv::Error),
    /// Signals.
    #[error(transparent)]
    Series(#[from] crate::series::Error),
    /// Units and durations.
    #[error(transparent)]
    Duration(#[from] crate::units::DurationError),
    /// FMUs.
    #[error(transparent)]
    Fmu(#[from] crate::fmu::Error),
    /// Derived FMUs.
    #[error(transparent)]
    Derive(#[from] crate::fmu::derive::DeriveError),
    /// FMUs to derive from.
    #[error(transparent)]
    Template(#[from] crate::fmu::template_folder::TemplateNotFound),
    /// Run summaries.
    #[error(transparent)]
    Summary(#[from] crate::results::summary::Error),
    /// Command signals.
    #[error(transparent)]
    Excite(#[from] crate::excite::Error),
    /// System descriptions.
    #[error(transparent)]
    System(#[from] crate::system::Error),
    /// Systems as one dynamics.
    #[error(transparent)]
    Coupled(#[from] crate::coupled::Error),
    /// Fits.
    #[error(transparent)]
    Fit(#[from] crate::ident::fit::Error),
    /// Records for an identification.
    #[error(transparent)]
    Record(#[from] crate::ident::record::Error),
    /// Orders of an ARX model.
    #[error(transparent)]
    Structure(#[from] crate::ident::structure::Error),
    /// Estimation of an ARX model.
    #[error(transparent)]
    Arx(#[from] crate::ident::arx::Error),
    /// Estimation of a state-space model.
    #[error(transparent)]
    Subspace(#[from] crate::ident::subspace::Error),
    /// Files of identified models.
    #[error(transparent)]
    Model(#[from] crate::ident::model::file::Error),
    /// Friction.
    #[error(transparent)]
    Friction(#[from] crate::ident::friction::Error),
    /// Columns of friction records.
    #[error(transparent)]
    Sweep(#[from] crate::ident::friction::read::Error),
    /// An FMU of an identified model.
    #[error("FMU `{name}`: {problem}")]
    LinearFmu {
        /// Name that was wanted.
        name: String,
        /// What is in the way, and the remedy.
        problem: String,
    },
    /// Output error.
    #[error(transparent)]
    Refinement(#[from] crate::ident::output_error::Error),
    /// Simulation.
    #[error(transparent)]
    Master(#[from] crate::master::Error),
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
        /// What is in the way.
        problem: String,
    },
    /// The standard output.
    #[error("the standard output cannot be written: {0}")]
    Output(std::io::Error),
    /// Missing effects.
    #[error(transparent)]
    Refine(#[from] crate::refine::Error),
    /// Plans.
    #[error(transparent)]
    Plan(#[from] crate::plan::Error),
    /// Amended systems.
    #[error(transparent)]
    Amend(#[from] crate::refine::amend::Error),
    /// Reports.
    #[error(transparent)]
    Report(#[from] crate::report::Error),
    /// Figures.
    #[error(transparent)]
    Plot(#[from] crate::plot::Error),
}
