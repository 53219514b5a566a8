//! How far long work is: a line on a terminal, and lines of text for a program that asks for them.

use std::fmt::Debug;
use std::io::{IsTerminal, Result, Write};
use std::sync::{Mutex, PoisonError};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle, TermLike};

/// Variable of the environment: `lines` asks for the progress as lines of the standard error where that is no terminal.
const VARIABLE: &str = "AIRLOOP_PROGRESS";
/// Start of such a line.
const START: &str = "progress: ";
/// Most such lines in a second.
const LINES_PER_SECOND: u8 = 4;
const WIDTH: u16 = 100;

/// A bar of `length` parts, or a line without an end, in the form of `template`; hidden if `quiet` or nobody looks.
pub fn bar(quiet: bool, length: Option<u64>, template: &str) -> ProgressBar {
    let target = if quiet {
        ProgressDrawTarget::hidden()
    } else if std::io::stderr().is_terminal() {
        ProgressDrawTarget::stderr()
    } else if std::env::var_os(VARIABLE).is_some_and(|value| value == "lines") {
        ProgressDrawTarget::term_like_with_hz(Box::<Lines>::default(), LINES_PER_SECOND)
    } else {
        ProgressDrawTarget::hidden()
    };
    let bar = ProgressBar::with_draw_target(length, target);
    bar.set_style(ProgressStyle::with_template(template).expect("the template is well formed"));
    bar
}

/// Writes a drawing as a line of its own, if it differs from the one before.
#[derive(Debug, Default)]
struct Lines {
    drawn: Mutex<[String; 2]>,
}

impl TermLike for Lines {
    fn width(&self) -> u16 {
        WIDTH
    }

    fn move_cursor_up(&self, _: usize) -> Result<()> {
        Ok(())
    }

    fn move_cursor_down(&self, _: usize) -> Result<()> {
        Ok(())
    }

    fn move_cursor_right(&self, _: usize) -> Result<()> {
        Ok(())
    }

    fn move_cursor_left(&self, _: usize) -> Result<()> {
        Ok(())
    }

    fn write_line(&self, text: &str) -> Result<()> {
        self.write_str(text)
    }

    fn write_str(&self, text: &str) -> Result<()> {
        self.drawn.lock().unwrap_or_else(PoisonError::into_inner)[0].push_str(text);
        Ok(())
    }

    fn clear_line(&self) -> Result<()> {
        Ok(())
    }

    fn flush(&self) -> Result<()> {
        let mut drawn = self.drawn.lock().unwrap_or_else(PoisonError::into_inner);
        let [text, before] = &mut *drawn;
        let line = std::mem::take(text).trim().to_owned();
        if line.is_empty() || line == *before {
            return Ok(());
        }
        *before = line;
        // In one piece: notes and errors come to the same place.
        let whole = format!("{START}{before}\n");
        std::io::stderr().write_all(whole.as_bytes())
    }
}
