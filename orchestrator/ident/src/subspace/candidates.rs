//! Models of one order from every weighting, horizon and realization, and the best of them.

use nalgebra::DMatrix;

use super::data::{Matrices, Segment};
use super::gain::{prediction_error_gain, riccati_gain};
use super::hankel::HankelFactor;
use super::input_terms::{input_terms, simulation_error};
use super::projection::{Projection, Weighting, predictor, pseudo_inverse};
use super::realization::{Realization, realize, spectral_radius, stabilized};
use super::riccati::{Noise, kalman_gain};
use rayon::prelude::*;

/// Samples on which candidates are compared; longer data are represented by pieces spread over them.
pub(super) const COMPARED_SAMPLES: usize = 16_000;
/// Samples on which the innovation gain is fitted.
const GAIN_SAMPLES: usize = 8_000;

/// Method by which a model was estimated.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Method {
    /// Weighting of the projection.
    pub weighting: Weighting,
    /// Past and future samples of the block Hankel matrices.
    pub horizon: usize,
    /// Method by which A and C are found.
    pub realization: Realization,
    /// Whether poles outside the unit circle were mirrored at it.
    pub stabilized: bool,
}

impl Method {
    /// In words.
    pub fn describe(&self) -> String {
        let weighting = match self.weighting {
            Weighting::N4sid => "N4SID",
            Weighting::Moesp => "MOESP",
            Weighting::Cva => "CVA",
        };
        let realization = match self.realization {
            Realization::Shift => "shift invariance",
            Realization::States => "state regression",
        };
        format!("{weighting}, {} past and future samples, {realization}", self.horizon)
    }
}

/// A model with its error on the compared samples.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Candidate {
    pub method: Method,
    pub model: Matrices,
    pub stable: bool,
    /// Mean over the outputs of the relative RMS error of the simulation (100 (1 - error) is about the fit, eq. 9).
    pub error: f64,
}

/// Projections of one horizon.
struct Horizon {
    factor: HankelFactor,
    projections: Vec<(Weighting, Projection)>,
}

/// All that is needed to estimate models of any order.
pub(super) struct Candidates<'a> {
    segments: &'a [Segment],
    compared: Vec<Segment>,
    horizons: Vec<Horizon>,
    direct: bool,
    mirror: bool,
}

