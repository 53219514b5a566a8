//! A dynamic FMU inside a coupled component, as the master predicts it: linear about the present point, plus a
//! defect learned from the FMU's own steps.
//!
//! x' = x0' + A x + B (u - u0), y = y0 + C x + D (u - u0) + e(r), with x the change since the beginning of the step
//! and e(r) = e1 (3 r^2 - 2 r^3) + e1' H (r^3 - r^2), which is flat at the beginning and meets the FMU's outputs and
//! their derivatives at the end.

use super::dense::Exponential;
use super::unit::Unit;
use crate::master::stop::Stop;
use airloop_fmi::Slave;

/// Smallest change of the inputs, relative to their nominal values, from which input gains are learned.
const SMALLEST_CHANGE: f64 = 1e-2;

/// Origin of the matrices.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Origin {
    /// Directional derivatives of the FMU; value references of states, then of derivatives with outputs behind.
    Derivatives { states: Vec<u32>, unknowns: Vec<u32> },
    /// The outputs stand for the states, and B is found by repeating a step with changed inputs, or where that is not
    /// possible learned from step to step.
    Differences,
}

/// See the module.
#[derive(Debug)]
pub(super) struct LocalModel {
    pub origin: Origin,
    pub nx: usize,
    pub nu: usize,
    pub ny: usize,
    /// `[nx, nx]`, `[nx, nu]`, `[ny, nx]`, `[ny, nu]`, row by row.
    pub a: Vec<f64>,
    pub b: Vec<f64>,
    pub c: Vec<f64>,
    pub d: Vec<f64>,
    /// Present derivatives, inputs and outputs.
    pub xdot: Vec<f64>,
    pub u0: Vec<f64>,
    pub y0: Vec<f64>,
    /// Nominal values of the states.
    pub nominal: Vec<f64>,
    /// Defect at the end of the step and its time derivative there.
    pub defect: Vec<f64>,
    pub defect_rate: Vec<f64>,
    /// Outputs of the local model at the end of the step and their time derivatives.
    pub end: Vec<f64>,
    pub end_rate: Vec<f64>,
    column: Vec<f64>,
    exponential: Exponential,
}

impl LocalModel {
    pub fn new(origin: Origin, nominal: Vec<f64>, nu: usize, ny: usize) -> LocalModel {
        let nx = nominal.len();
        let zeros = |count: usize| vec![0.0; count];
        let mut c = zeros(ny * nx);
        if origin == Origin::Differences {
            (0..nx).for_each(|k| c[k * nx + k] = 1.0);
        }
        LocalModel {
            origin,
            nx,
            nu,
            ny,
            a: zeros(nx * nx),
            b: zeros(nx * nu),
            c,
            d: zeros(ny * nu),
            xdot: zeros(nx),
            u0: zeros(nu),
            y0: zeros(ny),
            nominal,
            defect: zeros(ny),
            defect_rate: zeros(ny),
            end: zeros(ny),
            end_rate: zeros(ny),
            column: zeros(nx + ny),
            exponential: Exponential::new(nx + 2),
        }
    }

    /// Linearizes about the present point of the FMU; `y` and `rate` are its outputs and their derivatives.
    pub fn linearize(&mut self, unit: &Unit, slave: &mut Slave, y: &[f64], rate: &[f64]) -> Result<(), Stop> {
        self.u0.copy_from_slice(&unit.u);
        self.y0.copy_from_slice(y);
        let (nx, nu) = (self.nx, self.nu);
        let Origin::Derivatives { states, unknowns } = &self.origin else {
            self.xdot.copy_from_slice(rate);
            return Ok(());
        };
        slave.get_real(&unknowns[..nx], &mut self.xdot)?;
        for column in 0..nx + nu {
            let known = match column.checked_sub(nx) {
                None => states[column],
                Some(input) => unit.input_references[input],
            };
            slave.directional_derivative(unknowns, &[known], &[1.0], &mut self.column)?;
            for (row, &value) in self.column.iter().enumerate() {
                match (row.checked_sub(nx), column.checked_sub(nx)) {
                    (None, None) => self.a[row * nx + column] = value,
                    (None, Some(input)) => self.b[row * nu + input] = value,
                    (Some(output), None) => self.c[output * nx + column] = value,
                    (Some(output), Some(input)) => self.d[output * nu + input] = value,
                }
            }
        }
        Ok(())
    }

