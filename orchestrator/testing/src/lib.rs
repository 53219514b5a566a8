//! Common parts of the tests of several crates: FMUs compiled from small C files, and a count of allocations.
//!
//! Each module makes one FMU or family of FMUs; the C sources stand in `c/` and say what the FMU does. Depends on no
//! other crate of the workspace, so that every crate can use it in its tests.

#![allow(missing_docs, reason = "models of tests: the C file next to each says what it does")]

pub mod allocations;
pub mod bent;
pub mod c_fmu;
pub mod carriage;
pub mod fmu_library;
pub mod hostile;
pub mod joints;
pub mod looped;
pub mod mechanics;
pub mod model;
pub mod slave;
pub mod subject;
pub mod vector;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
