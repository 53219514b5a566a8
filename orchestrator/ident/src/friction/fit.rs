//! Fit of one friction law: bounds, several starts, uncertainty.

use nalgebra::DMatrix;

use super::law::{C2, C3, E1, E2, Law, MASS, Parameters, SIZE};
use super::low_pass::LowPass;
use super::predict::{self, Predict};
use super::track::Track;
use super::{Error, Mass, Settings};
use airloop_optim::least_squares::{self, Problem, Solution, multi_start, solve};

/// Origin of the value of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// From the data.
    Estimated,
    /// From the data, which push it against a bound.
    AtBound,
    /// Given.
    Fixed,
}

/// A fitted law.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Law.
    pub law: Law,
    /// Its parameters.
    pub parameters: Parameters,
    /// Origin of each value.
    pub origin: [Origin; SIZE],
    /// Standard deviation of each; none where the data do not determine it.
    pub deviation: [Option<f64>; SIZE],
    /// Covariance of all, shape \[8, 8\], if the data determine all of them.
    pub covariance: Option<DMatrix<f64>>,
    /// Parameters that the data cannot distinguish.
    pub dependent: Vec<usize>,
    /// Errors by track.
    pub errors: Vec<Vec<f64>>,
    /// Samples after which an error no longer resembles itself; 1 for white errors.
    pub memory: f64,
    /// Share of the starts that reached the same minimum.
    pub agreement: f64,
    /// Whether the method says it is at a minimum.
    pub converged: bool,
}

/// Samples of all tracks that the search from several starts uses; the last fit uses all.
const SEARCH_SAMPLES: usize = 1000;

/// Sizes that bounds and starts are relative to.
struct Sizes {
    force: f64,
    mean_force: f64,
    velocity: f64,
    top_velocity: f64,
    travel: f64,
    pressure: f64,
    acceleration: f64,
}

impl Sizes {
    fn of(tracks: &[Track]) -> Sizes {
        let largest = |of: &dyn Fn(&Track) -> f64| tracks.iter().map(of).fold(0.0, f64::max);
        let top = |values: &[f64]| values.iter().fold(0.0, |top: f64, value| top.max(value.abs()));
        let all = |of: &dyn Fn(&Track) -> &[f64]| -> (f64, f64) {
            let n: usize = tracks.iter().map(|track| of(track).len()).sum();
            let sum = |f: &dyn Fn(f64) -> f64| {
                tracks.iter().flat_map(|track| of(track).iter().map(|v| f(*v))).sum::<f64>()
            };
            let mean = sum(&|v| v) / n.max(1) as f64;
            (mean, (sum(&|v| v * v) / n.max(1) as f64).sqrt())
        };
        let (mean_force, force) = all(&|track| &track.force);
        let (_, velocity) = all(&|track| &track.motion.velocity);
        let (_, acceleration) = all(&|track| &track.motion.acceleration);
        let floor = |value: f64| value.max(1e-12);
        Sizes {
            force: floor(force),
            mean_force,
            velocity: floor(velocity),
            top_velocity: floor(largest(&|track| top(&track.motion.velocity))),
            travel: floor(largest(&|track| top(&track.motion.position))),
            pressure: floor(largest(&|track| top(&track.pressure))),
            acceleration: floor(acceleration),
        }
    }
}

/// Bounds, scales and first guess of one fit.
struct Space {
    lower: Parameters,
    upper: Parameters,
    scale: Parameters,
    guess: Parameters,
}

impl Space {
    fn of(law: Law, sizes: &Sizes, settings: &Settings) -> Space {
        let (f, v) = (sizes.force, sizes.velocity);
        let most = 100.0 * f;
        let mut space = Space {
            lower: [0.0, 0.0, -sizes.top_velocity, 0.0, -most, 0.0, 0.0, 0.0],
            upper: [most, 1e3 / v, sizes.top_velocity, most / v, most, 0.0, 0.0, 0.0],
            scale: [f, 1.0 / v, 0.1 * v, f / v, f, f / sizes.acceleration, 1.0, 1.0],
            guess: [0.5 * f, 5.0 / v, 0.0, 0.3 * f / v, sizes.mean_force, 0.0, 0.0, 0.0],
        };
        match settings.mass {
            Mass::None => {}
            Mass::Given(mass) => space.fix(MASS, mass),
            Mass::Fit => {
                let usual = f / sizes.acceleration;
                let least = if settings.predict == Predict::Force { 0.0 } else { 1e-3 * usual };
                space.set(MASS, least, 1e3 * usual, usual, 0.3 * usual);
            }
        }
        match law {
            Law::CoulombViscous => {}
            Law::Stribeck => {
                space.set(E1, 0.0, most, f, 0.3 * f);
                let top = sizes.top_velocity;
                space.set(E2, 1e-4 * top, 2.0 * top, 0.1 * top, 0.2 * v);
            }
            Law::Pressure => {
                let unit = f / sizes.pressure;
                space.set(E1, 0.0, 100.0 * unit, unit, 0.1 * unit);
            }
            Law::PositionCoulomb | Law::Spring => {
                let unit = f / sizes.travel;
                space.set(E1, -100.0 * unit, 100.0 * unit, unit, 0.0);
            }
            Law::Asymmetry => {
                space.set(E1, -most / v, most / v, f / v, 0.0);
            }
            Law::Presliding => {
                space.set(E1, 1e-6 * sizes.travel, sizes.travel, 1e-3 * sizes.travel, 3e-3 * sizes.travel);
                // The distance takes the place of the slope, which only says where the spring begins.
                space.fix(C2, 1e3 / v);
            }
        }
        for &(index, value) in &settings.fixed {
            space.fix(index, value);
        }
        space
    }

