//! How far a search is, and what Ctrl-C does to it.

use std::path::Path;
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use indicatif::ProgressBar;

use super::{interrupt, progress};
use airloop_refine::engine::stop;
use airloop_refine::watch::Event;

/// A line that names the stage of the search, with draws or simulations counted.
pub struct Progress {
    bar: ProgressBar,
    stage: Mutex<String>,
    draws: u64,
}

impl Progress {
    /// `draws` of the simulated noise are expected.
    pub fn new(quiet: bool, draws: u64) -> Progress {
        let bar = progress::bar(quiet, None, "{spinner} {msg}  {elapsed}");
        if !bar.is_hidden() {
            bar.enable_steady_tick(Duration::from_millis(100));
        }
        Progress { bar, stage: Mutex::new(String::new()), draws }
    }

    /// Shows an event.
    pub fn tell(&self, event: Event) {
        if self.bar.is_hidden() {
            return;
        }
        let Ok(mut stage) = self.stage.lock() else { return };
        match event {
            Event::Stage(name) => {
                name.clone_into(&mut stage);
                self.bar.set_message(name.to_owned());
            }
            Event::Draws(count) => self.bar.set_message(format!("{stage}: {count} of {} draws", self.draws)),
            // Often enough to see that it moves.
            Event::Simulations(count) if count.is_multiple_of(10) => {
                self.bar.set_message(format!("{stage}: {count} simulations"));
            }
            Event::Simulations(_) => {}
        }
    }

    /// Takes the line away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// States of a command that may be interrupted.
const SEARCHING: u8 = 0;
const WRITING: u8 = 1;
const ASKED: u8 = 2;
const ENDING: u8 = 3;

/// Ctrl-C, SIGTERM and SIGHUP: during the search it ends and the best answer so far is written; once the program
/// writes, it finishes. A second signal always ends it.
pub struct Interrupt {
    state: Arc<AtomicU8>,
}

impl Interrupt {
    /// From here on; `folder`: that of the report.
    pub fn new(folder: &Path) -> Interrupt {
        let state = Arc::new(AtomicU8::new(SEARCHING));
        let (own, report) = (Arc::clone(&state), folder.join("report.json"));
        interrupt::act(move || {
            airloop_fmi::isolate::interrupt();
            let change = |from, to| own.compare_exchange(from, to, Ordering::SeqCst, Ordering::SeqCst);
            if change(WRITING, ASKED).is_ok() {
                return;
            }
            if change(SEARCHING, ENDING).is_ok() {
                stop::ask();
                return;
            }
            let kept = match report.is_file() {
                true => format!("the earlier report in {} is as it was", report.display()),
                false => "nothing was written".into(),
            };
            interrupt::end(&format!("interrupted twice; {kept}"));
        });
        Interrupt { state }
    }

    /// Nothing ends the program any more until the report is complete. Whether it was asked to end before.
    pub fn begin_to_write(&self) -> bool {
        let change = |from| self.state.compare_exchange(from, WRITING, Ordering::SeqCst, Ordering::SeqCst);
        change(SEARCHING).is_err() && change(ENDING).is_ok()
    }

    /// Whether a signal came since.
    pub fn came(&self) -> bool {
        self.state.load(Ordering::SeqCst) == ASKED
    }
}
