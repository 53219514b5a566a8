//! Least squares of ARX models (Ljung, System Identification, section 7.3) by QR.
//!
//! Every output has an equation of its own with all outputs in it (full matrices, eq. 6 to 8); all equations share one
//! triangle. What cannot be told apart is named, not regularized.

use nalgebra::DMatrix;

use super::model::Arx;
use super::parameters::Parameters;
use super::record;
use super::regressor::Regression;
use super::source::Source;
use super::structure::{Structure, Term};
use airloop_optim::linalg::Triangle;
use airloop_optim::linalg::qr::Dependent;

/// Residual of a column relative to its size, below which it counts as a combination of others: rounding in data of
/// double precision and in the triangle.
pub const RANK_TOLERANCE: f64 = 1e-12;

/// Reason why a model cannot be estimated.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "names and numbers, as in each message")]
pub enum Error {
    /// Reading.
    #[error(transparent)]
    Record(#[from] record::Error),
    /// Orders.
    #[error(transparent)]
    Structure(#[from] super::structure::Error),
    /// More coefficients than data.
    #[error(
        "{rows} equations (samples after the first {lags} of each record) are too few for {parameters} coefficients per output; lower na and nb, or record more"
    )]
    TooFew { rows: u64, lags: usize, parameters: usize },
    /// Values whose squares cannot be added up.
    #[error(
        "the sums of squares of the data overflow or are not finite; scale the signals to units in which they are between 1e-100 and 1e100"
    )]
    NotFinite,
    /// No structure of a search can be estimated.
    #[error("--order auto: no structure can be estimated; the first reason: {problem}")]
    NoStructure { problem: String },
    /// No structure of a search can be simulated.
    #[error(
        "--order auto: none of the {estimated} structures that can be estimated is stable, so none can be simulated and judged; use --detrend mean if means are large against the spread of the signals, try wider --na, --nb and --nk, or give the orders (--na 2 --nb 2) to get the unstable model: the plant itself may be unstable"
    )]
    NoneStable { estimated: usize },
    /// No structure of a search has a simulated fit.
    #[error(
        "--order auto: no structure has a simulated fit on the judging data (--validate, or else the last third of each file): an output does not move there, or a file is shorter than the orders; give other judging data, or the orders themselves (--na 2 --nb 2)"
    )]
    NotJudged,
    /// A regressor that others explain exactly.
    #[error("{regressor} {combination}, so the coefficients of {output} cannot be told apart; {remedy}")]
    RankDeficient { regressor: String, combination: String, output: String, remedy: &'static str },
}

/// Names of the signals, for messages.
#[derive(Debug, Clone, Copy)]
pub struct Names<'a> {
    /// Inputs, shape \[n_u\].
    pub inputs: &'a [String],
    /// Outputs, shape \[n_y\].
    pub outputs: &'a [String],
}

/// The equation of one output.
#[derive(Debug, Clone, PartialEq)]
pub struct Equation {
    /// Regressors.
    pub terms: Vec<Term>,
    /// Their coefficients: the entries of A and B.
    pub coefficients: Vec<f64>,
    /// Triangle of the regressors, the first columns of it.
    pub triangle: Triangle,
    /// Variance of the equation error e, in the squared unit of the output.
    pub noise_variance: f64,
}

impl Equation {
    /// Standard deviations of the coefficients, shape \[terms\], for white equation noise.
    pub fn standard_deviations(&self) -> Vec<f64> {
        self.covariance().diagonal().iter().map(|variance| variance.sqrt()).collect()
    }

    /// Covariance of the coefficients, shape \[terms, terms\], for white equation noise.
    pub fn covariance(&self) -> DMatrix<f64> {
        self.triangle.inverse_gram(self.terms.len()) * self.noise_variance
    }

    /// Condition number (2-norm) of the regressors, each scaled to norm 1.
    pub fn condition(&self) -> f64 {
        self.triangle.scaled_condition(self.terms.len())
    }
}

/// An estimated model.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// The model.
    pub model: Arx,
    /// Its structure.
    pub structure: Structure,
    /// One equation per output.
    pub equations: Vec<Equation>,
    /// Covariance of the equation errors, shape \[n_y, n_y\].
    pub noise_covariance: DMatrix<f64>,
    /// Rows of the regression.
    pub rows: u64,
}

