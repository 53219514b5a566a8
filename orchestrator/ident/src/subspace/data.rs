//! Records about the operating point and scaled to unit RMS, sample by sample, as the estimators read them.

use nalgebra::{DMatrix, DVector};

use super::Error;
use crate::model::StateSpace;
use crate::record::Record;

/// One record: inputs u, shape \[n_u, n\], and outputs y, shape \[n_y, n\], a column per sample.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Segment {
    pub u: DMatrix<f64>,
    pub y: DMatrix<f64>,
}

impl Segment {
    pub fn len(&self) -> usize {
        self.y.ncols()
    }

    /// Samples `from .. from + n`.
    pub fn part(&self, from: usize, n: usize) -> Segment {
        Segment { u: self.u.columns(from, n).into_owned(), y: self.y.columns(from, n).into_owned() }
    }
}

/// Operating point and scale of every channel.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Scale {
    pub sample_time: f64,
    pub input_offset: Vec<f64>,
    pub output_offset: Vec<f64>,
    pub input: DVector<f64>,
    pub output: DVector<f64>,
}

/// Magnitude of a sample from which on sums of squares overflow.
const MAX_MAGNITUDE: f64 = 1e150;

/// Scaled segments, one per record.
///
/// # Errors
/// [`Error::Channels`] for records of different shape, [`Error::Constant`] for a channel without a change,
/// [`Error::NotFinite`].
pub(super) fn scaled(
    records: &[Record],
    input_offset: &[f64],
    output_offset: &[f64],
) -> Result<(Vec<Segment>, Scale), Error> {
    let (n_u, n_y) = (input_offset.len(), output_offset.len());
    for record in records {
        let fits = record.inputs.len() == n_u && record.outputs.len() == n_y;
        let mut channels = record.inputs.iter().chain(&record.outputs);
        if !fits || channels.any(|values| values.len() != record.len()) {
            return Err(Error::Channels {
                record: record.name.clone(),
                inputs: record.inputs.len(),
                outputs: record.outputs.len(),
                n_u,
                n_y,
            });
        }
    }
    let rms = |kind: &'static str, index: usize, offset: f64, of: &dyn Fn(&Record) -> &[f64]| {
        let (mut sum, mut count, mut spread) = (0.0, 0usize, false);
        let first = records.iter().find_map(|record| of(record).first().copied()).unwrap_or(offset);
        for record in records {
            for (sample, &value) in of(record).iter().enumerate() {
                if !value.is_finite() {
                    let record = record.name.clone();
                    return Err(Error::NotFinite { record, kind, index, sample, value });
                }
                if value.abs() >= MAX_MAGNITUDE {
                    let record = record.name.clone();
                    return Err(Error::TooLarge { record, kind, index, sample, value });
                }
                sum += (value - offset) * (value - offset);
                spread |= value != first;
            }
            count += of(record).len();
        }
        if spread { Ok((sum / count as f64).sqrt()) } else { Err(Error::Constant { kind, index }) }
    };
    let input: Vec<f64> = (0..n_u)
        .map(|j| rms("input", j, input_offset[j], &|record| &record.inputs[j]))
        .collect::<Result<_, _>>()?;
    let output: Vec<f64> = (0..n_y)
        .map(|i| rms("output", i, output_offset[i], &|record| &record.outputs[i]))
        .collect::<Result<_, _>>()?;
    let segments = records
        .iter()
        .map(|record| Segment {
            u: DMatrix::from_fn(n_u, record.len(), |j, k| (record.inputs[j][k] - input_offset[j]) / input[j]),
            y: DMatrix::from_fn(n_y, record.len(), |i, k| {
                (record.outputs[i][k] - output_offset[i]) / output[i]
            }),
        })
        .collect();
    let scale = Scale {
        sample_time: records.first().map_or(0.0, |record| record.sample_time),
        input_offset: input_offset.to_vec(),
        output_offset: output_offset.to_vec(),
        input: DVector::from_vec(input),
        output: DVector::from_vec(output),
    };
    Ok((segments, scale))
}

impl Scale {
    /// The model in the units of the records.
    pub fn physical(&self, model: &Matrices, gain: Option<&DMatrix<f64>>) -> StateSpace {
        let to_y = DMatrix::from_diagonal(&self.output);
        let from_u = DMatrix::from_diagonal(&self.input.map(|scale| 1.0 / scale));
        let from_y = DMatrix::from_diagonal(&self.output.map(|scale| 1.0 / scale));
        StateSpace {
            sample_time: self.sample_time,
            a: model.a.clone(),
            b: &model.b * &from_u,
            c: &to_y * &model.c,
            d: &to_y * &model.d * &from_u,
            gain: gain.map(|gain| gain * &from_y),
            input_offset: self.input_offset.clone(),
            output_offset: self.output_offset.clone(),
        }
    }

    /// The matrices of a model in the units of the records, scaled.
    pub fn scaled(&self, model: &StateSpace) -> Matrices {
        let to_u = DMatrix::from_diagonal(&self.input);
        let from_y = DMatrix::from_diagonal(&self.output.map(|scale| 1.0 / scale));
        Matrices {
            a: model.a.clone(),
            b: &model.b * &to_u,
            c: &from_y * &model.c,
            d: &from_y * &model.d * &to_u,
        }
    }
}

/// `x(k+1) = A x(k) + B u(k)`, `y(k) = C x(k) + D u(k)` between scaled signals.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Matrices {
    pub a: DMatrix<f64>,
    pub b: DMatrix<f64>,
    pub c: DMatrix<f64>,
    pub d: DMatrix<f64>,
}

/// Parts of the segments that together have about `samples` samples: all of them if they have no more, else pieces
/// spread evenly over every segment.
pub(super) fn sparse(segments: &[Segment], samples: usize) -> Vec<Segment> {
    let lengths: Vec<usize> = segments.iter().map(Segment::len).collect();
    super::pieces::spread(&lengths, samples)
        .into_iter()
        .map(|(index, from, n)| segments[index].part(from, n))
        .collect()
}
