//! Free coefficients of an ARX structure, and their order in the parameter vector.

use nalgebra::{DMatrix, DVector};

use crate::model::Arx;

/// Free coefficients of `A(z) y = B(z) u`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mask {
    /// A1, A2, ..: shape \[n_y, n_y\] each.
    pub a: Vec<DMatrix<bool>>,
    /// B0, B1, ..: shape \[n_y, n_u\] each.
    pub b: Vec<DMatrix<bool>>,
}

/// A free coefficient.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "matrix and place, as in each variant")]
pub enum Coefficient {
    /// Of `A_lag`, `lag` from 1.
    A { lag: usize, row: usize, column: usize },
    /// Of `B_lag`, `lag` from 0.
    B { lag: usize, row: usize, column: usize },
}

impl Mask {
    /// Every coefficient that is not exactly zero: those that an estimate left out (delays, shorter channels) stay out.
    pub fn of(model: &Arx) -> Mask {
        let free = |matrices: &[DMatrix<f64>]| matrices.iter().map(|m| m.map(|value| value != 0.0)).collect();
        Mask { a: free(&model.a), b: free(&model.b) }
    }

    /// Full matrices: `A1` to `A_na`, and `nb` matrices from `B_nk` on.
    pub fn full(n_y: usize, n_u: usize, na: usize, nb: usize, nk: usize) -> Mask {
        Mask {
            a: vec![DMatrix::from_element(n_y, n_y, true); na],
            b: (0..if nb > 0 { nk + nb } else { 0 })
                .map(|lag| DMatrix::from_element(n_y, n_u, lag >= nk))
                .collect(),
        }
    }

    /// Samples before `k` that `y(k)` depends on.
    pub fn lags(&self) -> usize {
        self.a.len().max(self.b.len().saturating_sub(1))
    }

    /// Free coefficients: those of A lag by lag, then those of B.
    pub fn coefficients(&self) -> Vec<Coefficient> {
        let mut found = Vec::new();
        for (index, free) in self.a.iter().enumerate() {
            for (row, column) in places(free) {
                found.push(Coefficient::A { lag: index + 1, row, column });
            }
        }
        for (lag, free) in self.b.iter().enumerate() {
            for (row, column) in places(free) {
                found.push(Coefficient::B { lag, row, column });
            }
        }
        found
    }

    /// Free coefficients of a model, shape \[p\].
    pub fn parameters(&self, model: &Arx) -> DVector<f64> {
        let value = |coefficient: &Coefficient| match *coefficient {
            Coefficient::A { lag, row, column } => model.a.get(lag - 1).map_or(0.0, |a| a[(row, column)]),
            Coefficient::B { lag, row, column } => model.b.get(lag).map_or(0.0, |b| b[(row, column)]),
        };
        DVector::from_vec(self.coefficients().iter().map(value).collect())
    }

    /// A model like `template` with these free coefficients and zeros elsewhere.
    pub fn model(&self, template: &Arx, parameters: &DVector<f64>) -> Arx {
        let zeros = |free: &[DMatrix<bool>]| free.iter().map(|m| m.map(|_| 0.0)).collect::<Vec<_>>();
        let (mut a, mut b): (Vec<DMatrix<f64>>, Vec<DMatrix<f64>>) = (zeros(&self.a), zeros(&self.b));
        for (coefficient, &value) in self.coefficients().iter().zip(parameters.iter()) {
            match *coefficient {
                Coefficient::A { lag, row, column } => a[lag - 1][(row, column)] = value,
                Coefficient::B { lag, row, column } => b[lag][(row, column)] = value,
            }
        }
        Arx { a, b, ..template.clone() }
    }

    /// Names of the free coefficients, such as `A1[2,1]`: row and column counted from 1.
    pub fn names(&self) -> Vec<String> {
        let name = |coefficient: &Coefficient| match *coefficient {
            Coefficient::A { lag, row, column } => format!("A{lag}[{},{}]", row + 1, column + 1),
            Coefficient::B { lag, row, column } => format!("B{lag}[{},{}]", row + 1, column + 1),
        };
        self.coefficients().iter().map(name).collect()
    }
}

/// Rows and columns of the free entries, row by row.
fn places(free: &DMatrix<bool>) -> Vec<(usize, usize)> {
    let all = (0..free.nrows()).flat_map(|row| (0..free.ncols()).map(move |column| (row, column)));
    all.filter(|&place| free[place]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_and_model_are_inverse_and_delays_stay_zero() {
        let mask = Mask::full(2, 1, 1, 2, 3);
        let template = Arx {
            sample_time: 0.1,
            a: Vec::new(),
            b: Vec::new(),
            input_offset: vec![0.0],
            output_offset: vec![0.0; 2],
        };
        let parameters = DVector::from_fn(8, |i, _| 1.0 + i as f64);
        let model = mask.model(&template, &parameters);
        assert_eq!(mask.parameters(&model), parameters);
        assert_eq!(Mask::of(&model), mask);
        assert!(model.b[..3].iter().all(|b| b.amax() == 0.0));
        assert_eq!(mask.names()[1], "A1[1,2]");
        assert_eq!(mask.names()[4], "B3[1,1]");
    }
}
