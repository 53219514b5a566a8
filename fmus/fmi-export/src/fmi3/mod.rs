//! FMI 3.0 from the same table and equations as 2.0: value references, names, model description. The functions are in
//! `abi::fmi3`.
//!
//! Every variable stays a scalar with its name. What FMI 3.0 wants beyond 2.0 is added: the independent variable
//! `time`, and one variable for each event indicator.

mod description;
pub(crate) mod names;
pub(crate) mod references;

pub use description::text;
