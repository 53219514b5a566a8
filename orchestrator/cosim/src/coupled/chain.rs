//! The chain rule: derivatives of all values by states and inputs, and weighted second derivatives.

use super::program::{Curvature, Factor, Place, Program, Row};
use super::work::{Trouble, Work};
use crate::system::graph::Conversion;
use airloop_fmi::Model;

impl Work {
    fn factor(&self, factor: Factor) -> f64 {
        match factor {
            Factor::Constant(factor) => factor,
            Factor::Entry(entry, factor) => self.entries[entry] * factor,
        }
    }

    /// Rows that are the same everywhere.
    pub fn combine_constants(&mut self, program: &Program) {
        self.combine_rows(&program.rows[..program.constant_rows]);
    }

    /// Rows of the other values from the derivatives of the components.
    pub fn combine(&mut self, program: &Program) {
        self.combine_rows(&program.rows[program.constant_rows..]);
    }

    fn combine_rows(&mut self, rows: &[Row]) {
        let width = self.size.arguments();
        for row in rows {
            let begin = row.value * width;
            self.rows[begin..begin + width].fill(0.0);
            for &(factor, place) in &row.terms {
                let factor = self.factor(factor);
                match place {
                    Place::Column(column) => self.rows[begin + column] += factor,
                    Place::Value(source) => {
                        let (own, other) = two_rows(&mut self.rows, width, row.value, source);
                        own.iter_mut().zip(other).for_each(|(target, slope)| *target += factor * slope);
                    }
                    Place::Fixed(_) => {}
                }
            }
        }
    }

    /// Rows of rates and outputs.
    pub fn write_jacobian(&self, rates: &[usize], outputs: &[(Place, Conversion)], jacobian: &mut [f64]) {
        let width = self.size.arguments();
        let row = |value: usize| &self.rows[value * width..(value + 1) * width];
        let (of_rates, of_outputs) = jacobian.split_at_mut(rates.len() * width);
        for (target, &value) in of_rates.chunks_exact_mut(width).zip(rates) {
            target.copy_from_slice(row(value));
        }
        for (target, &(place, conversion)) in of_outputs.chunks_exact_mut(width).zip(outputs) {
            match place {
                Place::Value(value) => {
                    target.iter_mut().zip(row(value)).for_each(|(t, r)| *t = conversion.factor * r);
                }
                Place::Column(column) => {
                    target.fill(0.0);
                    target[column] = conversion.factor;
                }
                Place::Fixed(_) => target.fill(0.0),
            }
        }
    }

    /// Weights of all values, backwards from those of rates and outputs.
    pub fn weigh(
        &mut self,
        program: &Program,
        rates: &[usize],
        outputs: &[(Place, Conversion)],
        weights: &[f64],
    ) {
        self.adjoint.fill(0.0);
        let (of_rates, of_outputs) = weights.split_at(rates.len());
        rates.iter().zip(of_rates).for_each(|(&value, weight)| self.adjoint[value] += weight);
        for (&(place, conversion), weight) in outputs.iter().zip(of_outputs) {
            if let Place::Value(value) = place {
                self.adjoint[value] += weight * conversion.factor;
            }
        }
        for row in program.rows.iter().rev() {
            let weight = self.adjoint[row.value];
            if weight == 0.0 {
                continue;
            }
            for &(factor, place) in &row.terms {
                if let Place::Value(source) = place {
                    self.adjoint[source] += weight * self.factor(factor);
                }
            }
        }
    }

    /// Second derivatives of the weighted sum of all values.
    pub fn bend(
        &mut self,
        program: &Program,
        models: &mut [Model],
        hessian: &mut [f64],
    ) -> Result<(), Trouble> {
        hessian.fill(0.0);
        self.set_time(program, models)?;
        let width = self.size.arguments();
        for slopes in &program.slopes {
            if slopes.curvatures.iter().all(|curvature| self.adjoint[curvature.value] == 0.0) {
                continue;
            }
            let component = slopes.component;
            self.differentiate_twice(slopes, &mut models[component])
                .map_err(|error| Trouble::Fmu { component, error })?;
            // Curvatures of one pair of arguments stand one after the other.
            let mut position = 0;
            for pair in slopes.curvatures.chunk_by(|a, b| (a.first, a.second) == (b.first, b.second)) {
                let found = &self.curvatures[0][position..position + pair.len()];
                position += pair.len();
                let terms = pair.iter().zip(found);
                let weight: f64 = terms.map(|(curvature, found)| self.adjoint[curvature.value] * found).sum();
                let Curvature { value, first, second, .. } = pair[0];
                if !weight.is_finite() {
                    return Err(Trouble::NotFinite { value, found: weight });
                }
                let (one, other) = (slopes.arguments[first], slopes.arguments[second]);
                self.add_product(width, weight, one, other, hessian);
                if first != second {
                    self.add_product(width, weight, other, one, hessian);
                }
            }
        }
        Ok(())
    }

    /// Adds `weight` times the outer product of the rows of two arguments.
    fn add_product(
        &self,
        width: usize,
        weight: f64,
        (conversion, place): (Conversion, Place),
        (other_conversion, other): (Conversion, Place),
        hessian: &mut [f64],
    ) {
        let weight = weight * conversion.factor * other_conversion.factor;
        let row = |value: usize| &self.rows[value * width..(value + 1) * width];
        let mut line = |line: usize, weight: f64| {
            let target = &mut hessian[line * width..(line + 1) * width];
            match other {
                Place::Column(column) => target[column] += weight,
                Place::Value(value) => target.iter_mut().zip(row(value)).for_each(|(t, r)| *t += weight * r),
                Place::Fixed(_) => {}
            }
        };
        match place {
            Place::Column(column) => line(column, weight),
            Place::Value(value) => {
                for (column, slope) in row(value).iter().enumerate().filter(|(_, slope)| **slope != 0.0) {
                    line(column, weight * slope);
                }
            }
            Place::Fixed(_) => {}
        }
    }
}

/// One row to write and another to read.
fn two_rows(rows: &mut [f64], width: usize, target: usize, source: usize) -> (&mut [f64], &[f64]) {
    let (first, rest) = rows.split_at_mut(target.max(source) * width);
    match target > source {
        true => (&mut rest[..width], &first[source * width..(source + 1) * width]),
        false => (&mut first[target * width..(target + 1) * width], &rest[..width]),
    }
}