impl Estimate {
    /// Coefficients `A1[i,j]` .., `B0[i,j]` .. with their covariance, for white equation noise. Covariances between the
    /// equations of different outputs are left at zero.
    pub fn parameters(&self) -> Parameters {
        let entry = |output: usize, term: &Term| match *term {
            Term::Output { channel, lag } => format!("A{lag}[{},{}]", output + 1, channel + 1),
            Term::Input { channel, lag } => format!("B{lag}[{},{}]", output + 1, channel + 1),
        };
        let (mut names, mut values) = (Vec::new(), Vec::new());
        let mut starts = Vec::new();
        for (output, equation) in self.equations.iter().enumerate() {
            starts.push(names.len());
            names.extend(equation.terms.iter().map(|term| entry(output, term)));
            values.extend_from_slice(&equation.coefficients);
        }
        let mut covariance = DMatrix::zeros(values.len(), values.len());
        for (output, equation) in self.equations.iter().enumerate() {
            let p = equation.terms.len();
            covariance.view_mut((starts[output], starts[output]), (p, p)).copy_from(&equation.covariance());
        }
        Parameters { names, values: values.into(), covariance: Some(covariance) }
    }
}

/// Estimates a model from experiments, which are read once: `sample_time` \[s\]; `offsets` are those of the inputs
/// \[n_u\] and of the outputs \[n_y\], in their units.
///
/// # Errors
/// [`Error`]: too few samples, or regressors that depend on each other.
pub fn estimate(
    sources: &[&dyn Source],
    structure: &Structure,
    sample_time: f64,
    offsets: (&[f64], &[f64]),
    names: Names,
) -> Result<Estimate, Error> {
    let regression = Regression::of(sources, structure, offsets)?;
    solve(&regression, structure, sample_time, offsets, names)
}

/// The model of a structure whose regressors are all in the triangle.
///
/// | name | shape | unit | meaning |
/// |------|-------|------|---------|
/// | `sample_time` | | s | above 0 |
/// | `input_offset` | \[inputs\] | of each input | operating point that the regression is about; kept in the model |
/// | `output_offset` | \[outputs\] | of each output | the same for the outputs |
///
/// # Errors
/// Same as [`estimate`].
pub fn solve(
    regression: &Regression,
    structure: &Structure,
    sample_time: f64,
    (input_offset, output_offset): (&[f64], &[f64]),
    names: Names,
) -> Result<Estimate, Error> {
    let rows = regression.triangle.rows();
    let parameters = (0..structure.n_y()).map(|output| structure.terms(output).len()).max().unwrap_or(0);
    if rows <= parameters as u64 {
        return Err(Error::TooFew { rows, lags: regression.lags, parameters });
    }
    if !regression.triangle.r().iter().all(|value| value.is_finite()) {
        return Err(Error::NotFinite);
    }
    let mut equations: Vec<Equation> = Vec::new();
    // Column i turns the triangle into residuals of output i.
    let (n, n_y) = (regression.terms.len(), structure.n_y());
    let mut residual = DMatrix::zeros(n + n_y, n_y);
    for output in 0..n_y {
        let terms = structure.terms(output);
        let columns: Vec<usize> = terms.iter().filter_map(|term| regression.column(*term)).collect();
        let p = terms.len();
        // Equations with the same regressors share their triangle, with all outputs behind them.
        let shared = equations.iter().find(|other| other.terms == terms).map(|other| other.triangle.clone());
        let triangle = match shared {
            Some(triangle) => triangle,
            None => {
                regression.triangle.select(&columns.iter().copied().chain(n..n + n_y).collect::<Vec<_>>())
            }
        };
        if let Some(dependent) = triangle.dependent(p, RANK_TOLERANCE) {
            return Err(deficient(&dependent, &terms, &names.outputs[output], names));
        }
        let solution = triangle.solve(p).ok_or(Error::NotFinite)?;
        let coefficients: Vec<f64> = solution.column(output).iter().copied().collect();
        residual[(n + output, output)] = 1.0;
        columns.iter().zip(&coefficients).for_each(|(&column, c)| residual[(column, output)] = -c);
        equations.push(Equation { triangle, noise_variance: 0.0, terms, coefficients });
    }
    let errors = regression.triangle.r() * residual;
    let products = errors.tr_mul(&errors);
    let freedom = |output: usize| (rows - equations[output].terms.len() as u64) as f64;
    let noise_covariance = DMatrix::from_fn(products.nrows(), products.ncols(), |i, j| {
        products[(i, j)] / (freedom(i) * freedom(j)).sqrt()
    });
    for (output, equation) in equations.iter_mut().enumerate() {
        equation.noise_variance = noise_covariance[(output, output)];
    }
    let model = model(structure, &equations, sample_time, (input_offset, output_offset));
    Ok(Estimate { model, structure: structure.clone(), equations, noise_covariance, rows })
}

