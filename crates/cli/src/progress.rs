//! Progress on standard error: a bar on a terminal, one line a stage everywhere.

use std::io::{ErrorKind, IsTerminal, Write};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use espalier_pipeline::{Event, Stage};
use indicatif::{ProgressBar, ProgressStyle};

/// Prints a line to standard error. A closed standard error is no reason to stop. A message quotes files and their names:
/// what in them would drive a terminal is shown as a sign of replacement.
pub(crate) fn line(text: &str) {
    let _ = writeln!(std::io::stderr(), "{}", harmless(text));
}

fn harmless(text: &str) -> String {
    text.replace(|letter: char| letter.is_control() && !matches!(letter, '\n' | '\r' | '\t'), "\u{FFFD}")
}

/// Whether a line of results was lost.
static IS_RESULT_LOST: AtomicBool = AtomicBool::new(false);

/// Prints a line to standard output. A reader that has had enough (`| head`) is no reason to stop.
pub(crate) fn result(text: &str) {
    match writeln!(std::io::stdout(), "{}", harmless(text)) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            line(&format!("error: cannot print results: {error}"));
            IS_RESULT_LOST.store(true, Ordering::Relaxed);
        }
        _ => {}
    }
}

/// Whether every line of results could be printed, as far as anyone wanted to read.
pub(crate) fn results_arrived() -> bool {
    !IS_RESULT_LOST.load(Ordering::Relaxed)
}

/// Shows the events of a run.
pub(crate) struct Progress {
    is_quiet: bool,
    is_terminal: bool,
    bar: Mutex<Option<ProgressBar>>,
}

impl Progress {
    pub(crate) fn new(is_quiet: bool) -> Self {
        Self { is_quiet, is_terminal: std::io::stderr().is_terminal(), bar: Mutex::new(None) }
    }

    pub(crate) fn show(&self, event: Event) {
        if let (
            true,
            Event::Started { .. }
            | Event::Progress { .. }
            | Event::Finished { .. }
            | Event::Kept { .. }
            | Event::Taken { .. }
            | Event::Ended { .. },
        ) = (self.is_quiet, &event)
        {
            return;
        }
        // A panic while the lock was held ends the process, so the lock is never poisoned for anyone.
        let Ok(mut bar) = self.bar.lock() else { return };
        match event {
            Event::Started { stage } if self.is_terminal => {
                let spinner = ProgressBar::new_spinner().with_message(stage.name());
                spinner.enable_steady_tick(std::time::Duration::from_millis(100));
                *bar = Some(spinner);
            }
            Event::Progress { stage, done, total, note } => {
                if let Some(bar) = bar.as_ref() {
                    if bar.length() != Some(total) {
                        bar.set_style(bar_style());
                        bar.set_length(total);
                    }
                    bar.set_position(done);
                    bar.set_message(format!("{stage}  {note}"));
                }
            }
            Event::Warning { stage, code, message } => {
                finish(&mut bar);
                line(&format!("{stage:<9} warning[{code}]: {message}"));
            }
            Event::Finished { stage, seconds, line: text } => {
                finish(&mut bar);
                line(&format!("{stage:<9}{seconds:>6.1} s  {text}"));
            }
            Event::Waiting { out } => {
                finish(&mut bar);
                line(&format!("waiting for another run in {}", out.display()));
            }
            Event::Kept { stage, line: text } => {
                finish(&mut bar);
                line(&format!("{stage:<9}    kept  {text}"));
            }
            Event::Taken { stage, line: text } => {
                finish(&mut bar);
                line(&format!("{stage:<9}  shared  {text}"));
            }
            Event::Ended { seconds, peak_mb, n_warnings } => {
                finish(&mut bar);
                let memory = peak_mb.map_or_else(String::new, |mb| format!("  {mb:.0} MB of memory at most"));
                let warnings =
                    if n_warnings == 1 { "1 warning".to_owned() } else { format!("{n_warnings} warnings") };
                line(&format!("{:<9}{seconds:>6.1} s{memory}, {warnings}", "in all"));
            }
            Event::Combination { done, total, line: text } => {
                finish(&mut bar);
                if !self.is_quiet {
                    line(&format!("{done:>3}/{total}  {text}"));
                }
            }
            Event::Stopped { kept, out } => {
                finish(&mut bar);
                line(&what_is_kept(&kept, &out));
            }
            _ => {}
        }
    }
}

/// What a run that failed has left.
fn what_is_kept(kept: &[Stage], out: &Path) -> String {
    if kept.is_empty() {
        return "stopped: nothing was written".to_owned();
    }
    let names: Vec<&str> = kept.iter().map(|stage| stage.name()).collect();
    format!("stopped: {} holds the results of {}", out.display(), names.join(", "))
}

fn finish(bar: &mut Option<ProgressBar>) {
    if let Some(bar) = bar.take() {
        bar.finish_and_clear();
    }
}

fn bar_style() -> ProgressStyle {
    ProgressStyle::with_template("{wide_bar} {percent:>3} %  {msg}")
        .unwrap_or_else(|_| ProgressStyle::default_bar())
}
