//! Ctrl-C, SIGTERM and SIGHUP: what a command does about them, and the end of those that do nothing.

use std::sync::{Mutex, PoisonError};

use super::{INTERRUPTED, output};

type Action = Box<dyn FnMut() + Send>;

/// Reaction of the command to a signal; none: it ends.
static ACTION: Mutex<Option<Action>> = Mutex::new(None);

/// From now on a signal ends the program, and what was begun is removed, unless the command says otherwise by [`act`].
pub fn install() {
    // Without a handler a signal ends the program as usual, so a failure here is no reason not to work.
    let _ = ctrlc::set_handler(|| match &mut *ACTION.lock().unwrap_or_else(PoisonError::into_inner) {
        Some(action) => action(),
        None => end("interrupted; what was not complete is removed"),
    });
}

/// From now on signals do this.
pub fn act(action: impl FnMut() + Send + 'static) {
    *ACTION.lock().unwrap_or_else(PoisonError::into_inner) = Some(Box::new(action));
}

/// Ends the program at once, without temporary folders and files that are not complete.
pub fn end(words: &str) -> ! {
    output::to_stderr(words);
    airloop_fmi::last_words::end();
    airloop_series::scratch::abandon();
    std::process::exit(i32::from(INTERRUPTED));
}