    fn set(&mut self, index: usize, lower: f64, upper: f64, scale: f64, guess: f64) {
        (self.lower[index], self.upper[index]) = (lower, upper);
        (self.scale[index], self.guess[index]) = (scale, guess);
    }

    fn fix(&mut self, index: usize, value: f64) {
        let scale = if value == 0.0 { 1.0 } else { value.abs() };
        self.set(index, value, value, scale, value);
    }

    /// Starts that differ in what enters nonlinearly: slope and place of the sign change, and the extension.
    fn starts(&self, law: Law, from: Option<&Parameters>, sizes: &Sizes) -> Vec<Parameters> {
        let mut starts = Vec::new();
        if let Some(declared) = from {
            let mut start = *declared;
            (start[E1], start[E2]) = (self.guess[E1], self.guess[E2]);
            starts.push(start);
        }
        let reach: &[f64] = match law {
            Law::Stribeck => &[0.1, 0.5],
            Law::Presliding => &[1e-4, 1e-3, 1e-2],
            _ => &[1.0],
        };
        for slope in [2.0, 10.0, 50.0] {
            for shift in [-0.1, 0.0, 0.1] {
                for reach in reach {
                    let mut start = self.guess;
                    start[C2] = slope / sizes.velocity;
                    start[C3] = shift * sizes.velocity;
                    match law {
                        Law::Stribeck => start[E2] = reach * sizes.velocity,
                        Law::Presliding => start[E1] = reach * sizes.travel,
                        _ => {}
                    }
                    starts.push(start);
                }
            }
        }
        starts
    }
}

/// Result of a search from several starts.
#[derive(Debug, Clone)]
pub struct Found {
    /// Parameters of the smallest sum of squares.
    pub parameters: Parameters,
    /// Sum of squares reached from each start.
    costs: Vec<Option<f64>>,
}

/// Searches the parameters of a law from several starts, for long records on part of their samples; `from` is an
/// earlier fit of a simpler law.
///
/// # Errors
/// [`Error::Fit`] if nothing can be computed.
pub fn search(
    law: Law,
    tracks: &[Track],
    settings: &Settings,
    from: Option<&Parameters>,
) -> Result<Found, Error> {
    let sizes = Sizes::of(tracks);
    let space = Space::of(law, &sizes, settings);
    let all: usize = tracks.iter().map(Track::len).sum();
    // A spring that remembers has to be followed more closely.
    let samples = if law == Law::Presliding { 5 * SEARCH_SAMPLES } else { SEARCH_SAMPLES };
    let step = if settings.predict == Predict::Force { (all / samples).max(1) } else { 1 };
    let thinned: Vec<Track> = tracks.iter().map(|track| track.thinned(step)).collect();
    // A low-pass belongs to the full rate.
    let low_pass = settings.low_pass.filter(|_| step == 1);
    let settings = Settings { low_pass, ..settings.clone() };
    let starts: Vec<Vec<f64>> = space.starts(law, from, &sizes).iter().map(|start| start.to_vec()).collect();
    let rough = least_squares::Settings {
        max_iterations: 60,
        cost_tolerance: 1e-8,
        ..least_squares::Settings::default()
    };
    let (found, costs) =
        with_problem(law, &thinned, &settings, &space, |problem| multi_start(problem, &starts, &rough))?;
    let mut parameters: Parameters = [0.0; SIZE];
    parameters.copy_from_slice(&found.parameters);
    Ok(Found { parameters, costs })
}

/// Fits a law to all samples from where a search ended.
///
/// # Errors
/// Same as [`search`].
pub fn refine(law: Law, tracks: &[Track], settings: &Settings, found: &Found) -> Result<Fit, Error> {
    let space = Space::of(law, &Sizes::of(tracks), settings);
    let exact = least_squares::Settings { cost_tolerance: 1e-12, ..least_squares::Settings::default() };
    let best =
        with_problem(law, tracks, settings, &space, |problem| solve(problem, &found.parameters, &exact))?;
    Ok(assess(law, tracks, settings, &space, &best, &found.costs))
}

