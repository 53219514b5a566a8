//! The same function for many indices on all processors; the results do not depend on their number.

use std::cell::Cell;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use super::system::Job;
use super::{System, stop};

/// Threads that are used; 0: one per processor.
static THREADS: AtomicUsize = AtomicUsize::new(0);

/// Limits the threads of all searches of this process; 0: one per processor. No result depends on it.
pub fn use_threads(count: usize) {
    THREADS.store(count, Ordering::Relaxed);
}

/// Threads for `count` pieces of work.
fn threads(count: usize) -> usize {
    let wanted = THREADS.load(Ordering::Relaxed);
    let processors = || std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    if wanted == 0 { processors().min(count) } else { wanted.min(count) }
}

/// Whitened residuals of all jobs.
pub fn residuals<S: System + ?Sized>(system: &S, jobs: &[Job]) -> Vec<Vec<f64>> {
    let batches: Vec<&[Job]> = jobs.chunks(system.side_by_side()).collect();
    map(batches.len(), |i| system.residuals_of(batches[i])).into_iter().flatten().collect()
}

/// Whitened residuals of the jobs; once the search is asked to end, only of those that are `needed`.
pub fn residuals_until_asked<S: System + ?Sized>(
    system: &S,
    jobs: &[Job],
    needed: impl Fn(usize) -> bool + Sync,
) -> Vec<Option<Vec<f64>>> {
    let size = system.side_by_side();
    let batches: Vec<&[Job]> = jobs.chunks(size).collect();
    let batch = |i: usize| -> Vec<Option<Vec<f64>>> {
        if !stop::asked() {
            return system.residuals_of(batches[i]).into_iter().map(Some).collect();
        }
        let one = |(k, job): (usize, &Job)| {
            needed(i * size + k).then(|| system.residuals(job.record, &job.parameters, &job.locals))
        };
        batches[i].iter().enumerate().map(one).collect()
    };
    map(batches.len(), batch).into_iter().flatten().collect()
}

thread_local! {
    /// Whether this thread already works for a `map`: one inside another stays on its thread.
    static INSIDE: Cell<bool> = const { Cell::new(false) };
}

/// `f(0), f(1) ... f(count - 1)`, in this order.
pub fn map<T: Send>(count: usize, f: impl Fn(usize) -> T + Sync) -> Vec<T> {
    if threads(count) <= 1 || INSIDE.get() {
        return (0..count).map(f).collect();
    }
    let slots: Vec<Mutex<Option<T>>> = (0..count).map(|_| Mutex::new(None)).collect();
    each(count, &|index| {
        let value = f(index);
        *slots[index].lock().unwrap_or_else(PoisonError::into_inner) = Some(value);
    });
    slots.into_iter().filter_map(|slot| slot.into_inner().unwrap_or_else(PoisonError::into_inner)).collect()
}

/// `f(0)`, `f(1)` ... `f(count - 1)` on several threads. Compiled once for all functions: threads and a sort of its
/// own for every caller were a good part of the code that the compiler had to optimize.
fn each(count: usize, f: &(dyn Fn(usize) + Sync)) {
    let next = AtomicUsize::new(0);
    let work = || {
        INSIDE.set(true);
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            if index >= count {
                return;
            }
            f(index);
        }
    };
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads(count)).map(|_| scope.spawn(work)).collect();
        for worker in workers {
            worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        }
    });
}
