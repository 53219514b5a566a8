//! `--fmu`: an identified ARX model as an FMU, derived from one of the project's own.

use std::path::Path;

use crate::identify::linear_fmu::Wanted;
use airloop::Error;
use airloop_fmi::derive::{Derivation, Value, derive};
use airloop_fmi::template_folder::template;
use airloop_ident::model::{Arx, Model, StateSpace};
use nalgebra::DMatrix;

/// Limits of `arx-actuator`: na, nb, nk, n_y.
const ARX_LIMITS: (usize, usize, usize, usize) = (4, 5, 64, 2);

/// Checks that the model fits into one of the FMUs.
///
/// # Errors
/// As for [`write`], where the model is too large.
pub fn check(wanted: &Wanted, arx: &Arx) -> Result<(), Error> {
    if actuator(arx).is_some() {
        return Ok(());
    }
    let (short, delays) = without_delays(arx);
    wanted.check(short.to_state_space().order(), &delays)
}

/// Writes the model into `folder`. With one input and at most two outputs about zero it becomes an `arx-actuator`,
/// else a `linear-state-space`. Both start at rest: commands and outputs at the operating point.
///
/// # Errors
/// A model that is too large, a template that is not found, or a file that cannot be written.
pub fn write(wanted: &Wanted, name: &str, arx: &Arx, folder: &Path, description: &str) -> Result<(), Error> {
    let Some(start) = actuator(arx) else {
        let (short, delays) = without_delays(arx);
        return wanted.write_delayed(&with_a_state(short.to_state_space()), &delays, description, folder);
    };
    let (name, description) = (name.to_owned(), description.to_owned());
    let derivation = Derivation { name, description, start, resources: Vec::new() };
    derive(&template("arx-actuator", None)?, &folder.join(wanted.file()), &derivation)?;
    Ok(())
}

/// An FMU has one state at least; a model without memory gets one that does nothing.
fn with_a_state(model: StateSpace) -> StateSpace {
    if model.order() > 0 {
        return model;
    }
    let (n_u, n_y) = (model.n_u(), model.n_y());
    let (a, b, c) = (DMatrix::zeros(1, 1), DMatrix::zeros(1, n_u), DMatrix::zeros(n_y, 1));
    StateSpace { a, b, c, ..model }
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
    Some((name.to_owned(), Value::Integer(i64::try_from(value).ok()?)))
}

fn places(rows: usize, columns: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..rows).flat_map(move |i| (0..columns).map(move |j| (i, j)))
}

#[cfg(test)]
mod tests {
    use super::*;

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
