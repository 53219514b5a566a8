//! Small models that exercise the interface; they describe no machine and are not shipped.

mod all_types;
mod bouncing_ball;
mod copy;

pub use all_types::AllTypes;
pub use bouncing_ball::BouncingBall;
pub use copy::Copy;