impl<'a> Candidates<'a> {
    /// Factorizes the segments once, for the longest of `horizons` (increasing).
    pub fn new(
        segments: &'a [Segment],
        horizons: &[usize],
        weightings: &[Weighting],
        direct: bool,
        mirror: bool,
    ) -> Candidates<'a> {
        let factor = HankelFactor::new(segments, horizons.iter().copied().max().unwrap_or(1));
        let one = |&horizon: &usize| {
            let factor = factor.shorter(horizon);
            let predictor = predictor(&factor);
            let projections = weightings
                .iter()
                .map(|&weighting| (weighting, Projection::new(&factor, weighting, &predictor)))
                .collect();
            Horizon { factor, projections }
        };
        let horizons = horizons.par_iter().map(one).collect();
        let compared = super::data::sparse(segments, COMPARED_SAMPLES);
        Candidates { segments, compared, horizons, direct, mirror }
    }

    /// Singular values of the past and future inputs of the longest horizon.
    pub fn input_singular_values(&self) -> Vec<f64> {
        self.horizons.last().map_or_else(Vec::new, |horizon| horizon.factor.input_singular_values())
    }

    /// Singular values of one projection.
    pub fn singular_values(&self, method: &Method) -> Vec<f64> {
        self.projection(method)
            .map_or_else(Vec::new, |(_, projection)| projection.singular_values.iter().copied().collect())
    }

    /// Highest order that any projection shows.
    pub fn rank(&self) -> usize {
        let ranks =
            self.horizons.iter().flat_map(|horizon| horizon.projections.iter().map(|(_, p)| p.rank()));
        ranks.max().unwrap_or(0)
    }

    fn projection(&self, method: &Method) -> Option<(&Horizon, &Projection)> {
        let horizon = self.horizons.iter().find(|horizon| horizon.factor.horizon == method.horizon)?;
        let (_, projection) = horizon.projections.iter().find(|(of, _)| *of == method.weighting)?;
        Some((horizon, projection))
    }

    /// Models of order n, the best first: stable ones before others, then by their error.
    pub fn of_order(&self, n: usize) -> Vec<Candidate> {
        let mut methods = Vec::new();
        for horizon in &self.horizons {
            for (weighting, projection) in &horizon.projections {
                let shifted = (horizon.factor.horizon - 1) * horizon.factor.n_y;
                if n <= projection.rank() && n <= shifted {
                    for realization in Realization::ALL {
                        let horizon = horizon.factor.horizon;
                        methods.push(Method {
                            weighting: *weighting,
                            horizon,
                            realization,
                            stabilized: false,
                        });
                    }
                }
            }
        }
        let mut found: Vec<Candidate> =
            methods.par_iter().filter_map(|method| self.candidate(*method, n)).collect();
        found.sort_by(|a, b| b.stable.cmp(&a.stable).then(a.error.total_cmp(&b.error)));
        found
    }

    fn candidate(&self, mut method: Method, n: usize) -> Option<Candidate> {
        let (horizon, projection) = self.projection(&method)?;
        let (mut a, c) = realize(&horizon.factor, projection, method.realization, n);
        if !a.iter().chain(&c).all(|value| value.is_finite()) {
            return None;
        }
        let mut stable = spectral_radius(&a) < 1.0;
        if !stable && self.mirror {
            a = stabilized(&a)?;
            (stable, method.stabilized) = (true, true);
        }
        let model = self.with_input_terms(&self.compared, &a, &c)?;
        let error = if stable { relative_error(&self.compared, &model) } else { f64::INFINITY };
        (!error.is_nan()).then_some(Candidate { method, model, stable, error })
    }

    /// B and D from the given segments; for unstable A through a stable observer.
    fn with_input_terms(&self, segments: &[Segment], a: &DMatrix<f64>, c: &DMatrix<f64>) -> Option<Matrices> {
        let (n, n_y) = (a.nrows(), c.nrows());
        let observer = if spectral_radius(a) < 1.0 {
            None
        } else {
            let noise = Noise {
                q: DMatrix::identity(n, n),
                s: DMatrix::zeros(n, n_y),
                r: DMatrix::identity(n_y, n_y),
            };
            Some(kalman_gain(a, c, &noise)?)
        };
        input_terms(segments, a, c, observer.as_ref(), self.direct)
    }

    /// The candidate with B and D from all samples.
    pub fn on_all_samples(&self, candidate: &Candidate) -> Option<Matrices> {
        self.with_input_terms(self.segments, &candidate.model.a, &candidate.model.c)
    }

    /// Innovation gain of any model of these data, in the state basis of the model.
    pub fn gain(&self, method: &Method, model: &Matrices) -> Option<DMatrix<f64>> {
        let (horizon, _) = self.projection(method)?;
        let f = horizon.factor.horizon;
        let (n, n_y) = (model.a.nrows(), model.c.nrows());
        let mut gamma = DMatrix::zeros(f * n_y, n);
        let mut block = model.c.clone();
        for row in 0..f {
            gamma.view_mut((row * n_y, 0), (n_y, n)).copy_from(&block);
            block = &block * &model.a;
        }
        let state = pseudo_inverse(gamma) * predictor(&horizon.factor);
        let mut starts: Vec<DMatrix<f64>> =
            riccati_gain(&horizon.factor, model, &state).into_iter().collect();
        if spectral_radius(&model.a) < 1.0 {
            starts.push(DMatrix::zeros(n, n_y));
        }
        let some = super::data::sparse(self.segments, GAIN_SAMPLES);
        prediction_error_gain(&some, model, &starts)
    }
}

/// Mean over the outputs of the relative RMS error of the simulation.
pub(super) fn relative_error(segments: &[Segment], model: &Matrices) -> f64 {
    let squares = simulation_error(segments, model);
    let n_y = squares.len();
    let mean = |i: usize| {
        let energy: f64 =
            segments.iter().map(|segment| segment.y.row(i).iter().map(|y| y * y).sum::<f64>()).sum();
        (squares[i] / energy).sqrt()
    };
    (0..n_y).map(mean).sum::<f64>() / n_y as f64
}
