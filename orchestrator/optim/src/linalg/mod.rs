//! Linear algebra that nalgebra does not bring: factorizations whose structure is known, and one that streams.
//!
//! | module | what |
//! |--------|------|
//! | [`qr`] | QR of a tall matrix whose rows arrive in blocks; sub-problems from its triangle |
//! | [`spectral`] | singular values and eigenvalues by iterations that always end |
//! | [`sparse_ldl`], [`staged_ldl`] | factorizations of sparse symmetric matrices |
//! | [`symmetric`] | symmetric matrices |
//! | [`triangular`] | least squares from a triangle that may lack rank |
//!
//! Knows nothing of signals and models.

mod front;
pub mod qr;
pub mod sparse_ldl;
pub mod spectral;
pub mod staged_ldl;
pub mod symmetric;
pub mod triangular;

pub use qr::{StreamedQr, Triangle};
