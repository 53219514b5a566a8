//! Several files for one identification: names, units and rates agree, and there is something to learn.

use std::path::PathBuf;

use super::read::{self, Survey};
use super::{Detrend, Error, Record, detrend};
use crate::source::FileSource;

/// Request for records to read.
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
    /// Trend to remove.
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
    /// Notes on the data, one sentence each.
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

    /// Reads all files once and checks them, and gives sources that read them again, in constant memory; the records of
    /// the experiments stay empty. Estimation first, then validation.
    ///
    /// # Errors
    /// Same as [`Experiments::read`].
    pub fn stream(request: &Request) -> Result<(Experiments, Vec<FileSource>, Vec<FileSource>), Error> {
        let (experiments, surveys) = Experiments::open(request, false)?;
        let columns: Vec<String> = request.inputs.iter().chain(&request.outputs).cloned().collect();
        let paths = request.estimation.iter().chain(&request.validation);
        let source = |(path, survey): (&PathBuf, Survey)| FileSource {
            path: path.clone(),
            columns: columns.clone(),
            n_u: request.inputs.len(),
            slopes: detrend::slopes(request.detrend, &survey),
            survey,
            sample_time: experiments.sample_time,
        };
        let mut estimation: Vec<FileSource> = paths.zip(surveys).map(source).collect();
        let validation = estimation.split_off(request.estimation.len());
        Ok((experiments, estimation, validation))
    }

    /// Reads all files once and checks them; without `keep` the records stay empty. The surveys are those of the
    /// estimation, then those of the validation.
    ///
    /// # Errors
    /// Same as [`Experiments::read`].
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
        notes.extend(twice(&request.estimation, &request.validation));
        if request.detrend == Detrend::None {
            notes.extend(large_means(&surveys[..estimation], &columns));
        }
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

/// Mean relative to the spread of a signal from which on a model about zero is doubtful.
const MAX_MEAN_OVER_SPREAD: f64 = 3.0;

/// Signals whose mean is large against their spread, over all records of the estimation, in one sentence.
fn large_means(surveys: &[Survey], columns: &[String]) -> Option<String> {
    let samples: f64 = surveys.iter().map(|survey| survey.sampling.samples as f64).sum();
    let large = |&index: &usize| {
        let over = |of: &dyn Fn(&super::channel::Channel) -> f64| {
            let part = |survey: &Survey| of(&survey.channels[index]) * survey.sampling.samples as f64;
            surveys.iter().map(part).sum::<f64>() / samples
        };
        let mean = over(&|channel| channel.mean());
        let variance = over(&|channel| channel.variance() + (channel.mean() - mean).powi(2));
        mean.abs() > MAX_MEAN_OVER_SPREAD * variance.sqrt()
    };
    let names: Vec<String> =
        (0..columns.len()).filter(large).map(|index| format!("`{}`", columns[index])).collect();
    let which = if names.len() == 1 { "its spread" } else { "their spread" };
    (!names.is_empty()).then(|| {
        format!(
            "the mean of {} is larger than {MAX_MEAN_OVER_SPREAD} times {which}, and a linear model has its rest at zero: use --detrend mean, so that it works about the mean",
            names.join(", ")
        )
    })
}

/// Files that are given more than once, a sentence each.
fn twice(estimation: &[PathBuf], validation: &[PathBuf]) -> Vec<String> {
    let real = |path: &PathBuf| path.canonicalize().unwrap_or_else(|_| path.clone());
    let (first, second): (Vec<_>, Vec<_>) =
        (estimation.iter().map(real).collect(), validation.iter().map(real).collect());
    let mut notes = Vec::new();
    for (paths, real, what) in [
        (estimation, &first, "it counts twice in the estimation"),
        (validation, &second, "it counts twice in the validation"),
    ] {
        let again = paths.iter().enumerate().filter(|(index, _)| real[..*index].contains(&real[*index]));
        notes.extend(again.map(|(_, path)| format!("{} is given twice: {what}", path.display())));
    }
    let judged = validation.iter().zip(&second).filter(|(_, path)| first.contains(path));
    notes.extend(judged.map(|(path, _)| {
        format!(
            "{} is a file of the estimation and of the validation: its fit is no proof; validate with data that were not used",
            path.display()
        )
    }));
    notes
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

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn write(folder: &Path, name: &str, offset: f64) -> PathBuf {
        let value = |k: i32| (0.7 * f64::from(k * k)).sin();
        let rows: String = (0..50)
            .map(|k| format!("{},{},{}\n", 0.1 * f64::from(k), value(k), value(k + 3) + offset))
            .collect();
        let path = folder.join(name);
        std::fs::write(&path, format!("time,u,y\n{rows}")).unwrap();
        path
    }

    fn notes(estimation: &[&PathBuf], validation: &[&PathBuf], detrend: Detrend) -> Vec<String> {
        let paths = |paths: &[&PathBuf]| paths.iter().map(|path| (*path).clone()).collect();
        let (inputs, outputs) = (vec!["u".into()], vec!["y".into()]);
        let (estimation, validation) = (paths(estimation), paths(validation));
        Experiments::read(&Request { estimation, validation, inputs, outputs, detrend }).unwrap().notes
    }

    #[test]
    fn a_mean_that_is_large_against_the_spread_is_told_unless_it_is_taken_away() {
        let folder = tempfile::tempdir().unwrap();
        let (low, high) = (write(folder.path(), "low.csv", 1.0), write(folder.path(), "high.csv", 100.0));
        let found = notes(&[&high], &[], Detrend::None);
        assert!(found.len() == 1 && found[0].contains("mean of `y` is larger"), "{found:?}");
        assert!(found[0].contains("--detrend mean"));
        assert!(notes(&[&high], &[], Detrend::Mean).is_empty());
        assert!(notes(&[&low], &[], Detrend::None).is_empty());
        // 1 and 100 in two files are a spread of 50 about 50.
        assert!(notes(&[&low, &high], &[], Detrend::None).is_empty());
    }

    #[test]
    fn a_file_that_is_given_twice_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let (a, b) = (write(folder.path(), "a.csv", 0.0), write(folder.path(), "b.csv", 0.5));
        assert!(notes(&[&a], &[&b], Detrend::None).is_empty());
        let other_way = folder.path().join(".").join("a.csv");
        assert!(notes(&[&a, &other_way], &[], Detrend::None)[0].contains("counts twice in the estimation"));
        assert!(notes(&[&a], &[&a, &b], Detrend::None)[0].contains("no proof"));
    }
}
