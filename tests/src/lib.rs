//! End-to-end tests live in `tests/rust` and `tests/fmpy`; this library is empty.
