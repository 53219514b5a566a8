//! `--fmu`: an identified model as an FMU, derived from one of the project's own.

use std::path::Path;

use crate::Error;
use crate::fmu::derive::{Derivation, Value, derive};
use crate::fmu::template_folder::template;
use crate::ident::model::{Arx, Linear, Model, NamedModel, StateSpace};

/// Limits of `arx-actuator`: na, nb, nk, n_y.
const ARX_LIMITS: (usize, usize, usize, usize) = (4, 5, 64, 2);
/// Limits of `linear-state-space`: states, inputs, outputs, nk.
const STATE_SPACE_LIMITS: (usize, usize, usize, usize) = (12, 4, 4, 64);

/// Writes `NAME.fmu` into the folder and gives its file name. An ARX model with one input and at most two outputs about
/// zero becomes an `arx-actuator`, everything else a `linear-state-space`. Both start at rest: commands and outputs at
/// the operating point.
///
/// # Errors
/// A model that is too large, a template that is not found, or a file that cannot be written.
pub fn write(named: &NamedModel, name: &str, folder: &Path, description: &str) -> Result<String, Error> {
    let name = name.strip_suffix(".fmu").unwrap_or(name);
    let file = format!("{name}.fmu");
    let arx = match &named.model {
        Linear::Arx(arx) => actuator(arx),
        Linear::StateSpace(_) => None,
    };
    let (of, start) = match arx {
        Some(start) => ("arx-actuator", start),
        None => ("linear-state-space", state_space(&named.model)?),
    };
    let derivation =
        Derivation { name: name.into(), description: description.into(), start, resources: Vec::new() };
    derive(&template(of, None)?, &folder.join(&file), &derivation)?;
    Ok(file)
}

/// Start values of `arx-actuator`, if the model fits into it.
fn actuator(arx: &Arx) -> Option<Vec<(String, Value)>> {
    let (arx, delays) = without_delays(arx);
    let (na, nb, nk, n_y) = (arx.a.len().max(1), arx.b.len().max(1), *delays.first()?, arx.n_y());
    let about_zero = arx.input_offset.iter().chain(&arx.output_offset).all(|offset| *offset == 0.0);
    let (most_na, most_nb, most_nk, most_n_y) = ARX_LIMITS;
    if arx.n_u() != 1 || !about_zero || na > most_na || nb > most_nb || nk > most_nk || n_y > most_n_y {
        return None;
    }
    let mut start = vec![
        integer("na", na)?,
        integer("nb", nb)?,
        integer("nk", nk)?,
        integer("ny", n_y)?,
        ("sample_time".into(), Value::Real(arx.sample_time)),
    ];
    for lag in 1..=na {
        for (i, j) in places(n_y, n_y) {
            let value = arx.a.get(lag - 1).map_or(0.0, |a| a[(i, j)]);
            start.push((format!("A{lag}[{},{}]", i + 1, j + 1), Value::Real(value)));
        }
    }
    for lag in 0..nb {
        for i in 0..n_y {
            let value = arx.b.get(lag).map_or(0.0, |b| b[(i, 0)]);
            start.push((format!("B{lag}[{}]", i + 1), Value::Real(value)));
        }
    }
    Some(start)
}

