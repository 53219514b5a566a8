//! Time that one side looks at a word of the shared memory before it sleeps.
//!
//! An answer that comes while one looks costs less than the two switches of a sleep. On a busy computer it does not
//! come, as who should give it waits for the processor that looks: so looking ends where it did not pay lately.

use std::time::{Duration, Instant};

/// Longest time of looking; two switches of processes take about as long.
const MAX_SPIN_TIME: Duration = Duration::from_micros(20);
/// Looks between two looks at the clock.
const LOOKS_PER_CLOCK: u32 = 32;
/// Waits without looking after which it is tried again.
const WAITS_WITHOUT: u32 = 64;

/// See the module.
#[derive(Debug)]
pub(super) struct Patience {
    /// Time of the next looking, at most `longest`.
    time: Duration,
    longest: Duration,
    waits_without: u32,
}

impl Patience {
    /// All the patience there is.
    pub(super) fn new() -> Patience {
        Patience { time: MAX_SPIN_TIME, longest: MAX_SPIN_TIME, waits_without: 0 }
    }

    /// None, for ever.
    pub(super) fn none() -> Patience {
        Patience { time: Duration::ZERO, longest: Duration::ZERO, waits_without: 0 }
    }

    /// Looks until `changed`; `false` if it was not in time.
    pub(super) fn look(&mut self, changed: impl Fn() -> bool) -> bool {
        if self.time.is_zero() {
            self.waits_without += 1;
            if self.longest.is_zero() || self.waits_without < WAITS_WITHOUT {
                return false;
            }
            self.waits_without = 0;
            self.time = self.longest / 4;
        }
        let mut began = None;
        loop {
            for _ in 0..LOOKS_PER_CLOCK {
                if changed() {
                    self.time = (self.time * 2).min(self.longest);
                    return true;
                }
                std::hint::spin_loop();
            }
            if began.get_or_insert_with(Instant::now).elapsed() >= self.time {
                break;
            }
        }
        self.time = if self.time > self.longest / 8 { self.time / 2 } else { Duration::ZERO };
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    #[test]
    fn looking_that_does_not_pay_ends_and_is_tried_again_later() {
        let mut patience = Patience::new();
        let looks = Cell::new(0_u64);
        let never = || {
            looks.set(looks.get() + 1);
            false
        };
        for _ in 0..4 {
            assert!(!patience.look(never));
        }
        let before = looks.get();
        for _ in 1..WAITS_WITHOUT {
            assert!(!patience.look(never));
        }
        assert_eq!(looks.get(), before);
        // One try that pays brings the patience back.
        assert!(patience.look(|| true));
        assert!(!patience.look(never));
        assert!(looks.get() > before);
    }
}