fn with_problem<T>(
    law: Law,
    tracks: &[Track],
    settings: &Settings,
    space: &Space,
    solve: impl FnOnce(&Problem) -> Result<T, least_squares::Error>,
) -> Result<T, Error> {
    let counts: Vec<usize> = tracks.iter().map(|track| predict::count(&settings.predict, track)).collect();
    let filters: Vec<Option<LowPass>> = tracks.iter().map(|track| settings.filter(track)).collect();
    let evaluate = |p: &[f64], r: &mut [f64]| {
        let mut c: Parameters = [0.0; SIZE];
        c.copy_from_slice(p);
        let mut at = 0;
        tracks.iter().zip(&counts).zip(&filters).all(|((track, count), filter)| {
            let part = &mut r[at..at + count];
            at += count;
            predict::errors(&settings.predict, law, &c, track, filter.as_ref(), part)
        })
    };
    let problem = Problem {
        residuals: counts.iter().sum(),
        lower: &space.lower,
        upper: &space.upper,
        scale: &space.scale,
        evaluate: &evaluate,
        jacobian: None,
    };
    solve(&problem).map_err(Error::Fit)
}

/// Uncertainty and errors of what was found.
fn assess(
    law: Law,
    tracks: &[Track],
    settings: &Settings,
    space: &Space,
    found: &Solution,
    costs: &[Option<f64>],
) -> Fit {
    let mut parameters: Parameters = [0.0; SIZE];
    parameters.copy_from_slice(&found.parameters);
    let fixed = |j: usize| space.lower[j] == space.upper[j];
    let origin = std::array::from_fn(|j| match (fixed(j), found.held[j]) {
        (true, _) => Origin::Fixed,
        (_, true) => Origin::AtBound,
        _ => Origin::Estimated,
    });
    let errors = errors_of(law, &parameters, tracks, settings);
    let memory = memory(&errors);
    // A parameter at its bound has an uncertainty all the same: how large might it be?
    let free = Solution { held: (0..SIZE).map(fixed).collect(), ..found.clone() };
    let scaled = |covariance: DMatrix<f64>| covariance * memory;
    let (covariance, dependent) = match free.covariance().map(scaled) {
        Ok(covariance) => (Some(covariance), Vec::new()),
        Err(least_squares::Error::Dependent { indices }) => (found.covariance().map(scaled).ok(), indices),
        Err(_) => (None, Vec::new()),
    };
    let deviation = std::array::from_fn(|j| {
        let variance = covariance.as_ref().map(|covariance| covariance[(j, j)]);
        variance.filter(|_| !fixed(j) && !dependent.contains(&j)).map(f64::sqrt)
    });
    let lowest = costs.iter().flatten().copied().fold(f64::INFINITY, f64::min);
    let alike = costs.iter().flatten().filter(|cost| **cost <= lowest * (1.0 + 1e-4)).count();
    let agreement = alike as f64 / costs.len().max(1) as f64;
    let converged = found.status.converged();
    Fit { law, parameters, origin, deviation, covariance, dependent, errors, memory, agreement, converged }
}

/// Errors of parameters on tracks, shape \[tracks\]\[samples\], in N or m as `settings` predict; NaN where the
/// prediction fails.
pub fn errors_of(law: Law, c: &Parameters, tracks: &[Track], settings: &Settings) -> Vec<Vec<f64>> {
    tracks
        .iter()
        .map(|track| {
            let mut errors = vec![0.0; predict::count(&settings.predict, track)];
            let filter = settings.filter(track);
            if !predict::errors(&settings.predict, law, c, track, filter.as_ref(), &mut errors) {
                errors.fill(f64::NAN);
            }
            errors
        })
        .collect()
}

/// Sum of the autocorrelation of errors \[records\]\[samples\] up to the lag where it falls below 0.05: the factor, at
/// least 1, by which fewer samples count.
pub fn memory(errors: &[Vec<f64>]) -> f64 {
    let squares: f64 = errors.iter().flatten().map(|e| e * e).sum();
    let longest = errors.iter().map(Vec::len).max().unwrap_or(0) / 4;
    let mut memory = 1.0;
    for lag in 1..longest {
        let product: f64 =
            errors.iter().map(|e| e.iter().zip(e.iter().skip(lag)).map(|(a, b)| a * b).sum::<f64>()).sum();
        let correlation = product / squares;
        if correlation.is_nan() || correlation < 0.05 {
            break;
        }
        memory += 2.0 * correlation;
    }
    memory
}

/// Root mean square of all errors \[records\]\[samples\], in their unit; 0 for none.
pub fn rms(errors: &[Vec<f64>]) -> f64 {
    let n: usize = errors.iter().map(Vec::len).sum();
    (errors.iter().flatten().map(|e| e * e).sum::<f64>() / n.max(1) as f64).sqrt()
}