/// Start values of `linear-state-space`.
fn state_space(model: &Linear) -> Result<Vec<(String, Value)>, Error> {
    let (space, delays): (StateSpace, Vec<usize>) = match model {
        Linear::Arx(arx) => {
            let (arx, delays) = without_delays(arx);
            (arx.to_state_space(), delays)
        }
        Linear::StateSpace(space) => (space.clone(), vec![0; space.n_u()]),
    };
    let found = (space.order(), space.n_u(), space.n_y(), delays.iter().copied().max().unwrap_or(0));
    let most = STATE_SPACE_LIMITS;
    if found.0 > most.0 || found.1 > most.1 || found.2 > most.2 || found.3 > most.3 {
        let reason = format!(
            "the model has {} states, {} inputs, {} outputs and delays up to {} samples; an FMU takes {}, {}, {} and {} at most: lower the orders, or leave --fmu away",
            found.0, found.1, found.2, found.3, most.0, most.1, most.2, most.3
        );
        return Err(Error::NoFmu { reason });
    }
    let mut start: Vec<(String, Value)> = Vec::new();
    // An FMU has one state at least.
    let sizes = [("n_x", found.0.max(1)), ("n_u", found.1), ("n_y", found.2)];
    start.extend(sizes.into_iter().filter_map(|(name, size)| integer(name, size)));
    start.push(("sample_time".into(), Value::Real(space.sample_time)));
    for (name, matrix) in [("A", &space.a), ("B", &space.b), ("C", &space.c), ("D", &space.d)] {
        for (i, j) in places(matrix.nrows(), matrix.ncols()) {
            start.push((format!("{name}[{},{}]", i + 1, j + 1), Value::Real(matrix[(i, j)])));
        }
    }
    if found.0 == 0 {
        let unused = (0..found.1)
            .map(|j| format!("B[1,{}]", j + 1))
            .chain((0..found.2).map(|i| format!("C[{},1]", i + 1)));
        start.extend(unused.chain(["A[1,1]".to_owned()]).map(|name| (name, Value::Real(0.0))));
    }
    for (j, (offset, delay)) in space.input_offset.iter().zip(&delays).enumerate() {
        start.push((format!("u_offset[{}]", j + 1), Value::Real(*offset)));
        start.extend(integer(&format!("nk[{}]", j + 1), *delay));
    }
    for (i, offset) in space.output_offset.iter().enumerate() {
        start.push((format!("y_offset[{}]", i + 1), Value::Real(*offset)));
    }
    start.extend((0..found.0.max(1)).map(|i| (format!("x[{}]", i + 1), Value::Real(0.0))));
    Ok(start)
}

/// The same model with the delay that all outputs have in common taken out of each input.
fn without_delays(arx: &Arx) -> (Arx, Vec<usize>) {
    let delay = |j: usize| {
        let first = arx.b.iter().position(|b| b.column(j).iter().any(|value| *value != 0.0));
        first.unwrap_or(0)
    };
    let delays: Vec<usize> = (0..arx.n_u()).map(delay).collect();
    let mut short = arx.clone();
    for (j, &delay) in delays.iter().enumerate() {
        for lag in 0..arx.b.len() {
            match arx.b.get(lag + delay) {
                Some(b) => short.b[lag].set_column(j, &b.column(j)),
                None => short.b[lag].column_mut(j).fill(0.0),
            }
        }
    }
    while short.b.len() > 1 && short.b.last().is_some_and(|b| b.iter().all(|value| *value == 0.0)) {
        short.b.pop();
    }
    (short, delays)
}

fn integer(name: &str, value: usize) -> Option<(String, Value)> {
    Some((name.to_owned(), Value::Integer(i32::try_from(value).ok()?)))
}

fn places(rows: usize, columns: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..rows).flat_map(move |i| (0..columns).map(move |j| (i, j)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    #[test]
    fn a_delay_moves_from_the_coefficients_into_the_input() {
        let gain = |values: [f64; 2]| DMatrix::from_row_slice(1, 2, &values);
        let arx = Arx {
            sample_time: 0.1,
            a: vec![DMatrix::from_element(1, 1, -0.5)],
            b: vec![gain([0.0, 3.0]), gain([0.0, 0.0]), gain([1.0, 4.0])],
            input_offset: vec![0.0; 2],
            output_offset: vec![0.0],
        };
        let (short, delays) = without_delays(&arx);
        assert_eq!(delays, [2, 0]);
        assert_eq!(short.b, [gain([1.0, 3.0]), gain([0.0, 0.0]), gain([0.0, 4.0])]);
        assert!(actuator(&arx).is_none());
    }
}
