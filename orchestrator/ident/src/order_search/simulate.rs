//! Free simulations of many models over the same data, several models side by side in the lanes of a vector.

use rayon::prelude::*;

use crate::model::Arx;
use crate::record::Error;
use crate::source::{Source, Window};

/// Models side by side.
const LANES: usize = 8;
/// Samples between which the past is moved to the front; what is in use then fits the innermost cache.
const CHUNK: usize = 128;

type Lanes = [f64; LANES];

/// Models of alike size, and what is known of their errors.
struct Group {
    /// Indices of the models, shape \[LANES\] at most.
    members: Vec<usize>,
    na: usize,
    /// First and one after the last lag of the inputs.
    lags: (usize, usize),
    /// Rows over the past `[y(k-na), .., y(k-1)]`, shape \[n_y\]\[na n_y\].
    past: Vec<Vec<Lanes>>,
    /// Rows over the inputs `[u(k-last), .., u(k-first)]`, shape \[n_y\]\[lags n_u\].
    inputs: Vec<Vec<Lanes>>,
    /// Simulated outputs about the operating point, all outputs of a sample side by side.
    free: Vec<Lanes>,
    /// Squared errors of the record that is being read, shape \[n_y\].
    errors: Vec<Lanes>,
    /// Fits of the records so far, shape \[records\]\[n_y\].
    fits: Vec<Vec<[Option<f64>; LANES]>>,
}

/// Simulated fits (eq. 9), the mean over the records, shape \[models\]\[n_y\]. The first `lags` samples of every record
/// are measured and do not count.
///
/// Every model sees the same arithmetic on any number of threads.
pub(super) fn fits(
    models: &[&Arx],
    sources: &[&dyn Source],
    lags: usize,
) -> Result<Vec<Vec<Option<f64>>>, Error> {
    let Some(&any) = models.first() else {
        return Ok(Vec::new());
    };
    let mut order: Vec<usize> = (0..models.len()).collect();
    let lags_of = |b: &Arx| {
        let first = b.b.iter().position(|b| b.iter().any(|value| *value != 0.0)).unwrap_or(0);
        (first, b.b.len().max(first))
    };
    order.sort_by_key(|&index| (models[index].a.len(), lags_of(models[index])));
    let alike = order.chunk_by(|&a, &b| models[a].a.len() == models[b].a.len());
    let mut groups: Vec<Group> =
        alike.flat_map(|some| some.chunks(LANES)).map(|some| Group::new(some, models, &lags_of)).collect();
    let threads = rayon::current_num_threads().min(groups.len()).max(1);
    // Dealt out in turn, as larger groups stand at the end.
    let mut shares: Vec<Vec<&mut Group>> = (0..threads).map(|_| Vec::new()).collect();
    groups.iter_mut().enumerate().for_each(|(index, group)| shares[index % threads].push(group));
    shares
        .par_iter_mut()
        .try_for_each(|share| sources.iter().try_for_each(|source| run(share, any, *source, lags)))?;
    let n_y = any.output_offset.len();
    let mut fits = vec![vec![None; n_y]; models.len()];
    for group in &groups {
        for (lane, &member) in group.members.iter().enumerate() {
            for (i, fit) in fits[member].iter_mut().enumerate() {
                let all: Option<Vec<f64>> = group.fits.iter().map(|record| record[i][lane]).collect();
                *fit =
                    all.filter(|all| !all.is_empty()).map(|all| all.iter().sum::<f64>() / all.len() as f64);
            }
        }
    }
    Ok(fits)
}

/// Spread of the measured outputs about their mean, as it is summed up.
#[derive(Clone, Copy, Default)]
struct Spread {
    first: Option<f64>,
    sum: f64,
    squares: f64,
}

/// Simulates the models of some groups over one record.
fn run(groups: &mut [&mut Group], any: &Arx, source: &dyn Source, lags: usize) -> Result<(), Error> {
    let (input_offset, output_offset) = (&any.input_offset, &any.output_offset);
    let n_y = output_offset.len();
    for group in groups.iter_mut() {
        group.free.clear();
        group.errors = vec![[0.0; LANES]; n_y];
    }
    let mut spread = vec![Spread::default(); n_y];
    let mut samples = 0usize;
    let (mut inputs, mut outputs): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    source.windows(lags, &mut |window: Window| {
        interleave(window.inputs, input_offset, &mut inputs);
        interleave(window.outputs, output_offset, &mut outputs);
        let known = lags.saturating_sub(window.at - window.before).max(window.before).min(window.len());
        for (i, spread) in spread.iter_mut().enumerate() {
            let first = window.outputs[i].get(known).copied();
            let first = *spread.first.get_or_insert(first.unwrap_or_default());
            for y in &window.outputs[i][known..] {
                spread.sum += y - first;
                spread.squares += (y - first) * (y - first);
            }
        }
        samples += window.len() - known;
        for group in groups.iter_mut() {
            group.advance(&inputs, &outputs, known);
        }
    })?;
    let n = samples as f64;
    for group in groups.iter_mut() {
        let fit = |i: usize| {
            let spread = spread[i].squares - spread[i].sum * spread[i].sum / n;
            group.errors[i].map(|error| {
                let fit = 100.0 * (1.0 - (error / spread).sqrt()); // eq. 9
                (spread > 0.0 && fit.is_finite()).then_some(fit)
            })
        };
        let fits = (0..n_y).map(fit).collect();
        group.fits.push(fits);
    }
    Ok(())
}

