//! Memory, open files and threads that an instance leaves behind when it is freed.

#![allow(unsafe_code, reason = "asking the C library how much memory is in use")]

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::Findings;
use super::probe::{Advance, Probe};
use crate::loading::threads;
use crate::{Error, Fmu, InterfaceKind};

/// Steps of each life.
const STEPS: usize = 3;

/// Lives before the first look: what a library makes once for all is there then, and the allocator's own lists are
/// filled.
const FIRST_LIVES: usize = 20;

/// Looks; a leak grows between each two.
const LOOKS: usize = 6;

/// Lives between two looks.
const LIVES: usize = 16;

/// The same for the second time, where the first one shows a leak.
const MORE_LIVES: usize = 64;

/// Largest growth over the smallest.
const MAX_UNEVENNESS: f64 = 2.0;

/// Time for all lives; a slow FMU is not judged.
const MAX_TIME: Duration = Duration::from_secs(5);

/// The same for the second time.
const MORE_PATIENCE: Duration = Duration::from_secs(30);

/// A name, and its count in this process.
type Counted = (&'static str, fn() -> usize);

/// Resources counted: names, and the counts of this process.
const COUNTED: [Counted; 3] = [("bytes", in_use), ("open files", open_files), ("threads", threads)];

pub(super) fn check(fmu: &Arc<Fmu>, kind: InterfaceKind, findings: &mut Findings) {
    let Ok(grown) = grown(fmu, kind) else { return };
    for ((what, _), count) in COUNTED.iter().zip(grown) {
        let Some(count) = count else { continue };
        let message = format!(
            "each life of an instance (made, initialized, {STEPS} steps, reset, freed) leaves {count} {what} behind"
        );
        findings.error("leak", format!("interface {kind}"), message);
    }
}

/// Growth per life, where it is the same each time and goes on: the stock of the allocator grows as well, with every
/// size that is asked for the first time, but comes to an end.
fn grown(fmu: &Arc<Fmu>, kind: InterfaceKind) -> Result<[Option<usize>; COUNTED.len()], Error> {
    let until = Instant::now() + MAX_TIME;
    for _ in 0..FIRST_LIVES {
        live(fmu, kind)?;
    }
    let suspected = leaks(fmu, kind, LIVES, until)?;
    if suspected.iter().all(Option::is_none) {
        return Ok([None; COUNTED.len()]);
    }
    let confirmed = leaks(fmu, kind, MORE_LIVES, Instant::now() + MORE_PATIENCE)?;
    let both =
        |(first, then): (Option<f64>, Option<f64>)| then.filter(|then| Some(then * MAX_UNEVENNESS) >= first);
    let mut pairs = suspected.into_iter().zip(confirmed).map(both);
    Ok(std::array::from_fn(|_| pairs.next().flatten()).map(|count| count.map(|count| count as usize)))
}

/// Growth per life over looks that are `lives` apart; none where it is uneven or below one per life, or where time is
/// up.
fn leaks(
    fmu: &Arc<Fmu>,
    kind: InterfaceKind,
    lives: usize,
    until: Instant,
) -> Result<[Option<f64>; COUNTED.len()], Error> {
    let mut used = [[0; LOOKS]; COUNTED.len()];
    for look in 0..LOOKS {
        if look > 0 {
            for _ in 0..lives {
                live(fmu, kind)?;
                if Instant::now() > until {
                    return Ok([None; COUNTED.len()]);
                }
            }
        }
        for (used, (_, count)) in used.iter_mut().zip(COUNTED) {
            used[look] = count();
        }
    }
    Ok(used.map(|used| {
        let growth = || used.windows(2).map(|pair| pair[1].saturating_sub(pair[0]) as f64 / lives as f64);
        let (least, most) =
            growth().fold((f64::MAX, 0.0), |(least, most), own| (own.min(least), own.max(most)));
        (least >= 1.0 && most <= MAX_UNEVENNESS * least).then_some(least)
    }))
}

fn open_files() -> usize {
    std::fs::read_dir("/proc/self/fd").map_or(0, Iterator::count)
}

fn live(fmu: &Arc<Fmu>, kind: InterfaceKind) -> Result<(), Error> {
    let mut probe = Probe::new(fmu, kind)?;
    let saves = fmu.interface(kind).is_some_and(|interface| interface.can_get_and_set_fmu_state);
    if probe.initialize()? == Advance::Done {
        probe.advance(STEPS)?;
        if saves {
            let mut slot = None;
            probe.instance().get_state(&mut slot)?;
            if let Some(state) = slot {
                probe.instance().set_state(&state)?;
                probe.instance().free_state(state)?;
            }
        }
    }
    probe.instance().reset()
}

/// Bytes that were allocated and not freed in this process.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn in_use() -> usize {
    // SAFETY: the function takes nothing and only reads the counts of the allocator.
    let counts = unsafe { libc::mallinfo2() };
    counts.uordblks + counts.hblkhd
}

/// Not known with this C library.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
fn in_use() -> usize {
    0
}
