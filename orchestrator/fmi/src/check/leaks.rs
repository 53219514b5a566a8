//! Memory that an instance leaves behind when it is freed.

#![allow(unsafe_code, reason = "asking the C library how much memory is in use")]

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::probe::{Advance, Probe};
use super::Findings;
use crate::{Error, Fmu, InterfaceKind};

/// Steps of each life.
const STEPS: usize = 3;

/// Lives before the first look: what a library makes once for all is there then.
const FIRST_LIVES: usize = 3;

/// Looks; a leak grows between each two.
const LOOKS: usize = 4;

/// Lives between two looks.
const LIVES: usize = 8;

/// Time for all lives; a slow FMU gets fewer.
const PATIENCE: Duration = Duration::from_secs(5);

pub(super) fn check(fmu: &Arc<Fmu>, kind: InterfaceKind, findings: &mut Findings) {
    let Ok(Some(bytes)) = grown(fmu, kind) else { return };
    let message = format!(
        "each life of an instance (made, initialized, {STEPS} steps, reset, freed) leaves {bytes} bytes behind"
    );
    findings.error("leak", format!("interface {kind}"), message);
}

/// Bytes that each life leaves behind, if it is so many every time.
fn grown(fmu: &Arc<Fmu>, kind: InterfaceKind) -> Result<Option<usize>, Error> {
    let began = Instant::now();
    for _ in 0..FIRST_LIVES {
        live(fmu, kind)?;
    }
    let mut used = [0; LOOKS];
    for look in 0..LOOKS {
        if look > 0 {
            for _ in 0..LIVES {
                live(fmu, kind)?;
                if began.elapsed() > PATIENCE {
                    return Ok(None);
                }
            }
        }
        used[look] = in_use();
    }
    let growth: Vec<usize> = used.windows(2).map(|pair| pair[1].saturating_sub(pair[0])).collect();
    let least = growth.iter().copied().min().unwrap_or(0);
    Ok((least >= LIVES).then_some(least / LIVES))
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
#[cfg(target_env = "gnu")]
fn in_use() -> usize {
    // SAFETY: the function takes nothing and only reads the counts of the allocator.
    let counts = unsafe { libc::mallinfo2() };
    counts.uordblks + counts.hblkhd
}

/// Not known with this C library.
#[cfg(not(target_env = "gnu"))]
fn in_use() -> usize {
    0
}
