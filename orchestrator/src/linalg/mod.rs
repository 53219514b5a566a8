//! Dense linear algebra that streams: what nalgebra does not bring.
//!
//! | module | what |
//! |--------|------|
//! | [`qr`] | QR of a tall matrix whose rows arrive in blocks; sub-problems from its triangle |
//!
//! Knows nothing of signals and models.

pub mod qr;

pub use qr::{StreamedQr, Triangle};
//! Linear algebra that several modules need: factorisations whose structure is known.

mod front;
pub mod sparse_ldl;
pub mod staged_ldl;
pub mod symmetric;
