//! The process of an FMU: how it is started, what it may take, what it prints, and how it ended.

use std::io::{PipeReader, Read};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use super::Isolation;
use super::mark::Mark;
use super::system::{self, Descriptor};
use crate::signals;

/// Bytes of output that are kept.
const KEPT_OUTPUT: usize = 1 << 11;
/// Time in which the last output of a process that ended comes in.
const LAST_OUTPUT: Duration = Duration::from_millis(200);

/// A process that runs the library of an FMU: a group of its own, so much address space, no descriptors but standard
/// streams of its own; it ends with this program.
pub struct Process {
    child: Child,
    mark: Mark,
    output: Arc<Output>,
    ended: Option<ExitStatus>,
}

/// The end of what a process printed.
#[derive(Default)]
struct Output {
    tail: Mutex<Vec<u8>>,
    complete: AtomicBool,
}

impl Process {
    /// Starts a worker in `folder` with the shared memory `area`.
    pub(super) fn worker(isolation: &Isolation, folder: &Path, area: Descriptor) -> std::io::Result<Process> {
        let mut command = Command::new(&isolation.program);
        command.args(&isolation.arguments);
        Process::confined(command, folder, Some(area), isolation.memory_limit)
    }

    /// Starts `command` in `folder`, with at most `memory` bytes of address space. What it leaves in the folder for
    /// temporary files lies in `folder`, too.
    ///
    /// # Errors
    /// The program cannot be started.
    pub fn start(command: Command, folder: &Path, memory: u64) -> std::io::Result<Process> {
        Process::confined(command, folder, None, memory)
    }

    fn confined(
        mut command: Command,
        folder: &Path,
        area: Option<Descriptor>,
        memory: u64,
    ) -> std::io::Result<Process> {
        let (reader, writer) = std::io::pipe()?;
        command
            .current_dir(folder)
            .env("TMPDIR", folder)
            .stdin(Stdio::null())
            .stdout(Stdio::from(writer.try_clone()?))
            .stderr(Stdio::from(writer));
        system::confine(&mut command, area, memory);
        let mark = Mark::set(&mut command);
        let child = spawn(command)?;
        let output = Arc::<Output>::default();
        let own = Arc::clone(&output);
        std::thread::Builder::new()
            .name("output of an FMU".into())
            .stack_size(1 << 16)
            .spawn(move || collect(reader, &own))?;
        Ok(Process { child, mark, output, ended: None })
    }

    /// How it ended, if it did.
    pub fn ended(&mut self) -> Option<ExitStatus> {
        if self.ended.is_none() {
            self.ended = self.child.try_wait().ok().flatten();
        }
        self.ended
    }

    /// Ends it with all that it started.
    pub fn kill(&mut self) {
        if self.ended().is_none() {
            system::end_group(&self.child);
            let _ = self.child.kill();
            self.ended = self.child.wait().ok();
        }
        // Also what it started and did not end.
        system::end_group(&self.child);
        self.mark.end_all();
    }

    /// Waits for its end; `None` if it does not come within `limit`.
    pub(super) fn wait(&mut self, limit: Duration) -> Option<ExitStatus> {
        let began = Instant::now();
        while self.ended().is_none() && began.elapsed() < limit {
            std::thread::sleep(Duration::from_micros(200));
        }
        self.ended
    }

    /// Last lines that it printed.
    pub fn printed(&self) -> Vec<String> {
        let began = Instant::now();
        while !self.output.complete.load(Ordering::Acquire) && began.elapsed() < LAST_OUTPUT {
            std::thread::sleep(Duration::from_millis(1));
        }
        let tail = self.output.tail.lock().unwrap_or_else(PoisonError::into_inner);
        let text = String::from_utf8_lossy(&tail);
        let lines: Vec<&str> = text.lines().filter(|line| !line.trim().is_empty()).collect();
        lines[lines.len().saturating_sub(5)..].iter().map(|line| crate::log::printable(line)).collect()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill();
        // Starting it leaves holes in the heap; unless they are given back, memory grows with every worker (`make
        // study-isolation`).
        #[cfg(all(target_os = "linux", target_env = "gnu"))]
        // SAFETY: it gives free memory of the heap back to the system and may be called at any time.
        unsafe {
            libc::malloc_trim(0);
        }
    }
}

/// A command, and where its child is to be sent.
type Order = (Command, Sender<std::io::Result<Child>>);

/// Starts a command from a thread that lives as long as the program: a worker ends with the thread that started it.
fn spawn(command: Command) -> std::io::Result<Child> {
    static STARTER: OnceLock<Mutex<Sender<Order>>> = OnceLock::new();
    let starter = STARTER.get_or_init(|| {
        let (sender, orders) = channel::<Order>();
        std::thread::spawn(move || {
            for (mut command, answer) in orders {
                let _ = answer.send(command.spawn());
            }
        });
        Mutex::new(sender)
    });
    let (answer, child) = channel();
    let gone = || std::io::Error::other("no thread starts workers");
    starter.lock().unwrap_or_else(PoisonError::into_inner).send((command, answer)).map_err(|_| gone())?;
    child.recv().map_err(|_| gone())?
}

/// Reads all that a process prints and keeps the end.
fn collect(mut reader: PipeReader, output: &Output) {
    let mut block = [0_u8; 4096];
    loop {
        match reader.read(&mut block) {
            Ok(0) => break,
            Ok(length) => {
                let mut tail = output.tail.lock().unwrap_or_else(PoisonError::into_inner);
                tail.extend_from_slice(&block[..length]);
                let surplus = tail.len().saturating_sub(KEPT_OUTPUT);
                tail.drain(..surplus);
            }
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            Err(_) => break,
        }
    }
    output.complete.store(true, Ordering::Release);
}

/// The end of a process in words: signal or exit code.
pub fn cause(status: ExitStatus) -> String {
    if let Some(signal) = system::signal(status) {
        return match signals::known(signal) {
            Some(known) => format!("signal {known}"),
            None => format!("signal {signal}"),
        };
    }
    status.code().map_or_else(|| status.to_string(), |code| format!("exit code {code}"))
}
