//! Ctrl-C and SIGTERM: end at once, and say what is left.
//!
//! There is nothing to clean up: files are written under temporary names and renamed when they are whole, a stage's record
//! comes after its files, and the lock goes with the process. So the program may end between any two instructions, and
//! a second run goes on from there.

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

use crate::progress;

/// What the system adds a signal's number to in the exit code of a program that it ended.
const SIGNAL_BASE: i32 = 128;

/// Ends the program with 130 or 143 when it is told to stop. Where signals cannot be heard, the system ends it itself.
pub(crate) fn end_on_signals() {
    let Ok(mut signals) = Signals::new([SIGINT, SIGTERM]) else { return };
    std::thread::spawn(move || {
        if let Some(signal) = signals.forever().next() {
            let exit_code = SIGNAL_BASE + signal;
            let message = "cancelled: what was done is in place; the same command goes on from there";
            progress::last_line(message, u8::try_from(exit_code).unwrap_or(u8::MAX));
            std::process::exit(exit_code);
        }
    });
}
