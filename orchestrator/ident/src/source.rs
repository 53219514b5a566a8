//! Experiments that are read in blocks, as often as an algorithm needs: from memory or from a file.

use std::path::PathBuf;

use super::record::{Error, Record, Survey};
use airloop_series::stream::{Rows, Stream};

/// Samples of a block.
pub const BLOCK: usize = 4096;

/// Consecutive samples of one experiment, with some before them.
#[derive(Debug, Clone, Copy)]
pub struct Window<'a> {
    /// Inputs, shape \[n_u\]\[before + n\].
    pub inputs: &'a [&'a [f64]],
    /// Outputs, shape \[n_y\]\[before + n\].
    pub outputs: &'a [&'a [f64]],
    /// Samples that were there before; fewer than asked for only at the beginning of the experiment.
    pub before: usize,
    /// Index in the experiment of the first new sample.
    pub at: usize,
}

impl Window<'_> {
    /// Samples, those before included.
    pub fn len(&self) -> usize {
        self.outputs.first().or(self.inputs.first()).map_or(0, |column| column.len())
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// An experiment that can be read from the beginning as often as wanted.
pub trait Source: Sync {
    /// Name in messages.
    fn name(&self) -> &str;
    /// Number of samples.
    fn samples(&self) -> usize;
    /// Time of sample `k` \[s\].
    fn time(&self, k: usize) -> f64;
    /// The first `samples` samples in memory, or all if there are fewer.
    ///
    /// # Errors
    /// Errors of reading the records.
    fn head(&self, samples: usize) -> Result<Record, Error>;
    /// Hands all samples to `take` in order; every window has the last `history` samples of the one before in front.
    ///
    /// # Errors
    /// Errors of reading the records.
    fn windows(&self, history: usize, take: &mut dyn FnMut(Window)) -> Result<(), Error>;
}

impl Source for Record {
    fn name(&self) -> &str {
        &self.name
    }

    fn samples(&self) -> usize {
        self.len()
    }

    fn time(&self, k: usize) -> f64 {
        Record::time(self, k)
    }

    fn head(&self, samples: usize) -> Result<Record, Error> {
        let n = samples.min(self.len());
        let cut = |columns: &[Vec<f64>]| columns.iter().map(|column| column[..n].to_vec()).collect();
        let (name, sample_time, start) = (self.name.clone(), self.sample_time, self.start);
        Ok(Record { name, sample_time, start, inputs: cut(&self.inputs), outputs: cut(&self.outputs) })
    }

    fn windows(&self, history: usize, take: &mut dyn FnMut(Window)) -> Result<(), Error> {
        let mut at = 0;
        while at < self.len() {
            let end = (at + BLOCK).min(self.len());
            let before = history.min(at);
            let inputs: Vec<&[f64]> = self.inputs.iter().map(|column| &column[at - before..end]).collect();
            let outputs: Vec<&[f64]> = self.outputs.iter().map(|column| &column[at - before..end]).collect();
            take(Window { inputs: &inputs, outputs: &outputs, before, at });
            at = end;
        }
        Ok(())
    }
}

/// Samples `from..to` of an experiment, as an experiment of its own.
#[derive(Clone, Copy)]
pub struct Part<'a> {
    /// The whole.
    pub source: &'a dyn Source,
    /// First sample.
    pub from: usize,
    /// Sample after the last.
    pub to: usize,
}

impl Source for Part<'_> {
    fn name(&self) -> &str {
        self.source.name()
    }

    fn samples(&self) -> usize {
        self.to - self.from
    }

    fn time(&self, k: usize) -> f64 {
        self.source.time(self.from + k)
    }

    fn head(&self, samples: usize) -> Result<Record, Error> {
        let mut record = self.source.head(self.from + samples.min(self.samples()))?;
        record.start = self.time(0);
        let columns = record.inputs.iter_mut().chain(&mut record.outputs);
        columns.for_each(|column| drop(column.drain(..self.from.min(column.len()))));
        Ok(record)
    }

    fn windows(&self, history: usize, take: &mut dyn FnMut(Window)) -> Result<(), Error> {
        self.source.windows(history, &mut |window| {
            let begin = window.at - window.before;
            let end = (begin + window.len()).min(self.to);
            let at = window.at.max(self.from);
            let begin_own = begin.max(self.from);
            if at >= end {
                return;
            }
            let kept = begin_own - begin..end - begin;
            let inputs: Vec<&[f64]> = window.inputs.iter().map(|u| &u[kept.clone()]).collect();
            let outputs: Vec<&[f64]> = window.outputs.iter().map(|y| &y[kept.clone()]).collect();
            take(Window { inputs: &inputs, outputs: &outputs, before: at - begin_own, at: at - self.from });
        })
    }
}

/// An experiment in a file, of which only a block is in memory.
#[derive(Debug, Clone)]
pub struct FileSource {
    /// File.
    pub path: PathBuf,
    /// Columns, inputs first.
    pub columns: Vec<String>,
    /// Number of inputs.
    pub n_u: usize,
    /// Result of the first reading.
    pub survey: Survey,
    /// Slopes per sample that are taken away, shape \[n_u + n_y\].
    pub slopes: Vec<f64>,
    /// Sample time \[s\] on which all files agree.
    pub sample_time: f64,
}

