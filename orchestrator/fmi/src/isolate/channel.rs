//! The way to one worker: calls go there, answers come back, and its end is noticed.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use tempfile::TempDir;

use super::area::{Area, tell, wait};
use super::calls::{self, Calls, MORE_ROOM, Parts};
use super::patience::Patience;
use super::process::{Process, cause};
use super::{Isolation, interrupted};
use crate::fmi3::names;
use crate::log::LogMessage;
use crate::open::Fmu;

/// Bytes for calls and answers at the begin.
const ROOM: usize = 1 << 20;
/// Bytes for calls and answers at most.
const MOST_ROOM: usize = 1 << 30;
/// Time between two looks at whether the worker lives.
const POLL_INTERVAL: Duration = Duration::from_millis(20);
/// Time that a call may still take after Ctrl-C.
const GRACE: Duration = Duration::from_secs(1);
/// Messages of the FMU that are told with its end.
const MAX_MESSAGES_REPORTED: usize = 5;
/// Time to unload the library.
const UNLOADING: Duration = Duration::from_secs(2);

/// How a worker was lost.
#[derive(Debug, Clone, Default)]
pub(crate) struct Death {
    /// C name of the function that it was in.
    pub(crate) function: &'static str,
    /// Signal, exit code or exceeded limit.
    pub(crate) cause: String,
    /// Last lines that it printed.
    pub(crate) printed: Vec<String>,
}

/// The answer to the calls of one turn.
pub(super) struct Answer {
    /// Status of the last call that was made.
    pub(super) status: u32,
    /// Its number, from 0.
    pub(super) index: u64,
    /// Results of the calls.
    pub(super) payload: Vec<u8>,
    /// Messages of the FMU.
    pub(super) log: Vec<LogMessage>,
}

/// A worker with the library of one FMU.
pub(crate) struct Channel {
    line: Mutex<Line>,
    death: OnceLock<Death>,
    /// FMU in messages.
    shown: String,
    is_fmi3: bool,
    call_limit: Duration,
}

struct Line {
    area: Area,
    process: Process,
    // Removed after the process.
    _folder: TempDir,
    number: u32,
    bytes: Vec<u8>,
    patience: Patience,
    none: Patience,
}

/// Workers that are open in this process.
static WORKERS: AtomicUsize = AtomicUsize::new(0);

/// Whether a worker that waits may keep a processor busy: this process and all workers have one each.
fn may_look() -> bool {
    static PROCESSORS: OnceLock<usize> = OnceLock::new();
    let count = || std::thread::available_parallelism().map_or(1, usize::from);
    WORKERS.load(Ordering::Relaxed) < *PROCESSORS.get_or_init(count)
}

impl Channel {
    /// Starts a worker.
    pub(crate) fn open(isolation: &Isolation, fmu: &Fmu) -> std::io::Result<Arc<Channel>> {
        let area = Area::new(ROOM)?;
        let folder = airloop_series::scratch::folder()?;
        let process = Process::worker(isolation, folder.path(), area.descriptor())?;
        WORKERS.fetch_add(1, Ordering::Relaxed);
        Ok(Arc::new(Channel {
            line: Mutex::new(Line {
                area,
                process,
                _folder: folder,
                number: 0,
                bytes: Vec::new(),
                patience: Patience::new(),
                none: Patience::none(),
            }),
            death: OnceLock::new(),
            shown: fmu.shown.display().to_string(),
            is_fmi3: fmu.description.is_fmi3(),
            call_limit: isolation.call_limit,
        }))
    }

    /// How the worker was lost, if it was.
    pub(crate) fn death(&self) -> Option<&Death> {
        self.death.get()
    }

    /// Makes calls in the worker, one after the other until one fails; `None` if the worker is lost.
    pub(super) fn call(&self, calls: &Calls) -> Option<Answer> {
        if self.death.get().is_some() {
            return None;
        }
        let mut line = self.line.lock().unwrap_or_else(PoisonError::into_inner);
        let mut room = calls.bytes.len() + 4096;
        loop {
            let answer = line.turn(calls, room, self.call_limit).map_err(|lost| {
                let _ = self.death.set(lost);
            });
            let answer = answer.ok()?;
            if answer.status != MORE_ROOM {
                return Some(answer);
            }
            let wanted = Parts { bytes: &answer.payload }.number()?;
            room = usize::try_from(wanted).ok()?.checked_add(calls.bytes.len() + 4096)?;
        }
    }
}