/// Columns side by side, about their offsets.
fn interleave(columns: &[&[f64]], offsets: &[f64], out: &mut Vec<f64>) {
    let n = columns.first().map_or(0, |column| column.len());
    out.clear();
    out.resize(n * columns.len(), 0.0);
    for (index, (column, offset)) in columns.iter().zip(offsets).enumerate() {
        let places = out.iter_mut().skip(index).step_by(columns.len());
        places.zip(*column).for_each(|(place, value)| *place = value - offset);
    }
}

impl Group {
    fn new(members: &[usize], models: &[&Arx], lags_of: &dyn Fn(&Arx) -> (usize, usize)) -> Group {
        let all: Vec<(usize, usize)> = members.iter().map(|&member| lags_of(models[member])).collect();
        let first = all.iter().map(|lags| lags.0).min().unwrap_or(0);
        let end = all.iter().map(|lags| lags.1).max().unwrap_or(0);
        let model = models[members[0]];
        let (na, n_y, n_u) = (model.a.len(), model.output_offset.len(), model.input_offset.len());
        let lanes = |value: &dyn Fn(&Arx) -> f64| {
            let mut lanes = [0.0; LANES];
            members.iter().zip(&mut lanes).for_each(|(&member, lane)| *lane = value(models[member]));
            lanes
        };
        let past = |i: usize| {
            let entries = (1..=na).rev().flat_map(|lag| (0..n_y).map(move |l| (lag, l)));
            entries.map(|(lag, l)| lanes(&|model| -model.a[lag - 1][(i, l)])).collect()
        };
        let inputs = |i: usize| {
            let entries = (first..end).rev().flat_map(|lag| (0..n_u).map(move |j| (lag, j)));
            entries.map(|(lag, j)| lanes(&|model| model.b.get(lag).map_or(0.0, |b| b[(i, j)]))).collect()
        };
        Group {
            members: members.to_vec(),
            na,
            lags: (first, end),
            past: (0..n_y).map(past).collect(),
            inputs: (0..n_y).map(inputs).collect(),
            free: Vec::new(),
            errors: Vec::new(),
            fits: Vec::new(),
        }
    }

    /// Simulates the samples from `known` on; samples before are measured and only looked back on, if the record
    /// begins here.
    fn advance(&mut self, inputs: &[f64], outputs: &[f64], known: usize) {
        let n_y = self.past.len();
        let n_u =
            if self.lags.1 > self.lags.0 { self.inputs[0].len() / (self.lags.1 - self.lags.0) } else { 0 };
        let n = outputs.len() / n_y;
        let depth = self.na * n_y;
        if self.free.len() < depth || self.free.is_empty() {
            // The last measured samples before the first simulated one.
            let begin = (known - self.na.min(known)) * n_y;
            self.free.clear();
            self.free.extend(outputs[begin..known * n_y].iter().map(|y| [*y; LANES]));
            if known * n_y < depth {
                return;
            }
        }
        for k in known..n {
            if self.free.len() >= depth + CHUNK * n_y {
                let used = self.free.len() - depth;
                self.free.drain(..used);
            }
            let end = self.free.len();
            for i in 0..n_y {
                let mut sum = [0.0; LANES];
                for (a, y) in self.past[i].iter().zip(&self.free[end - depth..end]) {
                    for lane in 0..LANES {
                        sum[lane] += a[lane] * y[lane];
                    }
                }
                // u(k - last) .. u(k - first), as the rows are.
                let u =
                    &inputs[(k + 1 - self.lags.1.min(k + 1)) * n_u..(k + 1 - self.lags.0.min(k + 1)) * n_u];
                for (b, u) in self.inputs[i].iter().zip(u) {
                    for lane in 0..LANES {
                        sum[lane] += b[lane] * u;
                    }
                }
                let measured = outputs[k * n_y + i];
                for (error, y) in self.errors[i].iter_mut().zip(&sum) {
                    *error += (measured - y) * (measured - y);
                }
                self.free.push(sum);
            }
        }
    }
}
