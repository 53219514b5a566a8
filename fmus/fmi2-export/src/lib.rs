//! FMI 2.0 export for Rust.