impl Line {
    fn turn(&mut self, calls: &Calls, room: usize, limit: Duration) -> Result<Answer, Death> {
        let fits = room <= MOST_ROOM && self.area.grow(room).is_ok();
        if !fits || !self.area.put(0, &calls.bytes) {
            return Err(self.lost(Some(format!("{room} bytes of values, above the limit of {MOST_ROOM}"))));
        }
        let header = self.area.header();
        header.length.store(calls.bytes.len() as u32, Ordering::Relaxed);
        let looks = may_look();
        header.looks.store(looks.into(), Ordering::Relaxed);
        // Where workers wait for the processor, this process leaves it to them.
        let patience = if looks { &mut self.patience } else { &mut self.none };
        let before = self.number;
        self.number = self.number.wrapping_add(1);
        tell(&header.request, &header.worker_sleeps, self.number);
        let mut began = None;
        let mut asked = None;
        loop {
            let header = self.area.header();
            wait(&header.answer, &header.owner_sleeps, before, patience, Some(POLL_INTERVAL));
            if header.answer.load(Ordering::Acquire) == self.number {
                break;
            }
            let began = *began.get_or_insert_with(Instant::now);
            if self.process.ended().is_some() {
                return Err(self.lost(None));
            }
            if began.elapsed() > limit {
                let seconds = limit.as_secs_f64();
                return Err(self.lost(Some(format!("it did not return within {seconds} s"))));
            }
            if interrupted() && asked.get_or_insert_with(Instant::now).elapsed() > GRACE {
                return Err(self.lost(Some("it did not return after the interrupt".into())));
            }
        }
        self.answer(calls.bytes.len())
    }

    fn answer(&mut self, at: usize) -> Result<Answer, Death> {
        let mut head = [0_u64; 3];
        let read = self.area.get(at, calls::bytes_of_mut(&mut head));
        let length = usize::try_from(head[2]).unwrap_or(usize::MAX);
        if !read || self.area.data(at + 24, length).is_none() {
            return Err(self.lost(Some("it wrote over the memory of its process".into())));
        }
        self.bytes.resize(length, 0);
        self.area.get(at + 24, &mut self.bytes);
        Ok(Answer {
            status: u32::try_from(head[0]).unwrap_or(calls::REFUSED),
            index: head[1],
            payload: self.bytes.clone(),
            log: messages(&self.area.take_log()),
        })
    }

    /// Ends the worker, if it did not end itself; `reason`: why.
    fn lost(&mut self, reason: Option<String>) -> Death {
        let function = calls::name(self.area.header().function.load(Ordering::Acquire));
        self.process.kill();
        let how = self.process.ended().map_or_else(|| "an unknown end".into(), cause);
        let cause = reason.unwrap_or_else(|| format!("its process ended by {how}"));
        let mut printed: Vec<String> =
            messages(&self.area.take_log()).iter().map(ToString::to_string).collect();
        printed.drain(..printed.len().saturating_sub(MAX_MESSAGES_REPORTED));
        printed.extend(self.process.printed().into_iter().map(|line| format!("printed: {line}")));
        Death { function, cause, printed }
    }
}

impl Drop for Channel {
    fn drop(&mut self) {
        WORKERS.fetch_sub(1, Ordering::Relaxed);
        let line = self.line.get_mut().unwrap_or_else(PoisonError::into_inner);
        if let Some(death) = self.death.get() {
            if ["fmi2FreeInstance", "fmi2Terminate"].contains(&death.function) {
                let function = if self.is_fmi3 { names::of(death.function) } else { death.function };
                super::note(format!("{}: lost in {function}: {}", self.shown, death.cause));
            }
            return;
        }
        let header = line.area.header();
        header.length.store(0, Ordering::Relaxed);
        tell(&header.request, &header.worker_sleeps, line.number.wrapping_add(1));
        match line.process.wait(UNLOADING) {
            Some(status) if status.success() => {}
            Some(status) => super::note(format!(
                "{}: its process ended by {} when the library was unloaded; the results are not touched by that",
                self.shown,
                cause(status)
            )),
            None => super::note(format!(
                "{}: the library was not unloaded within {} s, and its process was ended",
                self.shown,
                UNLOADING.as_secs_f64()
            )),
        }
    }
}

/// Messages from the shared memory, as far as they can be read.
fn messages(bytes: &[u8]) -> Vec<LogMessage> {
    let mut parts = Parts { bytes };
    let mut found = Vec::new();
    while let Some(status) = parts.number() {
        let (Some(instance), Some(category), Some(text)) = (parts.block(), parts.block(), parts.block())
        else {
            break;
        };
        let text_of = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        let status = u32::try_from(status).unwrap_or(u32::MAX);
        let (instance, category, text) = (text_of(instance), text_of(category), text_of(text));
        found.push(LogMessage { instance, status, category, text });
    }
    found
}
