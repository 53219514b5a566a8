//! The force that is missing at an attachment for the model to follow the measured motion: no simulation, so no error
//! adds up, but accelerations have to be measured.
//!
//! `r = (dv/dt measured - dv/dt of the model) / (d (dv/dt) / d force)` at the filtered states and inputs of a record.

use super::model::Study;
use super::plant::Plant;
use super::read::ForceRecord;
use super::simulate::View;
use crate::engine::noise::Noise;
use crate::engine::{Span, System, parallel};

/// Records as the engine sees them, with the force residual in place of the outputs.
#[derive(Debug)]
pub struct ForceView<'a> {
    /// Blocks and parameters.
    pub view: View<'a>,
    /// Divisor of the residuals.
    pub scale: f64,
}

impl ForceView<'_> {
    fn study(&self) -> &Study {
        self.view.study
    }

    fn record(&self, index: usize) -> Option<&ForceRecord> {
        self.study().records[self.view.pieces[index].record].force.as_ref()
    }

    fn run(
        &self,
        plant: &mut Plant,
        record: &ForceRecord,
        step: f64,
        p: &[f64],
    ) -> Result<Vec<f64>, super::Problem> {
        let Some((_, state, tap, _)) = &self.study().force else { return Ok(Vec::new()) };
        let n = record.acceleration.len();
        let (mut x, mut dx) = (vec![0.0; plant.nx], vec![0.0; plant.nx]);
        plant.set_inputs(&record.inputs, 0);
        plant.initialize(&[], &self.view.parameters(p), 0.0, &mut x, &|_, value, _| value)?;
        let mut blocks = self.view.blocks(p, false);
        let mut found = Vec::with_capacity(n);
        let mut slope = 0.0;
        for k in 0..n {
            plant.set_inputs(&record.inputs, k);
            let first = plant.extra_first;
            for (slot, values) in record.extra.iter().enumerate() {
                plant.slots[first + slot] = values[k];
            }
            for (i, values) in record.states.iter().enumerate() {
                if let Some(values) = values {
                    x[i] = values[k];
                }
            }
            let t = k as f64 * step;
            let mut rate = |extra: f64, dx: &mut Vec<f64>| {
                let block = |own: usize, value: f64, slots: &[f64]| {
                    blocks.pass(own, value, slots) + if own == *tap { extra } else { 0.0 }
                };
                plant.evaluate(t, &x, dx, &block).map(|()| dx[*state]).map_err(super::Problem::fmu)
            };
            // How the force changes the acceleration is the same everywhere but where the system says otherwise; every
            // hundredth sample keeps it current.
            if k % 100 == 0 {
                slope = rate(1.0, &mut dx)? - rate(0.0, &mut dx)?;
            }
            found.push((record.acceleration[k] - rate(0.0, &mut dx)?) / slope);
            blocks.advance(step);
        }
        Ok(found)
    }

    /// Rms that the noise of the sensors gives the residual, carried through filters and derivatives.
    pub fn noise(&self, p: &[f64], seed: u64) -> f64 {
        let found = parallel::map(self.records(), |index| {
            let Some(own) = self.record(index) else { return (0.0, 0) };
            let record = &self.study().records[self.view.pieces[index].record];
            let base = self.predict(index, p, &[]);
            let mut noise = Noise::new(seed, index as u64);
            let noisy = own.noisy(self.study(), record, &mut noise);
            let moved = self.residual(&noisy, record.step, p);
            let square = moved.iter().zip(&base).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
            (square, base.len())
        });
        let (square, count) = found.iter().fold((0.0, 0), |sum, own| (sum.0 + own.0, sum.1 + own.1));
        (square / count.max(1) as f64).sqrt()
    }

    fn residual(&self, own: &ForceRecord, step: f64, p: &[f64]) -> Vec<f64> {
        let bad = || vec![f64::NAN; own.acceleration.len()];
        let Ok(mut plant) = self.study().take() else { return bad() };
        match self.run(&mut plant, own, step, p) {
            Ok(found) => {
                self.study().give(plant);
                found
            }
            Err(_) => bad(),
        }
    }

    /// Standard deviation of the driving force over all records, for relative errors; 0 where none is measured.
    pub fn spread(&self) -> f64 {
        let (mut sum, mut square, mut count) = (0.0, 0.0, 0.0);
        for index in 0..self.view.pieces.len() {
            let Some(record) = self.record(index) else { continue };
            for value in record.inputs.iter().flatten().take(1).flatten() {
                (sum, square, count) = (sum + value, square + value * value, count + 1.0);
            }
        }
        if count > 0.0 { f64::sqrt((square / count - f64::powi(sum / count, 2)).max(0.0)) } else { 0.0 }
    }
}

impl System for ForceView<'_> {
    fn records(&self) -> usize {
        self.view.pieces.len()
    }

    fn estimation(&self, _: usize) -> bool {
        true
    }

    fn locals(&self, _: usize) -> Vec<(f64, f64)> {
        Vec::new()
    }

    fn signals(&self, record: usize) -> Vec<Span> {
        let n = self.record(record).map_or(0, |record| record.acceleration.len());
        let signal = self.study().force.as_ref().map_or_else(String::new, |force| force.3.clone());
        vec![Span { signal, range: 0..n, noise: self.scale }]
    }

    fn predict(&self, record: usize, parameters: &[f64], _: &[f64]) -> Vec<f64> {
        let Some(own) = self.record(record) else { return Vec::new() };
        let step = self.study().records[self.view.pieces[record].record].step;
        self.residual(own, step, parameters)
    }

    fn measured(&self, record: usize) -> Vec<f64> {
        vec![0.0; self.record(record).map_or(0, |record| record.acceleration.len())]
    }

    fn whiten(&self, _: usize, predicted: &[f64]) -> Vec<f64> {
        predicted.iter().map(|value| value / self.scale).collect()
    }

    fn redraw(&self, _: usize, predicted: &[f64], noise: &mut Noise) -> Vec<f64> {
        predicted.iter().map(|_| noise.normal()).collect()
    }
}
