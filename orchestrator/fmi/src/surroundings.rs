//! What a library may change for the whole process without being asked: how numbers are rounded, and the working
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

    #[test]
    fn a_changed_rounding_is_set_back() {
        let upward = 0x5f80_u32;
        assert!(!rounding::is_changed());
        // SAFETY: the mode is set back below, before numbers are computed.
        unsafe { std::arch::asm!("ldmxcsr [{}]", in(reg) &raw const upward) };
        let was_changed = rounding::is_changed();
        rounding::set_back();
        assert!(was_changed && !rounding::is_changed());
    }
}
