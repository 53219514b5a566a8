//! A start for hard cases: the records simulated by a least-squares model of high order, which has little bias.

use nalgebra::{DMatrix, DVector};

use crate::model::Arx;
use crate::rational::columns::{Column, fold_columns};
use crate::rational::{Experiment, Mask, simulate, stabilized};
use crate::record::Record;
use airloop_optim::linalg::StreamedQr;
use airloop_optim::linalg::triangular::solve;

/// The same inputs with the outputs of a model of high order in place of the noisy ones; `None` if the records are too
/// short for one.
pub(super) fn denoised(template: &Arx, mask: &Mask, records: &[Record], radius: f64) -> Option<Vec<Record>> {
    let (n_y, n_u) = (template.output_offset.len(), template.input_offset.len());
    let samples: usize = records.iter().map(Record::len).sum();
    let shortest = records.iter().map(Record::len).min()?;
    let order = (3 * mask.lags()).clamp(12, 30).min(samples / (20 * (n_y + n_u))).min(shortest / 4);
    if order <= mask.lags() {
        return None;
    }
    let of = |record| Experiment::new(record, &template.input_offset, &template.output_offset);
    let experiments: Vec<Experiment> = records.iter().map(of).collect();
    // Full matrices: all equations share their regressors.
    let p = n_y * order + n_u * (order + 1);
    let mut fold = StreamedQr::new(p + n_y);
    for experiment in &experiments {
        let (y, u) = (&experiment.y, &experiment.u);
        let column = |signal, shift, sign| Column { signal, shift, sign };
        let mut columns = Vec::with_capacity(p + n_y);
        (1..=order).for_each(|lag| columns.extend(y.chunks(1).map(|y| column(y, lag, -1.0))));
        (0..=order).for_each(|lag| columns.extend(u.chunks(1).map(|u| column(u, lag, 1.0))));
        columns.extend(y.chunks(1).map(|y| column(y, 0, 1.0)));
        fold_columns(&columns, order..experiment.len(), &DMatrix::identity(1, 1), &mut fold);
    }
    let r = fold.finish().into_r();
    let regressors = r.view((0, 0), (p, p)).into_owned();
    let equations: Vec<DVector<f64>> = (0..n_y)
        .map(|i| solve(&regressors, &r.view((0, p + i), (p, 1)).column(0).into_owned(), 1e-12).0)
        .collect();
    let matrix = |first: usize, columns: usize| {
        DMatrix::from_fn(n_y, columns, |i, column| equations[i][first + column])
    };
    let model = Arx {
        a: (0..order).map(|lag| matrix(lag * n_y, n_y)).collect(),
        b: (0..=order).map(|lag| matrix(order * n_y + lag * n_u, n_u)).collect(),
        ..template.clone()
    };
    let model = stabilized(&model, radius);
    let simulated = |(record, experiment): (&Record, &Experiment)| {
        let mut outputs = simulate(&model, experiment, &DMatrix::identity(n_y, n_y)).y;
        for (y, offset) in outputs.iter_mut().zip(&template.output_offset) {
            y.iter_mut().for_each(|y| *y += offset);
        }
        Record { outputs, ..record.clone() }
    };
    let found: Vec<Record> = records.iter().zip(&experiments).map(simulated).collect();
    found.iter().flat_map(|record| record.outputs.iter().flatten()).all(|y| y.is_finite()).then_some(found)
}
