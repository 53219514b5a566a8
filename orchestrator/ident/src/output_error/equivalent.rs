//! Full ARX structures as state space: the same models in coordinates in which the iterations go straighter.
//!
//! With full `A1 .. A_na` and `B0 .. B_na` (or `B1 .. B_na`), `A(z)^-1 B(z)` is the general model of order `n_y na`
//! (with or without direct term). The coefficients of a quickly sampled model are nearly collinear and have to move
//! along curves; local coordinates of the state-space model do not.

use nalgebra::DMatrix;

use super::state_space::{StateSpaceOptions, refine_state_space};
use super::{Criterion, Options};
use crate::model::{Arx, Model, StateSpace};
use crate::rational::Mask;
use crate::record::Record;

/// Largest state-space order that is worth the cost of its directions.
const MAX_ORDER: usize = 16;

/// Whether the structure is that of a general state-space model, and then whether it has a direct term.
fn direct_term(mask: &Mask, n_y: usize) -> Option<bool> {
    let all = |m: &DMatrix<bool>| m.iter().all(|free| *free);
    let na = mask.a.len();
    let full = na > 0 && mask.b.len() == na + 1 && mask.a.iter().chain(&mask.b[1..]).all(all);
    let none = full && mask.b[0].iter().all(|free| !free);
    (full && n_y * na <= MAX_ORDER && (none || all(&mask.b[0]))).then_some(!none)
}

/// Refines as state space and goes back; `None` if the structure is another or the way back is not exact.
pub(super) fn refined(start: &Arx, mask: &Mask, records: &[Record], options: &Options) -> Option<Arx> {
    let direct_term = direct_term(mask, start.output_offset.len())?;
    let mut state_space = start.to_state_space();
    if !direct_term {
        state_space.d.fill(0.0);
    }
    let settings = StateSpaceOptions { iterations: *options, criterion: Criterion::Simulation, direct_term };
    let found = refine_state_space(&state_space, records, &settings).ok()?;
    let model = to_arx(&found.model, mask.a.len())?;
    Some(mask.model(start, &mask.parameters(&model)))
}

/// The difference equation of a state-space model of order `n_y na` whose first `na` blocks of the observability matrix
/// have full rank.
fn to_arx(model: &StateSpace, na: usize) -> Option<Arx> {
    let (n_y, n_x) = (model.d.nrows(), model.order());
    if n_x != n_y * na {
        return None;
    }
    // C A^na = -(A_na C + A_(na-1) C A + .. + A1 C A^(na-1))
    let mut observability = DMatrix::zeros(n_x, n_x);
    let mut row = model.c.clone();
    for block in 0..na {
        observability.view_mut((block * n_y, 0), (n_y, n_x)).copy_from(&row);
        row = &row * &model.a;
    }
    let coefficients = observability.transpose().lu().solve(&-row.transpose())?.transpose();
    if !coefficients.iter().all(|value| value.is_finite()) {
        return None;
    }
    let a: Vec<DMatrix<f64>> =
        (1..=na).map(|lag| coefficients.columns((na - lag) * n_y, n_y).into_owned()).collect();
    // B_j = h_j + A1 h_(j-1) + .. with the impulse response h.
    let mut impulse = vec![model.d.clone()];
    let mut reached = model.b.clone();
    for _ in 0..na {
        impulse.push(&model.c * &reached);
        reached = &model.a * reached;
    }
    let b = (0..=na)
        .map(|j| (1..=j).fold(impulse[j].clone(), |sum, lag| sum + &a[lag - 1] * &impulse[j - lag]))
        .collect();
    Some(Arx {
        sample_time: model.sample_time,
        a,
        b,
        input_offset: model.input_offset.clone(),
        output_offset: model.output_offset.clone(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::eq8;

    #[test]
    fn the_way_to_state_space_and_back_keeps_the_coefficients() {
        let mut model = eq8();
        model.a.push(DMatrix::from_row_slice(2, 2, &[0.1, 0.02, -0.03, 0.05]));
        model.b.push(DMatrix::from_row_slice(2, 1, &[0.2, -0.1]));
        let back = to_arx(&model.to_state_space(), 2).unwrap();
        for (found, expected) in back.a.iter().chain(&back.b).zip(model.a.iter().chain(&model.b)) {
            assert!((found - expected).amax() < 1e-10, "{found}");
        }
    }

    #[test]
    fn only_full_structures_are_general_state_space() {
        assert_eq!(direct_term(&Mask::full(2, 1, 2, 3, 0), 2), Some(true));
        assert_eq!(direct_term(&Mask::full(2, 1, 2, 2, 1), 2), Some(false));
        assert_eq!(direct_term(&Mask::full(2, 1, 2, 2, 0), 2), None);
        let mut mask = Mask::full(2, 1, 2, 3, 0);
        mask.a[0][(0, 1)] = false;
        assert_eq!(direct_term(&mask, 2), None);
    }
}
