//! When a search is to end before it is through: on request, or when its time is up. What it has found until then is its
//! answer.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Whether the end was asked for.
static ASKED: AtomicBool = AtomicBool::new(false);
/// Whether any search ended early.
static ENDED: AtomicBool = AtomicBool::new(false);
/// How many pieces of work that no end may cut are under way.
static FINISHING: AtomicUsize = AtomicUsize::new(0);
/// Begin and length of the time for the whole search, and its share for the stage that runs.
static BUDGET: Mutex<Option<(Instant, Duration, f64)>> = Mutex::new(None);

/// Asks all searches of this process to end.
pub fn ask() {
    ASKED.store(true, Ordering::Relaxed);
}

/// Gives all searches of this process this much time from now on.
pub fn within(time: Duration) {
    if let Ok(mut budget) = BUDGET.lock() {
        *budget = Some((Instant::now(), time, 1.0));
    }
}

/// The stage that begins may use the time up to this share of the whole, if it is limited.
pub fn stage(share: f64) {
    if let Ok(mut budget) = BUDGET.lock()
        && let Some(own) = budget.as_mut()
    {
        own.2 = share;
    }
}

/// Work that is done in full although the search was asked to end: what it found is measured for the report.
pub fn finish<T>(work: impl FnOnce() -> T) -> T {
    FINISHING.fetch_add(1, Ordering::Relaxed);
    let done = work();
    FINISHING.fetch_sub(1, Ordering::Relaxed);
    done
}

/// Whether a search must end now.
pub fn asked() -> bool {
    if FINISHING.load(Ordering::Relaxed) > 0 {
        return false;
    }
    let over = || {
        let budget = BUDGET.lock().ok().and_then(|own| *own);
        budget.is_some_and(|(begin, time, share)| begin.elapsed() >= time.mul_f64(share))
    };
    let end = ASKED.load(Ordering::Relaxed) || over();
    if end {
        ENDED.store(true, Ordering::Relaxed);
    }
    end
}

/// Whether a search of this process ended before it was through.
pub fn ended() -> bool {
    ENDED.load(Ordering::Relaxed)
}
