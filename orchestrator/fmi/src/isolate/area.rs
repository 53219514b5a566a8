//! Memory that this process and a worker share: a header, messages that the FMU logs, and calls with their answers.

use std::fs::File;
use std::io;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use super::patience::Patience;
use super::system::{self, Descriptor};

/// Bytes of the header.
const HEADER: usize = 4096;
/// Bytes for messages that the FMU logs.
const LOG: usize = 1 << 16;
/// Place of calls and answers.
const DATA: usize = HEADER + LOG;

/// Part of the shared memory with fixed layout, read by both processes.
#[repr(C)]
pub(super) struct Header {
    /// Number of the last request.
    pub(super) request: AtomicU32,
    /// Number of the last answer.
    pub(super) answer: AtomicU32,
    /// Whether one of them sleeps and has to be woken.
    pub(super) worker_sleeps: AtomicU32,
    /// See `worker_sleeps`.
    pub(super) owner_sleeps: AtomicU32,
    /// Number of the function that the worker is in, in the table of `calls`; 0: in none.
    pub(super) function: AtomicU32,
    /// Whether the worker may look at its request before it sleeps: a processor is free for that.
    pub(super) looks: AtomicU32,
    /// Bytes of calls in the data.
    pub(super) length: AtomicU32,
    /// Bytes of messages.
    pub(super) logged: AtomicU32,
    /// Size of the memory in pages of 4 KiB.
    pub(super) pages: AtomicU32,
}

/// Shared memory, mapped into this process.
pub(super) struct Area {
    file: File,
    base: *mut u8,
    size: usize,
}

// SAFETY: the mapping belongs to the value, and nothing of it is tied to a thread.
unsafe impl Send for Area {}

impl Area {
    /// New memory with room for `data` bytes of calls and answers.
    pub(super) fn new(data: usize) -> io::Result<Area> {
        let file = system::shared_memory()?;
        let size = (DATA + data).next_multiple_of(HEADER);
        file.set_len(size as u64)?;
        let area = Area { base: system::map(&file, size)?, file, size };
        area.header().pages.store((size / HEADER) as u32, Ordering::Release);
        Ok(area)
    }

    /// The memory that the owner handed over.
    pub(super) fn of_owner(file: Descriptor) -> io::Result<Area> {
        let file = system::of_descriptor(file)?;
        let size = file.metadata()?.len() as usize;
        Ok(Area { base: system::map(&file, size)?, file, size })
    }

    /// Another mapping of the same memory.
    pub(super) fn again(&self) -> io::Result<Area> {
        let file = self.file.try_clone()?;
        Ok(Area { base: system::map(&file, self.size)?, file, size: self.size })
    }

    pub(super) fn descriptor(&self) -> Descriptor {
        system::descriptor(&self.file)
    }

    pub(super) fn header(&self) -> &Header {
        // SAFETY: the mapping is at least a page and lives as long as `self`; atomics may be shared.
        unsafe { &*self.base.cast::<Header>() }
    }

    /// Bytes for calls and answers.
    pub(super) fn capacity(&self) -> usize {
        self.size - DATA
    }

    /// Makes room for `data` bytes; the other process follows with [`Area::follow`].
    pub(super) fn grow(&mut self, data: usize) -> io::Result<()> {
        let size = (DATA + data).next_multiple_of(HEADER);
        if size > self.size {
            self.file.set_len(size as u64)?;
            self.remap(size)?;
            self.header().pages.store((size / HEADER) as u32, Ordering::Release);
        }
        Ok(())
    }

    /// Maps what the other process added.
    pub(super) fn follow(&mut self) -> io::Result<()> {
        let size = self.header().pages.load(Ordering::Acquire) as usize * HEADER;
        if size > self.size { self.remap(size) } else { Ok(()) }
    }

    fn remap(&mut self, size: usize) -> io::Result<()> {
        let base = system::map(&self.file, size)?;
        // SAFETY: the old mapping, of which no reference is left: `self` is borrowed mutably.
        unsafe { system::unmap(self.base, self.size) };
        (self.base, self.size) = (base, size);
        Ok(())
    }

