//! What the program says: results on standard output; all else on standard error, for people or for programs.
//!
//! For people a bar on a terminal and one line a stage everywhere; for programs, with `--json`, the lines of
//! [`espalier_pipeline::event_lines`].

use std::collections::BTreeMap;
use std::io::{ErrorKind, IsTerminal, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, OnceLock};

use espalier_pipeline::event_lines::{Failure, Line};
use espalier_pipeline::{Event, Setting, Stage, Took};
use indicatif::{ProgressBar, ProgressStyle};

use crate::args::Common;
use crate::explain::paragraph;

/// What the lines below a stage's own begin with.
const INDENT: &str = "          ";

/// The command, if standard error is for programs. Signals and panics speak too, so it belongs to the whole program.
static FOR_PROGRAMS: OnceLock<&'static str> = OnceLock::new();
/// Whether the first line for programs is printed.
static HAS_BEGUN: AtomicBool = AtomicBool::new(false);
/// Whether a line of results was lost.
static IS_RESULT_LOST: AtomicBool = AtomicBool::new(false);

/// From now on standard error is for programs.
pub(crate) fn speak_to_programs(command: &'static str) {
    let _ = FOR_PROGRAMS.set(command);
}

/// Whether standard error is for programs.
pub(crate) fn is_for_programs() -> bool {
    FOR_PROGRAMS.get().is_some()
}

/// Prints a line to standard error. A closed standard error is no reason to stop. A message quotes files and their names:
/// what in them would drive a terminal is shown as a sign of replacement.
pub(crate) fn line(text: &str) {
    if is_for_programs() {
        return tell(&Line::Note { message: text.to_owned() });
    }
    let _ = writeln!(std::io::stderr(), "{}", harmless(text));
}

/// Prints a line for programs, whole whoever else prints; before the first one, that which says what they are.
pub(crate) fn tell(line: &Line) {
    let Some(command) = FOR_PROGRAMS.get() else { return };
    let mut stderr = std::io::stderr().lock();
    if !HAS_BEGUN.swap(true, Ordering::Relaxed) {
        let _ = writeln!(stderr, "{}", Line::begin(command).to_json());
    }
    let _ = stderr.write_all(format!("{}\n", line.to_json()).as_bytes());
}

/// Says that the program ends by a signal or a bug of ours, with this exit code.
pub(crate) fn last_line(message: &str, exit_code: u8) {
    if is_for_programs() {
        tell(&Line::Failed(Failure::without_code(exit_code, message.to_owned())));
    } else {
        line(message);
    }
}

fn harmless(text: &str) -> String {
    text.replace(|letter: char| letter.is_control() && !matches!(letter, '\n' | '\r' | '\t'), "\u{FFFD}")
}

/// Prints a line to standard output.
pub(crate) fn result(text: &str) {
    arrived(writeln!(std::io::stdout(), "{}", harmless(text)));
}

/// Notes whether results arrived. A reader that has had enough (`| head`) is no reason to stop; anything else is told, once.
pub(crate) fn arrived(written: std::io::Result<()>) {
    let written = written.and_then(|()| std::io::stdout().flush());
    if let Err(source) = written
        && source.kind() != ErrorKind::BrokenPipe
        && !IS_RESULT_LOST.swap(true, Ordering::Relaxed)
    {
        crate::failure::report(&espalier_pipeline::Error::Print { source });
    }
}

/// Whether every line of results could be printed, as far as anyone wanted to read.
pub(crate) fn results_arrived() -> bool {
    !IS_RESULT_LOST.load(Ordering::Relaxed)
}

/// Shows the events of a run.
pub(crate) struct Progress {
    is_quiet: bool,
    /// How often `-v` was said.
    verbosity: u8,
    is_terminal: bool,
    bar: Mutex<Option<ProgressBar>>,
    /// How far the stage was when that was last told to programs, in percent.
    percent: AtomicU64,
}

/// No percentage.
const NOT_YET: u64 = u64::MAX;

impl Progress {
    pub(crate) fn new(common: &Common) -> Self {
        Self {
            is_quiet: common.quiet,
            verbosity: common.verbose,
            is_terminal: std::io::stderr().is_terminal(),
            bar: Mutex::new(None),
            percent: AtomicU64::new(NOT_YET),
        }
    }

    pub(crate) fn show(&self, event: Event) {
        if self.is_quiet && is_progress(&event) {
            return;
        }
        if is_for_programs() {
            return self.tell(event);
        }
        // A panic while the lock was held ends the process, so the lock is never poisoned for anyone.
        let Ok(mut bar) = self.bar.lock() else { return };
        if let Event::Progress { stage, done, total, note } = event {
            return advance(bar.as_ref(), stage, (done, total), &note);
        }
        if let Some(bar) = bar.take() {
            bar.finish_and_clear();
        }
        if let Event::Started { stage, .. } = &event {
            *bar = self.is_terminal.then(|| spinner(*stage));
        }
        let text = self.lines(event).join("\n");
        match bar.as_ref() {
            _ if text.is_empty() => {}
            Some(bar) => bar.suspend(|| line(&text)),
            None => line(&text),
        }
    }

