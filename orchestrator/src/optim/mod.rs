//! Optimisation: numbers in, numbers out. Nothing here knows of time, models or files.

pub mod least_squares;
