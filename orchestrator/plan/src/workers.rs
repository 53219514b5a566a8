//! Threads for work that is asked for with a number of them.

use rayon::{ThreadPool, ThreadPoolBuilder};

use super::Error;

/// A pool of `count` threads; 0 counts as 1.
///
/// # Errors
/// [`Error::Place`] where the system gives no threads.
pub(crate) fn workers(count: usize) -> Result<ThreadPool, Error> {
    let refused = |error| Error::Place {
        place: format!("{count} threads"),
        problem: format!("the system refuses them ({error}); ask for fewer"),
    };
    ThreadPoolBuilder::new().num_threads(count.max(1)).build().map_err(refused)
}
