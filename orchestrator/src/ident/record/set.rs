//! Several files for one identification: names, units and rates agree, and there is something to learn.

use std::path::PathBuf;

use super::read::{self, Survey};
use super::{Detrend, Error, Record, detrend};

/// What to read.
#[derive(Debug, Clone, Default)]
pub struct Request {
    /// Files of the estimation.
    pub estimation: Vec<PathBuf>,
    /// Files of the validation.
    pub validation: Vec<PathBuf>,
    /// Columns of the inputs, shape \[n_u\].
    pub inputs: Vec<String>,
    /// Columns of the outputs, shape \[n_y\].
    pub outputs: Vec<String>,
    /// What is taken away.
    pub detrend: Detrend,
}

/// Records of one identification.
#[derive(Debug, Clone, Default)]
pub struct Experiments {
    /// Input names, shape \[n_u\].
    pub inputs: Vec<String>,
    /// Output names, shape \[n_y\].
    pub outputs: Vec<String>,
    /// Units of inputs and outputs, shape \[n_u + n_y\]; empty text where no file has one.
    pub units: Vec<String>,
    /// Sample time \[s\] of all records.
    pub sample_time: f64,
    /// Records of the estimation, without their slopes if those are to be taken away.
    pub estimation: Vec<Record>,
    /// Records of the validation, in the same way.
    pub validation: Vec<Record>,
    /// Operating point of the inputs, shape \[n_u\]; still in the records, as models work about it.
    pub input_offset: Vec<f64>,
    /// Operating point of the outputs, shape \[n_y\].
    pub output_offset: Vec<f64>,
    /// What should be known about the data, one sentence each.
    pub notes: Vec<String>,
}

impl Experiments {
    /// Reads all files into memory.
    ///
    /// # Errors
    /// [`Error`]: a file that cannot be used, or files that do not belong together.
    pub fn read(request: &Request) -> Result<Experiments, Error> {
        let (mut experiments, surveys) = Experiments::open(request, true)?;
        let records = experiments.estimation.iter_mut().chain(&mut experiments.validation);
        for (record, survey) in records.zip(&surveys) {
            detrend::remove_slopes(record, &detrend::slopes(request.detrend, survey));
        }
        Ok(experiments)
    }

    /// Reads all files once and checks them; without `keep` the records stay empty. The surveys are those of the
    /// estimation, then those of the validation.
    ///
    /// # Errors
    /// As [`Experiments::read`].
    pub fn open(request: &Request, keep: bool) -> Result<(Experiments, Vec<Survey>), Error> {
        let columns: Vec<String> = request.inputs.iter().chain(&request.outputs).cloned().collect();
        let n_u = request.inputs.len();
        if let Some((_, column)) = columns.iter().enumerate().find(|(k, name)| columns[..*k].contains(name)) {
            return Err(Error::Twice { column: column.clone() });
        }
        let (mut surveys, mut records) = (Vec::new(), Vec::new());
        for path in request.estimation.iter().chain(&request.validation) {
            let (survey, record) = read::file(path, &columns, n_u, keep)?;
            surveys.push(survey);
            records.push(record);
        }
        let units = units(&surveys, &columns)?;
        let sample_time = sample_time(&surveys)?;
        records.iter_mut().for_each(|record| record.sample_time = sample_time);
        let estimation = request.estimation.len();
        let mut notes = Vec::new();
        exciting(&surveys[..estimation], &columns, n_u, &mut notes)?;
        surveys.iter().for_each(|survey| notes.extend(survey.notes(&columns)));
        let (input_offset, output_offset) =
            detrend::operating_point(request.detrend, &surveys[..estimation], n_u);
        let validation = records.split_off(estimation);
        let (inputs, outputs) = (request.inputs.clone(), request.outputs.clone());
        let experiments = Experiments {
            inputs,
            outputs,
            units,
            sample_time,
            estimation: records,
            validation,
            input_offset,
            output_offset,
            notes,
        };
        Ok((experiments, surveys))
    }
}

/// Units on which all files that give one agree.
fn units(surveys: &[Survey], columns: &[String]) -> Result<Vec<String>, Error> {
    let mut units = Vec::new();
    for (index, column) in columns.iter().enumerate() {
        let mut given = surveys.iter().filter_map(|survey| Some((survey, survey.units[index].as_ref()?)));
        let Some((first, unit)) = given.next() else {
            units.push(String::new());
            continue;
        };
        if let Some((survey, other)) = given.find(|(_, other)| *other != unit) {
            return Err(Error::Units {
                file: survey.name.clone(),
                column: column.clone(),
                unit: other.clone(),
                other: first.name.clone(),
                other_unit: unit.clone(),
            });
        }
        units.push(unit.clone());
    }
    Ok(units)
}

/// The sample time on which all files agree; that of the file that tells it best.
fn sample_time(surveys: &[Survey]) -> Result<f64, Error> {
    let Some(first) = surveys.first() else { return Ok(0.0) };
    let best = surveys.iter().fold(first, |best, other| {
        if other.sampling.uncertainty < best.sampling.uncertainty { other } else { best }
    });
    for survey in surveys {
        let (one, other) = (survey.sampling, best.sampling);
        let allowed = 1e-6 + 2.0 * (one.uncertainty + other.uncertainty);
        if (one.sample_time / other.sample_time - 1.0).abs() > allowed {
            return Err(Error::SampleTimes {
                file: survey.name.clone(),
                sample_time: one.sample_time,
                other: best.name.clone(),
                other_sample_time: other.sample_time,
            });
        }
    }
    Ok(best.sampling.sample_time)
}

/// Every signal changes in some record of the estimation; where it does not in one of several, a note says so.
fn exciting(
    surveys: &[Survey],
    columns: &[String],
    n_u: usize,
    notes: &mut Vec<String>,
) -> Result<(), Error> {
    for (index, column) in columns.iter().enumerate() {
        let constant: Vec<&Survey> = surveys.iter().filter(|s| s.channels[index].is_constant()).collect();
        let value = constant.first().map_or(0.0, |survey| survey.channels[index].min.value);
        let same = |survey: &&Survey| survey.channels[index].min.value == value;
        if constant.len() == surveys.len() && constant.iter().all(same) && !surveys.is_empty() {
            let files: Vec<&str> = surveys.iter().map(|survey| survey.name.as_str()).collect();
            let (kind, remedy) = if index < n_u {
                ("input", "excite it (see `airloop excite`), or take it out of --inputs")
            } else {
                ("output", "check the sensor, or take it out of --outputs")
            };
            let (column, files) = (column.clone(), files.join(", "));
            return Err(Error::Constant { column, value, files, kind, remedy });
        }
        for survey in constant {
            notes.push(format!("{}: `{column}` never changes in this record", survey.name));
        }
    }
    Ok(())
}
