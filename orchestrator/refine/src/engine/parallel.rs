//! The same function for many indices on all processors; the results do not depend on their number.

use std::cell::Cell;
use std::sync::atomic::{AtomicUsize, Ordering};

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
    let threads = threads(count);
    if threads <= 1 || INSIDE.get() {
        return (0..count).map(f).collect();
    }
    let next = AtomicUsize::new(0);
    let mut found: Vec<(usize, T)> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads)
            .map(|_| {
                scope.spawn(|| {
                    INSIDE.set(true);
                    let mut own = Vec::new();
                    loop {
                        let index = next.fetch_add(1, Ordering::Relaxed);
                        if index >= count {
                            return own;
                        }
                        own.push((index, f(index)));
                    }
                })
            })
            .collect();
        workers
            .into_iter()
            .flat_map(|worker| worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
            .collect()
    });
    found.sort_by_key(|&(index, _)| index);
    found.into_iter().map(|(_, value)| value).collect()
}
