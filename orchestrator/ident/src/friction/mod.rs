//! Friction (paper eq. 2) from records of force and motion.
//!
//! | module | what |
//! |--------|------|
//! | [`track`] | records and their smoothed motion |
//! | [`read`] | columns of a series to a record in SI units |
//! | [`smoother`] | position, velocity, acceleration with uncertainty |
//! | [`law`] | eq. 2 and what may be added to it |
//! | [`predict`] | errors of a law: force from motion, or motion from force |
//! | [`fit`] | bounded least squares from several starts, intervals |
//! | [`curve`] | force over velocity with its band |
//! | [`report`] | fits, flags, alternatives, verdict |
//!
//! Noise in the velocity would flatten the sign change of eq. 2 (errors in variables). Here the smoothed velocity is a
//! conditional mean with a known spread, and the fit compares with the mean of the friction over that spread.
//! Start with [`report::identify`].

pub mod curve;
pub mod fit;
pub mod law;
mod low_pass;
pub mod predict;
pub mod read;
pub mod report;
pub mod smoother;
#[cfg(test)]
mod tests;
pub mod track;
mod verdict;

pub use law::Law;
pub use low_pass::LowPass;
pub use predict::Predict;
pub use track::{Sweep, Track};

/// Knowledge of the moving mass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mass {
    /// Inertia is left out: quasi-static records.
    None,
    /// Known \[kg\].
    Given(f64),
    /// Estimated.
    Fit,
}

/// Settings of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Friction law.
    pub law: Law,
    /// Parameters held at values, by place in [`law::Parameters`].
    pub fixed: Vec<(usize, f64)>,
    /// Moving mass.
    pub mass: Mass,
    /// Area \[m2\] on which the pressure adds to the force.
    pub area: f64,
    /// Predicted quantity.
    pub predict: Predict,
    /// Compare forces below this frequency \[Hz\] only.
    pub low_pass: Option<f64>,
    /// Smooth the motion; else a measured velocity is taken as it is.
    pub smooth: bool,
    /// Try what may be added to eq. 2, if there are validation records.
    pub alternatives: bool,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            law: Law::CoulombViscous,
            fixed: Vec::new(),
            mass: Mass::None,
            area: 0.0,
            predict: Predict::Force,
            low_pass: None,
            smooth: true,
            alternatives: true,
        }
    }
}

impl Settings {
    fn filter(&self, track: &Track) -> Option<LowPass> {
        let n = track.len();
        let span = track.time.last().zip(track.time.first()).map_or(0.0, |(last, first)| last - first);
        self.low_pass.and_then(|corner| LowPass::new(corner, span / n.saturating_sub(1).max(1) as f64))
    }
}

/// Reason why friction cannot be identified.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "record and value, as named in each message")]
pub enum Error {
    /// Nothing to fit.
    #[error("there is no record to estimate friction from; give at least one CSV file")]
    NoRecord,
    /// Too short.
    #[error("{record}: {samples} samples are too few; at least {} are needed", track::MIN_SAMPLES)]
    Short { record: String, samples: usize },
    /// No motion.
    #[error(
        "{record}: neither velocity nor position is measured; name the column with --velocity or --position"
    )]
    NoMotion { record: String },
    /// Nothing moves.
    #[error("{record}: the {what} stays at {value}; friction shows only in motion, in both directions")]
    Still { record: String, what: &'static str, value: f64 },
    /// No mass to move.
    #[error("predicting the motion needs the moving mass; give --mass or --fit-mass")]
    NoMass,
    /// Low-pass above what is sampled.
    #[error(
        "{record}: the low-pass at {corner} Hz is not below half the sample rate, {nyquist} Hz; lower it"
    )]
    LowPass { record: String, corner: f64, nyquist: f64 },
    /// The law needs a signal.
    #[error("the law `{law}` needs the {what}; name its column")]
    Missing { law: &'static str, what: &'static str },
    /// A parameter that the law does not have.
    #[error("the law has no parameter `{name}`; it has {}", known.join(", "))]
    Parameter { name: String, known: Vec<&'static str> },
    /// The FMU knows eq. 2 only.
    #[error(
        "the FMU `friction` holds eq. 2; the law `{law}` has none. Leave --fmu out, or take the law coulomb-viscous"
    )]
    NoFmu { law: &'static str },
    /// The fit.
    #[error("the fit of the friction law failed: {0}")]
    Fit(airloop_optim::least_squares::Error),
}
