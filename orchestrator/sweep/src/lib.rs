//! Thousands of independent tasks: simulations over samples of parameters, trials, fits, searches.
//!
//! A [`manifest::Manifest`] is made of a plan ([`file::PlanFile`]); it says what every task is, from its number alone,
//! and what all of them read. A [`shard::Runner`] runs consecutive tasks and writes their rows as one file, on any
//! machine that sees the folder, in any order, again after a crash. [`merge::merge`] makes one table of them, whose
//! bytes do not depend on the number of shards, threads or machines.
//!
//! [`slurm`] hands shards to a cluster, [`report`] draws what was merged.

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod digest;
pub mod error;
pub mod file;
mod follow;
pub mod manifest;
pub mod merge;
mod own;
mod parquet_file;
pub mod report;
pub mod sample;
pub mod shard;
pub mod signals;
pub mod slurm;
pub mod table;
pub mod task;

pub use error::Error;
pub use task::Task;