    /// Response at the end of a step of `h` \[s\] to inputs that begin at `value` with `slope` \[1/s\].
    pub fn respond(&mut self, value: &[f64], slope: &[f64], h: f64) {
        let (nx, nu, n) = (self.nx, self.nu, self.nx + 2);
        // The exponential of [A, f, B slope; 0; 0, 1, 0] holds the response in its last but one column.
        let matrix = &mut self.exponential.matrix;
        matrix.fill(0.0);
        for row in 0..nx {
            for column in 0..nx {
                matrix[row * n + column] = h * self.a[row * nx + column];
            }
            let b = &self.b[row * nu..(row + 1) * nu];
            let offset = (0..nu).map(|k| b[k] * (value[k] - self.u0[k])).sum::<f64>();
            let rise = (0..nu).map(|k| b[k] * slope[k]).sum::<f64>();
            matrix[row * n + nx] = h * (self.xdot[row] + offset);
            matrix[row * n + nx + 1] = h * rise;
        }
        matrix[(nx + 1) * n + nx] = h;
        self.exponential.compute();
        let x = |row: usize| self.exponential.result[row * n + nx];
        let du = |k: usize| value[k] + h * slope[k] - self.u0[k];
        for row in 0..nx {
            let (a, b) = (&self.a[row * nx..(row + 1) * nx], &self.b[row * nu..(row + 1) * nu]);
            self.column[row] = self.xdot[row]
                + (0..nx).map(|k| a[k] * x(k)).sum::<f64>()
                + (0..nu).map(|k| b[k] * du(k)).sum::<f64>();
        }
        for row in 0..self.ny {
            let (c, d) = (&self.c[row * nx..(row + 1) * nx], &self.d[row * nu..(row + 1) * nu]);
            self.end[row] = self.y0[row]
                + (0..nx).map(|k| c[k] * x(k)).sum::<f64>()
                + (0..nu).map(|k| d[k] * du(k)).sum::<f64>();
            self.end_rate[row] = (0..nx).map(|k| c[k] * self.column[k]).sum::<f64>()
                + (0..nu).map(|k| d[k] * slope[k]).sum::<f64>();
        }
    }

    /// Broyden's update (Mathematics of Computation 19, 1965) of B from what the FMU did under the inputs of
    /// [`LocalModel::respond`]; none where the inputs hardly changed, as the update would follow other errors.
    pub fn learn_gains(&mut self, unit: &Unit, y: &[f64], h: f64) {
        let change = |k: usize| unit.value[k] + 0.5 * h * unit.slope[k] - self.u0[k];
        let weight = |k: usize| unit.inputs[k].nominal.powi(-2);
        let length: f64 = (0..self.nu).map(|k| weight(k) * change(k).powi(2)).sum();
        if length < SMALLEST_CHANGE.powi(2) {
            return;
        }
        for row in 0..self.ny {
            let rest = (y[row] - self.end[row]) / h;
            for k in 0..self.nu {
                self.b[row * self.nu + k] += rest * weight(k) * change(k) / length;
            }
        }
    }

    /// Learns the defect from what the FMU did under the inputs of [`LocalModel::respond`]; returns the largest
    /// change against the defect before, relative to the larger of value and nominal value.
    pub fn learn(&mut self, y: &[f64], rate: Option<&[f64]>, nominal: &[f64], h: f64) -> (f64, usize) {
        let mut largest = (0.0, 0);
        for k in 0..self.ny {
            let defect = y[k] - self.end[k];
            // Without derivatives of the outputs the defect is taken to grow with the square of time.
            self.defect_rate[k] = rate.map_or(2.0 * defect / h, |rate| rate[k] - self.end_rate[k]);
            let change = (defect - self.defect[k]).abs() / nominal[k].max(y[k].abs());
            if change > largest.0 {
                largest = (change, k);
            }
            self.defect[k] = defect;
        }
        largest
    }

    /// Forgets the defect, where the last step says nothing about the next.
    pub fn forget(&mut self) {
        self.defect.fill(0.0);
        self.defect_rate.fill(0.0);
    }

    /// Shows every number that is carried from step to step: what was learned.
    pub fn carry(&mut self, each: &mut dyn FnMut(&mut f64)) {
        let learned = self.b.iter_mut().chain(&mut self.defect).chain(&mut self.defect_rate);
        learned.for_each(each);
    }

    /// Output `k` at r without its direct feed-through, for the change `x` of the states.
    pub fn output(&self, k: usize, x: &[f64], r: f64, h: f64) -> f64 {
        let c = &self.c[k * self.nx..(k + 1) * self.nx];
        let bend = self.defect[k] * r * r * (3.0 - 2.0 * r) + self.defect_rate[k] * h * r * r * (r - 1.0);
        self.y0[k] + c.iter().zip(x).map(|(c, x)| c * x).sum::<f64>() + bend
    }
}
