//! A system of FMUs as one right-hand side: values, first and second derivatives, structure, refusals.
#![cfg(target_os = "linux")]

mod behaviour;
#[path = "../bent/mod.rs"]
mod bent;
#[path = "../c_fmu/mod.rs"]
mod c_fmu;
#[path = "../looped/mod.rs"]
mod looped;
#[allow(dead_code, reason = "the test of the optimiser uses more of it")]
#[path = "../swing_up/mechanics.rs"]
mod mechanics;
mod swing_up;
