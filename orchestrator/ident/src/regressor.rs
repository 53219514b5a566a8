//! The regression of an ARX model, folded into a triangle while the data stream by.
//!
//! One triangle holds the regressors of all equations and, behind them, the outputs. Every equation, and every
//! structure with fewer regressors, is a selection of its columns.

use super::record::Error;
use super::source::{Source, Window};
use super::structure::{Structure, Term};
use airloop_optim::linalg::{StreamedQr, Triangle};

/// The triangle of all regressors and outputs of one or several experiments.
#[derive(Debug, Clone)]
pub struct Regression {
    /// Regressors, the first columns of the triangle.
    pub terms: Vec<Term>,
    /// Triangle, shape \[terms + n_y, terms + n_y\].
    pub triangle: Triangle,
    /// Samples at the beginning of every experiment that are only looked back on.
    pub lags: usize,
}

impl Regression {
    /// Reads the experiments once. No row looks across the border of two experiments.
    ///
    /// `input_offset` and `output_offset`, shapes \[n_u\] and \[n_y\], are subtracted.
    ///
    /// # Errors
    /// Errors of reading the records.
    pub fn of(
        sources: &[&dyn Source],
        structure: &Structure,
        (input_offset, output_offset): (&[f64], &[f64]),
    ) -> Result<Regression, Error> {
        let terms = structure.all_terms();
        let lags = structure.lags();
        let mut qr = StreamedQr::new(terms.len() + structure.n_y());
        for source in sources {
            source.windows(lags, &mut |window| {
                fold(&mut qr, &terms, lags, &window, (input_offset, output_offset));
            })?;
        }
        Ok(Regression { terms, triangle: qr.finish(), lags })
    }

    /// Column of a regressor.
    pub fn column(&self, term: Term) -> Option<usize> {
        self.terms.iter().position(|known| *known == term)
    }
}

fn fold(
    qr: &mut StreamedQr,
    terms: &[Term],
    lags: usize,
    window: &Window,
    (input_offset, output_offset): (&[f64], &[f64]),
) {
    // The first rows of an experiment have no past.
    let mut at = window.before.max(lags.saturating_sub(window.at - window.before));
    while at < window.len() {
        let rows = qr.space().min(window.len() - at);
        qr.append(rows, |column, out| match terms.get(column) {
            Some(&Term::Output { channel, lag }) => {
                let (past, offset) = (&window.outputs[channel][at - lag..], output_offset[channel]);
                out.iter_mut().zip(past).for_each(|(out, y)| *out = offset - y);
            }
            Some(&Term::Input { channel, lag }) => {
                let (past, offset) = (&window.inputs[channel][at - lag..], input_offset[channel]);
                out.iter_mut().zip(past).for_each(|(out, u)| *out = u - offset);
            }
            None => {
                let channel = column - terms.len();
                let (now, offset) = (&window.outputs[channel][at..], output_offset[channel]);
                out.iter_mut().zip(now).for_each(|(out, y)| *out = y - offset);
            }
        });
        at += rows;
    }
}
