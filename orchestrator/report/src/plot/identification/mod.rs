//! Figures of an identification: residual tests, poles and zeros, responses with bands, fit against order, scatter.
//!
//! Every function returns a whole SVG text. What is told apart by color is also told apart by dashes or markers.
//! Measured against simulated is [`crate::plot::figures::comparison`].

mod correlation;
mod order;
pub(in crate::plot) mod panel;
mod pole_zero;
mod response;
mod scatter;

pub use correlation::{autocorrelations, cross_correlations, stems};
pub use order::{Family, OrderFit, fit_against_order};
pub use pole_zero::pole_zero_map;
pub use response::{frequency_responses, step_responses};
pub use scatter::{Scatter, scatter};

#[cfg(test)]
mod tests;
