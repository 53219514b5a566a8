//! Identified models as TOML: what later commands and other tools read.
//!
//! Numbers are written in the shortest form that reads back bit for bit.

use std::path::{Path, PathBuf};

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::{Arx, Model, StateSpace};

/// An identified model of either kind.
#[derive(Debug, Clone, PartialEq)]
pub enum Linear {
    /// Difference equation.
    Arx(Arx),
    /// State space.
    StateSpace(StateSpace),
}

impl Linear {
    /// The model, whatever its kind.
    pub fn as_model(&self) -> &dyn Model {
        match self {
            Linear::Arx(model) => model,
            Linear::StateSpace(model) => model,
        }
    }
}

/// A model with the names and units of its signals.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedModel {
    /// Model.
    pub model: Linear,
    /// Input names, shape \[n_u\].
    pub inputs: Vec<String>,
    /// Output names, shape \[n_y\].
    pub outputs: Vec<String>,
    /// Units of inputs and outputs, shape \[n_u + n_y\]; empty where not known.
    pub units: Vec<String>,
}

/// Reason why a model file cannot be used.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "file and cause, as named in each message")]
pub enum Error {
    /// File system.
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    /// Not a model file.
    #[error("{}: this is not a model.toml of `airloop identify`: {source}", path.display())]
    Toml { path: PathBuf, source: Box<toml::de::Error> },
    /// Matrices that do not fit together.
    #[error("{}: {what}; the file must be as `airloop identify` writes it", path.display())]
    Shape { path: PathBuf, what: String },
}

type Rows = Vec<Vec<f64>>;

/// The file as it is written.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(non_snake_case, reason = "the names of the matrices")]
struct File {
    kind: Kind,
    sample_time: f64,
    inputs: Vec<String>,
    outputs: Vec<String>,
    units: Vec<String>,
    input_offset: Vec<f64>,
    output_offset: Vec<f64>,
    /// A1, A2, .. or A alone.
    A: Vec<Rows>,
    /// B0, B1, .. or B alone.
    B: Vec<Rows>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    C: Option<Rows>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    D: Option<Rows>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    K: Option<Rows>,
}

#[derive(Serialize, Deserialize, PartialEq)]
#[serde(rename_all = "kebab-case")]
enum Kind {
    Arx,
    StateSpace,
}

/// A matrix \[m, n\] as `m` rows of `n` numbers.
pub fn rows(matrix: &DMatrix<f64>) -> Rows {
    matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
}

/// Text of the file.
pub fn to_toml(named: &NamedModel) -> String {
    let all = |matrices: &[DMatrix<f64>]| matrices.iter().map(rows).collect();
    let base = |kind, sample_time, input_offset: &[f64], output_offset: &[f64]| File {
        kind,
        sample_time,
        inputs: named.inputs.clone(),
        outputs: named.outputs.clone(),
        units: named.units.clone(),
        input_offset: input_offset.to_vec(),
        output_offset: output_offset.to_vec(),
        A: Vec::new(),
        B: Vec::new(),
        C: None,
        D: None,
        K: None,
    };
    let (comment, file) = match &named.model {
        Linear::Arx(m) => (
            "# y(k) + A[0] y(k-1) + A[1] y(k-2) + .. = B[0] u(k) + B[1] u(k-1) + .. about the offsets; matrices by rows.\n",
            File {
                A: all(&m.a),
                B: all(&m.b),
                ..base(Kind::Arx, m.sample_time, &m.input_offset, &m.output_offset)
            },
        ),
        Linear::StateSpace(m) => (
            "# x(k+1) = A x(k) + B u(k) + K e(k), y(k) = C x(k) + D u(k) + e(k) about the offsets; matrices by rows.\n",
            File {
                A: vec![rows(&m.a)],
                B: vec![rows(&m.b)],
                C: Some(rows(&m.c)),
                D: Some(rows(&m.d)),
                K: m.gain.as_ref().map(rows),
                ..base(Kind::StateSpace, m.sample_time, &m.input_offset, &m.output_offset)
            },
        ),
    };
    comment.to_owned() + &toml::to_string(&file).expect("numbers and texts can always be written as TOML")
}