fn model(
    structure: &Structure,
    equations: &[Equation],
    sample_time: f64,
    (input_offset, output_offset): (&[f64], &[f64]),
) -> Arx {
    let values: Vec<&[f64]> = equations.iter().map(|equation| equation.coefficients.as_slice()).collect();
    let (a, b) = matrices(structure, &values);
    Arx { sample_time, a, b, input_offset: input_offset.into(), output_offset: output_offset.into() }
}

/// Values that belong to the coefficients, in the order of the terms of each output \[n_y\]\[terms\], as matrices A1,
/// A2, .. \[n_y, n_y\] and B0, B1, .. \[n_y, n_u\].
pub fn matrices(structure: &Structure, values: &[&[f64]]) -> (Vec<DMatrix<f64>>, Vec<DMatrix<f64>>) {
    let (n_y, n_u) = (structure.n_y(), structure.n_u());
    let all = structure.all_terms();
    let span = |outputs: bool| {
        let lags = all.iter().filter(|term| matches!(term, Term::Output { .. }) == outputs).map(Term::lag);
        lags.max()
    };
    let mut a = vec![DMatrix::zeros(n_y, n_y); span(true).unwrap_or(0)];
    let mut b = vec![DMatrix::zeros(n_y, n_u); span(false).map_or(0, |lag| lag + 1)];
    for (output, values) in values.iter().enumerate() {
        for (term, &value) in structure.terms(output).iter().zip(*values) {
            match *term {
                Term::Output { channel, lag } => a[lag - 1][(output, channel)] = value,
                Term::Input { channel, lag } => b[lag][(output, channel)] = value,
            }
        }
    }
    (a, b)
}