    /// Tells programs; of a stage that goes on once for each percent.
    fn tell(&self, event: Event) {
        match &event {
            Event::Started { .. } => self.percent.store(NOT_YET, Ordering::Relaxed),
            Event::Progress { done, total, .. } => {
                let percent = done.saturating_mul(100) / (*total).max(1);
                if self.percent.swap(percent, Ordering::Relaxed) == percent {
                    return;
                }
            }
            _ => {}
        }
        tell(&Line::of(event));
    }

    /// What an event is to people.
    fn lines(&self, event: Event) -> Vec<String> {
        let because = |stage: Stage, what: &str, reason: String| {
            (self.verbosity > 0).then(|| format!("{stage:<9} {what}: {reason}"))
        };
        match event {
            Event::Opened { settings, .. } if self.verbosity > 0 => settings.iter().map(setting).collect(),
            Event::Started { stage, reason } => {
                because(stage, "to do", reason.to_string()).into_iter().collect()
            }
            Event::Warning { stage, code, message, .. } => {
                vec![format!("{stage:<9} warning[{code}]: {message}")]
            }
            Event::Finished { stage, line, counts, cost } => {
                let first = format!("{stage:<9}{:>6.1} s  {line}", cost.seconds);
                [vec![first], self.counted(&counts), self.parts(&cost)].concat()
            }
            Event::Waiting { out } => vec![format!("waiting for another run in {}", out.display())],
            Event::Kept { stage, line, counts } => {
                [vec![format!("{stage:<9}    kept  {line}")], self.counted(&counts)].concat()
            }
            Event::Taken { stage, reason, line, counts } => {
                let first = format!("{stage:<9}  shared  {line}");
                let why = because(stage, "to copy from the cache", reason.to_string());
                why.into_iter().chain([first]).chain(self.counted(&counts)).collect()
            }
            Event::Ended { seconds, peak_mb, n_warnings, .. } => {
                let memory = peak_mb.map_or_else(String::new, |mb| format!("  {mb:.0} MB of memory at most"));
                let warnings =
                    if n_warnings == 1 { "1 warning".to_owned() } else { format!("{n_warnings} warnings") };
                vec![format!("{:<9}{seconds:>6.1} s{memory}, {warnings}", "in all")]
            }
            Event::Combination { done, total, line } => vec![format!("{done:>3}/{total}  {line}")],
            Event::Stopped { kept, out } => vec![what_is_kept(&kept, &out)],
            _ => Vec::new(),
        }
    }

    /// What a stage has counted, for who wants to know.
    fn counted(&self, counts: &BTreeMap<String, f64>) -> Vec<String> {
        let all: Vec<String> = counts.iter().map(|(name, value)| format!("{name} {value}")).collect();
        self.details(&all)
    }

    /// What the parts of a stage took, likewise.
    fn parts(&self, cost: &Took) -> Vec<String> {
        let part = |(name, seconds, _): &(String, f64, Option<f64>)| format!("{name} {seconds:.1} s");
        self.details(&cost.parts.iter().map(part).collect::<Vec<_>>())
    }

    fn details(&self, facts: &[String]) -> Vec<String> {
        let are_shown = self.verbosity > 1 && !facts.is_empty();
        are_shown.then(|| paragraph(INDENT, &facts.join(", "))).into_iter().collect()
    }
}

/// Whether an event only says that things go on.
fn is_progress(event: &Event) -> bool {
    !matches!(event, Event::Warning { .. } | Event::Waiting { .. } | Event::Stopped { .. })
}

fn setting(Setting { key, value, default }: &Setting) -> String {
    let default =
        default.as_ref().map_or_else(|| "no default".to_owned(), |default| format!("default {default}"));
    format!("{:<9} {key} = {value} ({default})", "set")
}

/// What a run that failed has left.
fn what_is_kept(kept: &[Stage], out: &Path) -> String {
    if kept.is_empty() {
        return "stopped: nothing was written".to_owned();
    }
    let names: Vec<&str> = kept.iter().map(|stage| stage.name()).collect();
    format!("stopped: {} holds the results of {}", out.display(), names.join(", "))
}

fn spinner(stage: Stage) -> ProgressBar {
    let spinner = ProgressBar::new_spinner().with_message(stage.name());
    spinner.enable_steady_tick(std::time::Duration::from_millis(100));
    spinner
}

fn advance(bar: Option<&ProgressBar>, stage: Stage, (done, total): (u64, u64), note: &str) {
    let Some(bar) = bar else { return };
    if bar.length() != Some(total) {
        bar.set_style(bar_style());
        bar.set_length(total);
    }
    bar.set_position(done);
    bar.set_message(format!("{stage}  {note}"));
}

fn bar_style() -> ProgressStyle {
    ProgressStyle::with_template("{wide_bar} {percent:>3} %  {msg}")
        .unwrap_or_else(|_| ProgressStyle::default_bar())
}
