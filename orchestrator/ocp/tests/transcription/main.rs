//! The transcriptions over the trait `Dynamics`: against the nonlinear programs typed by hand, published optima, closed
//! forms and differences.

mod arm;
mod cart_pole;
mod counts;
mod derivatives;
#[path = "../swing_up/guesses.rs"]
mod guesses;
#[path = "../swing_up/interval.rs"]
mod interval;
mod kelly;
mod messages;
mod phases;
#[allow(dead_code, reason = "what only the hand-written runs use")]
#[path = "../swing_up/problem.rs"]
mod problem;
mod resolve;
mod same_program;
mod swing_up;