/// Writes a model.
///
/// # Errors
/// [`Error::Io`].
pub fn save(named: &NamedModel, path: &Path) -> Result<(), Error> {
    use std::io::Write;
    airloop_series::file::write_whole(path, |out| out.write_all(to_toml(named).as_bytes()))
        .map_err(|source| Error::Io { path: path.into(), source })
}

/// Reads a model.
///
/// # Errors
/// [`Error`] with the file and what is wrong in it.
pub fn load(path: &Path) -> Result<NamedModel, Error> {
    let text = airloop_series::file::read_to_string(path)
        .map_err(|source| Error::Io { path: path.into(), source })?;
    let file: File = toml::from_str(&text)
        .map_err(|source| Error::Toml { path: path.into(), source: Box::new(source) })?;
    let (n_u, n_y) = (file.inputs.len(), file.outputs.len());
    let shape = |what: String| Error::Shape { path: path.into(), what };
    let matrix = |name: &str, rows: &Rows, (height, width): (usize, usize)| {
        if rows.len() != height || rows.iter().any(|row| row.len() != width) {
            return Err(shape(format!("{name} should have {height} rows of {width} numbers")));
        }
        Ok(DMatrix::from_fn(height, width, |i, j| rows[i][j]))
    };
    if file.input_offset.len() != n_u || file.output_offset.len() != n_y || file.units.len() != n_u + n_y {
        return Err(shape(format!("offsets and units should be those of {n_u} inputs and {n_y} outputs")));
    }
    let (sample_time, input_offset, output_offset) =
        (file.sample_time, file.input_offset, file.output_offset);
    let model = if file.kind == Kind::Arx {
        let a = file.A.iter().map(|a| matrix("A", a, (n_y, n_y))).collect::<Result<_, _>>()?;
        let b = file.B.iter().map(|b| matrix("B", b, (n_y, n_u))).collect::<Result<_, _>>()?;
        Linear::Arx(Arx { sample_time, a, b, input_offset, output_offset })
    } else {
        let [a, b] = [&file.A, &file.B].map(|one| one.first().cloned().unwrap_or_default());
        let n_x = a.len();
        Linear::StateSpace(StateSpace {
            sample_time,
            a: matrix("A", &a, (n_x, n_x))?,
            b: matrix("B", &b, (n_x, n_u))?,
            c: matrix("C", &file.C.unwrap_or_default(), (n_y, n_x))?,
            d: matrix("D", &file.D.unwrap_or_default(), (n_y, n_u))?,
            gain: file.K.as_ref().map(|gain| matrix("K", gain, (n_x, n_y))).transpose()?,
            input_offset,
            output_offset,
        })
    };
    Ok(NamedModel { model, inputs: file.inputs, outputs: file.outputs, units: file.units })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arx() -> NamedModel {
        NamedModel {
            model: Linear::Arx(Arx {
                sample_time: 1e-3,
                a: vec![DMatrix::from_row_slice(2, 2, &[-0.1 - 0.2, 1.0 / 3.0, 5e-324, 1e300])],
                b: vec![DMatrix::from_row_slice(2, 1, &[0.5, -2.0])],
                input_offset: vec![0.25],
                output_offset: vec![0.0, -1e-7],
            }),
            inputs: vec!["u".into()],
            outputs: vec!["a \"b\"".into(), "c".into()],
            units: vec!["N".into(), String::new(), "kPa".into()],
        }
    }

    #[test]
    fn every_bit_of_a_model_survives_its_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("model.toml");
        let Linear::Arx(equation) = arx().model else { panic!() };
        let space = NamedModel { model: Linear::StateSpace(equation.to_state_space()), ..arx() };
        for model in [arx(), space] {
            save(&model, &path).unwrap();
            assert_eq!(load(&path).unwrap(), model);
        }
    }

    #[test]
    fn a_file_with_a_wrong_shape_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("model.toml");
        std::fs::write(&path, to_toml(&arx()).replace("[[0.5], [-2.0]]", "[[0.5, 1.0], [-2.0]]")).unwrap();
        let message = load(&path).unwrap_err().to_string();
        assert!(message.contains("B should have 2 rows of 1 numbers"), "{message}");
        std::fs::write(&path, "kind = \"arx\"").unwrap();
        assert!(load(&path).unwrap_err().to_string().contains("this is not a model.toml"));
    }
}
