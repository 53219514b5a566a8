//! Reason why records cannot be used for an identification.

/// Reason why records cannot be used for an identification.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "file, line (1-based), column and value, as named in each message")]
pub enum Error {
    /// The file is not a table of numbers.
    #[error(transparent)]
    Csv(#[from] airloop_series::csv::Error),
    /// A channel that is asked for but not there.
    #[error("{file}: there is no column `{column}`; known are: {columns}")]
    NoColumn { file: String, column: String, columns: String },
    /// A column is asked for twice.
    #[error("column `{column}` is named twice in --inputs and --outputs; name each signal once")]
    Twice { column: String },
    /// Not enough samples to speak of a sample time.
    #[error(
        "{file}: {samples} samples are too few to estimate or to judge a model; record at least {needed}"
    )]
    TooShort { file: String, samples: usize, needed: usize },
    /// Time stamps with a gap.
    #[error(
        "{file}: line {line}: gap from {before} s to {after} s in a record with samples every {sample_time} s; cut the file there into two files and give both, as no model may look across a gap"
    )]
    Gap { file: String, line: usize, before: f64, after: f64, sample_time: f64 },
    /// Time stamps at uneven distances.
    #[error(
        "{file}: line {line}: unevenly sampled: this row comes {interval} s after the one before, the mean is {sample_time} s; resample the record at a fixed rate, from the time stamps of the measurement (`airloop resample`, or --resample)"
    )]
    Uneven { file: String, line: usize, interval: f64, sample_time: f64 },
    /// A column without any number.
    #[error(
        "{file}: column `{column}` has no number in any row (all NaN or empty); take it out of --inputs or --outputs, or record the signal"
    )]
    NoNumbers { file: String, column: String },
    /// A column with missing values.
    #[error(
        "{file}: line {line}, column `{column}`: the value is missing, as in {missing} of {samples} rows; cut the file there into two files, or fill in the values where that is honest"
    )]
    Missing { file: String, line: usize, column: String, missing: usize, samples: usize },
    /// A column with values at every m-th row only.
    #[error(
        "{file}: column `{column}` has a new value only at every {factor}. row (first without one: line {line}), others more often: columns of different rates; bring all signals to one rate before identifying, the faster ones behind a low-pass filter"
    )]
    Rates { file: String, line: usize, column: String, factor: usize },
    /// Two files with different sample times.
    #[error(
        "{file}: samples every {sample_time} s, but {other} has them every {other_sample_time} s; a discrete-time model has one sample time: resample one of them"
    )]
    SampleTimes { file: String, sample_time: f64, other: String, other_sample_time: f64 },
    /// A column in different units.
    #[error(
        "{file}: column `{column}` is in [{unit}], but in [{other_unit}] in {other}; convert one of the files"
    )]
    Units { file: String, column: String, unit: String, other: String, other_unit: String },
    /// A method that needs all samples at once.
    #[error(
        "these files are read block by block (--stream, or more than 1 GB), but this method needs all samples in memory; use --method least-squares, or cut the files"
    )]
    NotInMemory,
    /// A column that never changes.
    #[error(
        "column `{column}` is {value} in every row of {files}: nothing can be learned from a constant {kind}; {remedy}"
    )]
    Constant { column: String, value: f64, files: String, kind: &'static str, remedy: &'static str },
}
