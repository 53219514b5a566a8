//! Search for missing effects in any [`System`]: fits, goodness of fit, selection. Knows no physics.

mod acceptance;
pub mod candidate;
pub mod corrected;
mod exchange;
pub mod fit;
mod folds;
pub mod forward_selection;
pub mod goodness;
pub mod held_out;
pub mod ladder;
pub mod near;
pub mod noise;
pub mod normal;
mod pairs;
pub mod parallel;
pub mod question;
pub mod search;
pub mod select;
mod sets;
pub mod settings;
mod step;
pub mod stop;
pub mod system;
pub mod weighted;

pub use system::{Span, System};
