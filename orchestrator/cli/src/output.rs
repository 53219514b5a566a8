//! Text for the user: a closed pipe is not an error, a device that cannot be written to is one.

use std::io::{ErrorKind, Write};

use airloop::Error;

/// Prints to the standard output. A closed pipe (as with `| head`) is not an error.
///
/// # Errors
/// [`Error::Output`] if the text cannot be written, as on a full device.
pub fn print(text: &str) -> Result<(), Error> {
    let mut out = std::io::stdout().lock();
    allow_closed(out.write_all(without_controls(text).as_bytes()).and_then(|()| out.flush()))
}

/// Prints a line to the standard error; if even that is closed, there is nobody to tell.
pub fn to_stderr(text: &str) {
    let _ = writeln!(std::io::stderr(), "{}", without_controls(text));
}

/// The text with control characters written out: they come from files of others and could command the terminal.
fn without_controls(text: &str) -> String {
    let is_command = |letter: char| letter.is_control() && !matches!(letter, '\n' | '\r' | '\t');
    let shown = |letter: char| match is_command(letter) {
        true => letter.escape_unicode().to_string(),
        false => letter.to_string(),
    };
    if text.chars().any(is_command) { text.chars().map(shown).collect() } else { text.to_owned() }
}

/// Outcome of writing to the standard output; a closed pipe is not an error.
///
/// # Errors
/// Same as [`print()`].
pub fn allow_closed(outcome: std::io::Result<()>) -> Result<(), Error> {
    match outcome {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(Error::Output(error)),
        _ => Ok(()),
    }
}
