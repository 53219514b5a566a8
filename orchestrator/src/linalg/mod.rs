//! Linear algebra that several modules need: factorisations whose structure is known.

mod front;
pub mod sparse_ldl;
pub mod staged_ldl;
pub mod symmetric;
