//! A system of FMUs as one right-hand side: values, first and second derivatives, structure, refusals.
#![cfg(target_os = "linux")]

#[path = "../swing_up/mechanics.rs"]
mod mechanics;
mod swing_up;