fn deficient(dependent: &Dependent, terms: &[Term], output: &str, names: Names) -> Error {
    let name = |column: usize| terms[column].name(names.inputs, names.outputs);
    let of: Vec<String> = dependent.of.iter().map(|&(column, _)| name(column)).collect();
    let combination = match of.is_empty() {
        true => "is zero in all rows".to_owned(),
        false => format!("is a linear combination of {}", of.join(", ")),
    };
    let involved = dependent.of.iter().map(|&(column, _)| column).chain([dependent.column]);
    let outputs = involved.filter(|&column| matches!(terms[column], Term::Output { .. })).count();
    let remedy = match outputs {
        0 => {
            "the inputs do not excite so many coefficients: lower nb, or use a command with more frequencies"
        }
        _ => "the data are explained by fewer coefficients without any error: lower na or nb",
    };
    Error::RankDeficient { regressor: name(dependent.column), combination, output: output.into(), remedy }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Model;
    use crate::record::Record;
    use crate::synthetic::eq8;

    fn names(n: usize, stem: &str) -> Vec<String> {
        (1..=n).map(|k| format!("{stem}{k}")).collect()
    }

    /// Uniform values between -1 and 1.
    fn noise(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        }
    }

    /// A chirp from 0.1 Hz to 12 Hz through eq. 8, with equation noise.
    fn chirp(amplitude: f64, n: usize, noise_size: f64, seed: u64) -> Record {
        let phase = |t: f64| std::f64::consts::TAU * (0.1 * t + 0.5 * 11.9 * t * t / (n as f64 * 1e-3));
        let u: Vec<f64> = (0..n).map(|k| amplitude * phase(k as f64 * 1e-3).sin()).collect();
        let model = eq8();
        let mut next = noise(seed);
        let mut y = vec![vec![0.0; n]; 2];
        for k in 1..n {
            for i in 0..2 {
                let past: f64 = (0..2).map(|l| -model.a[0][(i, l)] * y[l][k - 1]).sum();
                y[i][k] =
                    past + model.b[0][(i, 0)] * u[k] + model.b[1][(i, 0)] * u[k - 1] + noise_size * next();
            }
        }
        Record { name: "chirp".into(), sample_time: 1e-3, start: 0.0, inputs: vec![u], outputs: y }
    }

    fn fit(records: &[Record], structure: &Structure) -> Result<Estimate, Error> {
        let sources: Vec<&dyn Source> = records.iter().map(|record| record as &dyn Source).collect();
        let (u, y) = (names(structure.n_u(), "u"), names(structure.n_y(), "y"));
        estimate(&sources, structure, 1e-3, (&[0.0], &[0.0, 0.0]), Names { inputs: &u, outputs: &y })
    }

    #[test]
    fn eq_8_comes_back_from_noise_free_chirps() {
        let structure = Structure::uniform((1, 2), 1, 2, 0);
        let found = fit(&[chirp(10.0, 9000, 0.0, 1), chirp(40.0, 7000, 0.0, 2)], &structure).unwrap();
        let expected = eq8();
        let errors = found.model.a.iter().zip(&expected.a).chain(found.model.b.iter().zip(&expected.b));
        for (found, expected) in errors {
            assert!((found - expected).amax() < 1e-9, "{found} {expected}");
        }
        assert!(found.equations[0].standard_deviations().iter().all(|sigma| *sigma < 1e-10));
    }

    #[test]
    fn orders_above_the_true_ones_are_named_when_nothing_but_rounding_is_left() {
        let message = fit(&[chirp(20.0, 9000, 0.0, 1)], &Structure::uniform((1, 2), 2, 3, 0)).unwrap_err();
        let message = message.to_string();
        assert!(
            message.starts_with("y2(k-2) is a linear combination of y1(k-1), y2(k-1), u1(k-1), y1(k-2)"),
            "{message}"
        );
        assert!(message.ends_with("lower na or nb"), "{message}");
    }

    #[test]
    fn a_command_in_two_tones_cannot_excite_five_coefficients() {
        let n = 4000;
        let u = (0..n).map(|k| (0.1 * f64::from(k)).sin() + (0.37 * f64::from(k)).cos()).collect();
        let mut next = noise(9);
        let y: Vec<Vec<f64>> = (0..2).map(|_| (0..n).map(|_| next()).collect()).collect();
        let record = Record { sample_time: 1e-3, inputs: vec![u], outputs: y, ..Record::default() };
        let message = fit(&[record], &Structure::uniform((1, 2), 1, 5, 0)).unwrap_err().to_string();
        assert!(message.starts_with("u1(k-4) is a linear combination of u1(k)"), "{message}");
        assert!(message.contains("do not excite so many coefficients"), "{message}");
    }

    #[test]
    fn intervals_hold_the_truth_at_their_rate() {
        let (structure, truth) = (Structure::uniform((1, 2), 1, 2, 0), eq8());
        let (mut inside, mut all) = (0, 0);
        for seed in 0..60 {
            let found = fit(&[chirp(20.0, 2000, 0.5, seed)], &structure).unwrap();
            let truth: Vec<Vec<f64>> = (0..2)
                .map(|i| vec![truth.b[0][(i, 0)], truth.a[0][(i, 0)], truth.a[0][(i, 1)], truth.b[1][(i, 0)]])
                .collect();
            for (equation, truth) in found.equations.iter().zip(truth) {
                for ((c, sigma), truth) in
                    equation.coefficients.iter().zip(equation.standard_deviations()).zip(truth)
                {
                    inside += usize::from((c - truth).abs() < crate::parameters::TWO_SIDED_95 * sigma);
                    all += 1;
                }
            }
        }
        // 480 intervals, not all independent: 95 % with a standard deviation of some 2 %.
        let rate = inside as f64 / f64::from(all);
        assert!((0.90..0.99).contains(&rate), "{rate}");
    }

    #[test]
    fn the_noise_covariance_is_that_of_the_equation_errors() {
        let found = fit(&[chirp(20.0, 20000, 0.5, 3)], &Structure::uniform((1, 2), 1, 2, 0)).unwrap();
        // Uniform noise of half width 0.5 has the variance 0.25 / 3.
        assert!((found.noise_covariance[(0, 0)] * 12.0 - 1.0).abs() < 0.05);
        assert!(found.noise_covariance[(0, 1)].abs() < 0.003);
        assert!(found.model.is_stable());
    }

    #[test]
    fn equations_with_different_orders_leave_other_entries_at_zero() {
        let structure = Structure::parse((1, 2), "1,0;1,2", "2;3", "0;1").unwrap();
        let model = fit(&[chirp(20.0, 3000, 0.5, 3)], &structure).unwrap().model;
        assert_eq!((model.a.len(), model.b.len()), (2, 4));
        assert_eq!((model.a[0][(0, 1)], model.a[1][(0, 0)], model.b[0][(1, 0)]), (0.0, 0.0, 0.0));
        assert!(model.a[1][(1, 1)] != 0.0 && model.b[3][(1, 0)] != 0.0 && model.b[3][(0, 0)] == 0.0);
    }

    #[test]
    fn too_few_samples_are_refused_with_numbers() {
        let message =
            fit(&[chirp(20.0, 8, 0.5, 3)], &Structure::uniform((1, 2), 2, 3, 0)).unwrap_err().to_string();
        assert!(
            message.starts_with("6 equations (samples after the first 2 of each record) are too few for 7"),
            "{message}"
        );
    }
}
