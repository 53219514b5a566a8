//! State of the process that a library may change without being asked: the rounding of numbers, and the working
//! directory. Both are set back after the calls in which libraries do so, with a note that names the FMU.

#![allow(unsafe_code, reason = "reads and writes a register of the processor")]

use std::path::{Path, PathBuf};

use super::isolate;

/// The working directory before a call.
pub(crate) struct Surroundings<'a> {
    shown: &'a Path,
    folder: Option<PathBuf>,
}

impl<'a> Surroundings<'a> {
    /// Those before a call into the FMU that messages call `shown`.
    pub(crate) fn of(shown: &'a Path) -> Self {
        Surroundings { shown, folder: std::env::current_dir().ok() }
    }

    /// Sets back what the call changed.
    pub(crate) fn set_back(self) {
        keep_rounding(self.shown);
        let moved = self.folder.filter(|before| std::env::current_dir().is_ok_and(|now| now != *before));
        if moved.is_some_and(|before| std::env::set_current_dir(before).is_ok()) {
            isolate::note(format!(
                "{}: the library changed the working directory of the program, which was set back",
                self.shown.display()
            ));
        }
    }
}

/// Sets back how numbers are rounded, which subnormal numbers are zero, and which operations raise a signal.
#[inline(always)]
pub(crate) fn keep_rounding(shown: &Path) {
    if rounding::is_changed() {
        set_back(shown);
    }
}

/// Calls between two readings of the register after calls of which a simulation makes many: a reading waits for all
/// numbers that are being computed, which some processors need longer for than a small FMU for its step.
const CALLS_PER_READING: u8 = 64;

/// The same after one of many calls, which `calls` counts: numbers tell at once when they are computed otherwise; that
/// operations raise a signal is seen with the next reading.
#[inline(always)]
pub(crate) fn keep_rounding_often(calls: &mut u8, shown: &Path) {
    let is_reading = *calls == 0;
    *calls = if is_reading { CALLS_PER_READING - 1 } else { *calls - 1 };
    if computes_otherwise() || (is_reading && rounding::is_changed()) {
        set_back(shown);
    }
}

/// Whether sums are not rounded to nearest, or subnormal numbers are zero.
#[inline(always)]
fn computes_otherwise() -> bool {
    /// Below half the distance of 1 to its neighbors.
    const BELOW_HALF_EPSILON: f64 = 1.0 / (1_u64 << 60) as f64;
    const SUBNORMAL: f64 = f64::from_bits(1);
    // Read from memory, so that the processor computes the sums and not the compiler.
    let (one, small, subnormal) = std::hint::black_box((1.0, BELOW_HALF_EPSILON, SUBNORMAL));
    (one + small) - (one - small) != 0.0 || subnormal + subnormal == 0.0
}

#[cold]
#[inline(never)]
fn set_back(shown: &Path) {
    rounding::set_back();
    isolate::note(format!(
        "{}: the library changed how the whole program rounds numbers, which was set back after the call; compile it \
         without -ffast-math, or run it with --isolate",
        shown.display()
    ));
}

#[cfg(target_arch = "x86_64")]
mod rounding {
    use std::arch::asm;

    /// Rounds to nearest, with subnormal numbers, without signals: what compiled Rust takes for granted.
    const DEFAULT: u32 = 0x1f80;
    const LONG_DEFAULT: u16 = 0x037f;
    /// Bits that only remember what happened.
    const FLAGS: u32 = 0x3f;

    #[inline(always)]
    pub(super) fn is_changed() -> bool {
        let mut register = 0_u32;
        // SAFETY: stores the register into a local.
        unsafe { asm!("stmxcsr [{}]", in(reg) &raw mut register, options(nostack, preserves_flags)) };
        register & !FLAGS != DEFAULT
    }

    pub(super) fn set_back() {
        let register = DEFAULT;
        // SAFETY: loads the value that the register has at the begin of every program.
        unsafe { asm!("ldmxcsr [{}]", in(reg) &raw const register, options(nostack, readonly)) };
        let word = LONG_DEFAULT;
        // SAFETY: the same for the unit that computes with `long double`, which C libraries do.
        unsafe { asm!("fldcw [{}]", in(reg) &raw const word, options(nostack, readonly)) };
    }
}

/// Not looked at on other processors.
#[cfg(not(target_arch = "x86_64"))]
mod rounding {
    #[inline(always)]
    pub(super) fn is_changed() -> bool {
        false
    }

    pub(super) fn set_back() {}
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::*;

    /// Values of the register: upward, downward, toward zero, results of subnormal size are zero, operands of that size
    /// are.
    const CHANGED: [u32; 5] = [0x5f80, 0x3f80, 0x7f80, 0x9f80, 0x1fc0];
    /// A division by zero raises a signal; nothing is computed otherwise.
    const TRAPPING: u32 = 0x1d80;

    fn with_register<T>(register: u32, look: impl FnOnce() -> T) -> T {
        // SAFETY: the value is set back below, and what `look` computes before is only compared.
        unsafe { std::arch::asm!("ldmxcsr [{}]", in(reg) &raw const register) };
        // Computed here, not behind the next line.
        let seen = std::hint::black_box(look());
        rounding::set_back();
        seen
    }

    #[test]
    fn a_changed_rounding_is_seen_and_set_back() {
        assert!(!rounding::is_changed() && !computes_otherwise());
        for register in CHANGED {
            let (by_register, by_numbers) =
                with_register(register, || (rounding::is_changed(), computes_otherwise()));
            assert!(by_register && by_numbers, "{register:#x}");
            assert!(!rounding::is_changed() && !computes_otherwise());
        }
        assert!(with_register(TRAPPING, rounding::is_changed));
        assert!(!with_register(TRAPPING, computes_otherwise));
    }

    #[test]
    fn the_register_is_read_after_the_first_of_many_calls_and_then_seldom() {
        let mut calls = 0;
        let mut is_set_back_by = |number: u32| {
            let register = TRAPPING;
            // SAFETY: as above.
            unsafe { std::arch::asm!("ldmxcsr [{}]", in(reg) &raw const register) };
            keep_rounding_often(&mut calls, Path::new("m.fmu"));
            let was_set_back = !rounding::is_changed();
            rounding::set_back();
            assert_eq!(was_set_back, number.is_multiple_of(CALLS_PER_READING.into()), "call {number}");
        };
        (0..200).for_each(&mut is_set_back_by);
    }
}