    /// Writes into the data; whether it fits.
    pub(super) fn put(&mut self, at: usize, bytes: &[u8]) -> bool {
        let fits = at.checked_add(bytes.len()).is_some_and(|end| end <= self.capacity());
        if fits {
            // SAFETY: the range lies within the mapping, as just checked; the other process waits for its turn.
            unsafe {
                std::ptr::copy_nonoverlapping(bytes.as_ptr(), self.base.add(DATA + at), bytes.len());
            }
        }
        fits
    }

    /// Start of the data at `at`, if `length` bytes are there.
    pub(super) fn data(&self, at: usize, length: usize) -> Option<*mut u8> {
        let fits = at.checked_add(length).is_some_and(|end| end <= self.capacity());
        // SAFETY: the place lies within the mapping, as just checked.
        fits.then(|| unsafe { self.base.add(DATA + at) })
    }

    /// Copies out of the data; `false` if it is not there.
    pub(super) fn get(&self, at: usize, bytes: &mut [u8]) -> bool {
        let Some(from) = self.data(at, bytes.len()) else { return false };
        // SAFETY: the range lies within the mapping.
        unsafe { std::ptr::copy_nonoverlapping(from, bytes.as_mut_ptr(), bytes.len()) };
        true
    }

    /// Place of the messages, for a worker that writes them from any thread.
    pub(super) fn log_place(&self) -> LogPlace {
        LogPlace(self.base)
    }

    /// The messages so far, which are then forgotten.
    pub(super) fn take_log(&self) -> Vec<u8> {
        let logged = &self.header().logged;
        let length = logged.load(Ordering::Acquire) as usize;
        if length == 0 {
            return Vec::new();
        }
        let mut bytes = vec![0; length.min(LOG)];
        // SAFETY: the range lies within the mapping.
        unsafe { std::ptr::copy_nonoverlapping(self.base.add(HEADER), bytes.as_mut_ptr(), bytes.len()) };
        logged.store(0, Ordering::Release);
        bytes
    }
}

impl Drop for Area {
    fn drop(&mut self) {
        // SAFETY: the mapping is this value's, and no reference is left.
        unsafe { system::unmap(self.base, self.size) };
    }
}

/// Where a worker writes messages, in a mapping that stays for its life.
#[derive(Clone, Copy)]
pub(super) struct LogPlace(*mut u8);

// SAFETY: writers of one process take turns (the lock of the buffer), and the place is only read by the owner.
unsafe impl Send for LogPlace {}
// SAFETY: as above.
unsafe impl Sync for LogPlace {}

impl LogPlace {
    /// Adds a message if there is room.
    pub(super) fn add(self, bytes: &[u8]) {
        // SAFETY: the header lies at the beginning of the mapping, which a worker keeps.
        let header = unsafe { &*self.0.cast::<Header>() };
        let at = header.logged.load(Ordering::Acquire) as usize;
        if at + bytes.len() <= LOG {
            // SAFETY: the range lies within the part for messages.
            unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), self.0.add(HEADER + at), bytes.len()) };
            header.logged.store((at + bytes.len()) as u32, Ordering::Release);
        }
    }
}

/// Waits until `word` is no longer `old`, at most for `limit`; first looks at it as long as `patience` says.
pub(super) fn wait(
    word: &AtomicU32,
    sleeps: &AtomicU32,
    old: u32,
    patience: &mut Patience,
    limit: Option<Duration>,
) {
    let changed = || word.load(Ordering::Acquire) != old;
    if changed() || patience.look(changed) {
        return;
    }
    sleeps.store(1, Ordering::SeqCst);
    if word.load(Ordering::SeqCst) == old {
        system::sleep(word, old, limit);
    }
    sleeps.store(0, Ordering::SeqCst);
}

/// Changes `word` and wakes who waits for that.
pub(super) fn tell(word: &AtomicU32, sleeps: &AtomicU32, new: u32) {
    word.store(new, Ordering::SeqCst);
    if sleeps.load(Ordering::SeqCst) != 0 {
        system::wake(word);
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn messages_arrive_also_after_the_memory_has_grown() {
        let mut owner = Area::new(1 << 12).unwrap();
        let mut worker = owner.again().unwrap();
        let log = worker.again().unwrap();
        let place = log.log_place();
        place.add(b"before");
        owner.grow(1 << 24).unwrap();
        worker.follow().unwrap();
        assert!(worker.put((1 << 24) - 1, b"x"));
        place.add(b" and after");
        assert_eq!(owner.take_log(), b"before and after");
    }
}
