//! A system of FMUs as one right-hand side: values, first and second derivatives, structure, refusals.
#![cfg(target_os = "linux")]

mod behavior;
mod swing_up;