impl Source for FileSource {
    fn name(&self) -> &str {
        &self.survey.name
    }

    fn samples(&self) -> usize {
        self.survey.sampling.samples
    }

    fn time(&self, k: usize) -> f64 {
        self.survey.sampling.start + k as f64 * self.sample_time
    }

    fn head(&self, samples: usize) -> Result<Record, Error> {
        let mut columns: Vec<Vec<f64>> = vec![Vec::new(); self.columns.len()];
        self.read(0, samples.min(self.samples()), &mut |window| {
            let new = window.inputs.iter().chain(window.outputs);
            columns.iter_mut().zip(new).for_each(|(column, new)| column.extend_from_slice(new));
        })?;
        let outputs = columns.split_off(self.n_u);
        let (name, start) = (self.survey.name.clone(), self.time(0));
        Ok(Record { name, sample_time: self.sample_time, start, inputs: columns, outputs })
    }

    fn windows(&self, history: usize, take: &mut dyn FnMut(Window)) -> Result<(), Error> {
        self.read(history, self.samples(), take)
    }
}

impl FileSource {
    /// Hands the first `end` samples to `take`.
    fn read(&self, history: usize, end: usize, take: &mut dyn FnMut(Window)) -> Result<(), Error> {
        let mut stream = Stream::open(&self.path, &self.columns)?;
        let mut rows = Rows::default();
        let mut held: Vec<Vec<f64>> = vec![Vec::new(); self.columns.len()];
        let middle = 0.5 * (self.samples() as f64 - 1.0);
        let mut at = 0;
        while at < end {
            let n = stream.read(&mut rows, BLOCK.min(end - at))?;
            if n == 0 {
                break;
            }
            let before = history.min(at);
            for ((held, new), &slope) in held.iter_mut().zip(&rows.columns).zip(&self.slopes) {
                held.drain(..held.len() - before.min(held.len()));
                if slope == 0.0 {
                    held.extend_from_slice(new);
                } else {
                    held.extend(new.iter().enumerate().map(|(k, x)| x - slope * ((at + k) as f64 - middle)));
                }
            }
            let columns: Vec<&[f64]> = held.iter().map(Vec::as_slice).collect();
            let (inputs, outputs) = columns.split_at(self.n_u);
            take(Window { inputs, outputs, before, at });
            at += n;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::set::Request;
    use crate::record::{Detrend, Experiments};

    #[test]
    fn a_file_gives_the_same_windows_as_its_record_in_memory() {
        let n = 2 * BLOCK + 77;
        let rows: String = (0..n)
            .map(|k| {
                format!(
                    "{:.2},{},x,{}\n",
                    0.01 * k as f64,
                    (0.3 * k as f64).sin(),
                    (k * k % 97) as f64 + 0.01 * k as f64
                )
            })
            .collect();
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), format!("time,u,text,y\n{rows}")).unwrap();
        let request = Request {
            estimation: vec![file.path().into()],
            inputs: vec!["u".into()],
            outputs: vec!["y".into()],
            detrend: Detrend::Linear,
            ..Request::default()
        };
        let memory = Experiments::read(&request).unwrap();
        let record = &memory.estimation[0];
        let (_, estimation, _) = Experiments::stream(&request).unwrap();
        let mut windows = Vec::new();
        let copy = |window: Window| {
            (window.at, window.before, window.inputs[0].to_vec(), window.outputs[0].to_vec())
        };
        record.windows(5, &mut |window| windows.push(copy(window))).unwrap();
        let mut found = Vec::new();
        estimation[0].windows(5, &mut |window| found.push(copy(window))).unwrap();
        assert_eq!(windows.len(), 3);
        assert!(found == windows);
        assert_eq!(estimation[0].time(123), record.time(123));
        assert_eq!(estimation[0].head(BLOCK + 9).unwrap(), record.head(BLOCK + 9).unwrap());
        assert_eq!(record.head(BLOCK + 9).unwrap().len(), BLOCK + 9);
    }

    #[test]
    fn a_part_is_an_experiment_of_its_own() {
        let values: Vec<f64> = (0..3 * BLOCK).map(|k| k as f64).collect();
        let record = Record { inputs: vec![values.clone()], outputs: vec![values], ..Record::default() };
        let part = Part { source: &record, from: BLOCK - 2, to: 2 * BLOCK + 3 };
        let mut next = BLOCK as f64 - 2.0;
        part.windows(4, &mut |window| {
            let first = window.before;
            assert_eq!(window.at, next as usize - (BLOCK - 2));
            assert_eq!(first, window.at.min(4));
            for (k, value) in window.outputs[0].iter().enumerate() {
                assert_eq!(*value, next - first as f64 + k as f64);
            }
            next += (window.len() - first) as f64;
        })
        .unwrap();
        assert_eq!(next as usize, 2 * BLOCK + 3);
    }
}
