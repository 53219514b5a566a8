//! Equations of the airloop models.
#![forbid(unsafe_code)]
