//! End of a search before it is through, on request or when its time is up: the best model so far is its answer.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Whether the end was asked for.
static ASKED: AtomicBool = AtomicBool::new(false);
/// Whether any search ended early.
static ENDED: AtomicBool = AtomicBool::new(false);
/// How many pieces of the last work are under way, and until when it may go on.
static FINISHING: AtomicUsize = AtomicUsize::new(0);
static UNTIL: Mutex<Option<Instant>> = Mutex::new(None);
/// Wall time of the last work of a search whose time is up.
const TIME_TO_FINISH: Duration = Duration::from_secs(1);
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

/// The last work, which goes on for a moment although the time of the search is up: what it found is measured for the
/// report. An interruption ends it at once.
pub fn finish<T>(work: impl FnOnce() -> T) -> T {
    let must_end = is_over() && !ASKED.load(Ordering::Relaxed);
    if let Ok(mut until) = UNTIL.lock() {
        *until = must_end.then(|| until.unwrap_or_else(|| Instant::now() + TIME_TO_FINISH));
    }
    FINISHING.fetch_add(1, Ordering::Relaxed);
    let done = work();
    FINISHING.fetch_sub(1, Ordering::Relaxed);
    done
}

/// Whether the end was asked for, or the time is up.
fn is_over() -> bool {
    let budget = || BUDGET.lock().ok().and_then(|own| *own);
    let late = |(begin, time, share): (Instant, Duration, f64)| begin.elapsed() >= time.mul_f64(share);
    ASKED.load(Ordering::Relaxed) || budget().is_some_and(late)
}

/// Whether a search must end now.
pub fn asked() -> bool {
    let end = is_over();
    if end {
        ENDED.store(true, Ordering::Relaxed);
    }
    end && !may_finish()
}

/// Whether the last work is under way and has time left; an interruption leaves it none.
fn may_finish() -> bool {
    let until = || UNTIL.lock().ok().and_then(|until| *until);
    FINISHING.load(Ordering::Relaxed) > 0
        && !ASKED.load(Ordering::Relaxed)
        && until().is_some_and(|until| Instant::now() < until)
}

/// Whether a search of this process ended before it was through.
pub fn ended() -> bool {
    ENDED.load(Ordering::Relaxed)
}
