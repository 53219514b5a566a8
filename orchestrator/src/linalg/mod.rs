//! Linear algebra that several modules need, beyond what nalgebra brings.
//!
//! | module | what |
//! |--------|------|
//! | [`qr`] | QR of a tall matrix whose rows arrive in blocks; sub-problems from its triangle |
//! | [`sparse_ldl`], [`staged_ldl`], [`symmetric`] | factorisations whose structure is known |
//!
//! Knows nothing of signals and models.

mod front;
pub mod qr;
pub mod sparse_ldl;
pub mod staged_ldl;
pub mod symmetric;

pub use qr::{StreamedQr, Triangle};
