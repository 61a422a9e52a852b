//! Many scans, each with its own settings: done one by one, shown on one page.
//!
//! | step | file | what |
//! |--:|---|---|
//! | 1 | `table` | the table of the scans |
//! | 2 | `configure` | a row with its config |
//! | 3 | this file | what is wrong with any of them is told before anything is done; then one after the other |
//! | 4 | `sample`, `done` | one scan: doing it, and whether it is done |
//! | 5 | `page`, `retry` | the page over all, and the list of those that failed, with the command that does each alone |
//!
//! **Input** a table, as `samples.tsv`: a row a scan. **Output** `runs/ID/`, a run folder a scan; `group/`, the page;
//! `failures.tsv`, which scans have no map, why, and the command that tries each again.
//! **Guarantees** a scan that fails stops no other. A scan that is done is looked at, not done again. Of two calls at once
//! that do all scans one goes on and the other stops or waits; calls for single scans may run beside each other. A call for
//! some scans reads their configs and no others.

mod configure;
mod done;
mod page;
mod retry;
mod sample;
mod table;

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::json;

use espalier_model::Diagnose;

use crate::config::Override;
use crate::error::Error;
use crate::event::Event;
use crate::lock::{Lock, Patience};
use crate::run::Summary;

pub(crate) use configure::written;
pub use page::{CohortPage, FailedSample, PageRequest};
pub(crate) use retry::Retry;
pub use retry::Word;
pub use sample::{Effort, Sample};

/// The longest table that is read, in bytes.
const MAX_TABLE_BYTES: u64 = 16 << 20;
const LIST_FORMAT: &str = "espalier-cohort";
const LIST_VERSION: u32 = 1;

/// A cohort as it is asked for.
#[derive(Clone, Debug)]
pub struct CohortRequest {
    /// The table of the scans; paths in it are relative to its folder.
    pub table: PathBuf,
    /// Where the results go.
    pub out: PathBuf,
    /// The config of the rows that name none.
    pub config: Option<PathBuf>,
    /// The ids of the scans that are meant; all if none is named.
    pub only: Vec<String>,
    /// What the command line changes, for all scans; it has the last word.
    pub overrides: Vec<Override>,
    /// Other options of the command line, as the commands repeat them that do a scan alone.
    pub options: Vec<Word>,
    /// What `$ESPALIER_DATA` stands for.
    pub data_dir: Option<PathBuf>,
}

/// Where a scan stands while a cohort is done.
#[derive(Clone, Copy, Debug)]
pub enum Turn<'a> {
    /// It begins.
    Begins,
    /// It is done.
    Done(&'a Summary),
    /// It has failed.
    Failed(&'a Error),
}

/// Scans that belong together.
#[derive(Clone, Debug)]
pub struct Cohort {
    /// The scans, in the order of the table.
    pub samples: Vec<Sample>,
    /// What ought to have a scan, and has none.
    pub absent: Vec<Absent>,
    /// Where page and list go.
    pub(crate) out: PathBuf,
    /// Whether these are all the scans of the folder.
    pub(crate) is_whole: bool,
}

/// The right to do all the scans of a cohort; given back when it is dropped.
pub struct Hold(#[allow(dead_code, reason = "held, not used")] Option<Lock>);

/// A scan that is not there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Absent {
    /// What it would be called.
    pub id: String,
    /// The code of it.
    pub code: &'static str,
    /// What is not there.
    pub reason: String,
}

impl Cohort {
    /// A cohort without a scan.
    pub(crate) fn new(out: PathBuf, is_whole: bool) -> Self {
        Self { samples: Vec::new(), absent: Vec::new(), out, is_whole }
    }

    /// Reads the table, and the configs of the scans that are meant; nothing is done yet.
    ///
    /// # Errors
    /// [`Error::Samples`] with all that is wrong, line by line; [`Error::NoSample`] for an id that no row has;
    /// [`Error::Read`] if there is no such table.
    pub fn read(request: &CohortRequest) -> Result<Self, Error> {
        let text = table_text(&request.table)?;
        let refused = |problems| Error::Samples { path: request.table.clone(), problems };
        let mut rows = table::rows(&text).map_err(refused)?;
        if let Some(id) = request.only.iter().find(|id| !rows.iter().any(|row| row.id == **id)) {
            return Err(Error::NoSample { id: id.clone() });
        }
        let is_whole = request.only.is_empty();
        rows.retain(|row| is_whole || request.only.contains(&row.id));
        let (mut cohort, mut problems) = (Self::new(request.out.clone(), is_whole), Vec::new());
        for row in &rows {
            match configure::sample(request, row) {
                Ok(sample) => cohort.samples.push(sample),
                Err(error) => problems.push(format!("line {}: {}: {}", row.line, row.id, with_hint(&error))),
            }
        }
        if problems.is_empty() { Ok(cohort) } else { Err(refused(problems)) }
    }

    /// Takes the folder of the results until the value that it gives is dropped: two calls that do all the scans would stop
    /// each other at every scan. Calls for some of the scans need no such right.
    ///
    /// # Errors
    /// [`Error::Locked`] if another call has it, unless that is waited for; [`Error::Create`] if the folder cannot be made.
    pub fn hold(&self, wait: bool, events: &(dyn Fn(Event) + Sync)) -> Result<Hold, Error> {
        let say_so = || events(Event::Waiting { out: self.out.clone() });
        let patience = if wait { Patience::Wait(&say_so) } else { Patience::None };
        self.is_whole.then(|| Lock::take(&self.out, patience)).transpose().map(Hold)
    }

    /// Does the scans one after the other; one that fails stops no other. Before and after each, `said` is told.
    ///
    /// # Errors
    /// Of a single scan its own error, else [`Error::Cohort`] if any failed.
    pub fn perform(
        &self,
        effort: &Effort,
        events: &(dyn Fn(Event) + Sync),
        said: &dyn Fn(&Sample, Turn<'_>),
    ) -> Result<(), Error> {
        let (mut n_failed, mut first) = (0, None);
        for sample in &self.samples {
            said(sample, Turn::Begins);
            match sample.perform(effort, events) {
                Ok(summary) => said(sample, Turn::Done(&summary)),
                Err(error) => {
                    said(sample, Turn::Failed(&error));
                    n_failed += 1;
                    first.get_or_insert((sample, error));
                }
            }
        }
        match first {
            None => Ok(()),
            Some((_, error)) if self.samples.len() == 1 => Err(error),
            Some((sample, error)) => Err(Error::Cohort {
                n_failed,
                n_samples: self.samples.len(),
                first: sample.id.clone(),
                cause: Box::new(error),
            }),
        }
    }

    /// The scans as JSON, for programs that do them: of each its folder, the file that is there once it is done, the files
    /// that it is made from, one digest over its settings, whether it is done, and whether it was but its results are other
    /// ones now.
    #[must_use]
    pub fn list(&self, effort: &Effort) -> String {
        let sample = |sample: &Sample| {
            json!({
                "id": sample.id, "folder": sample.out, "done_file": sample.done_file(),
                "files": sample.files(effort), "settings": sample.settings(), "done": sample.is_done(),
                "altered": sample.is_altered(),
            })
        };
        let samples: Vec<_> = self.samples.iter().map(sample).collect();
        let list = json!({ "format": LIST_FORMAT, "version": LIST_VERSION, "samples": samples });
        serde_json::to_string_pretty(&list).unwrap_or_default() + "\n"
    }
}

/// An error with its way out, on a line of its own.
fn with_hint(error: &Error) -> String {
    let hint = Some(error.hint()).filter(|hint| !hint.is_empty());
    format!("{error}{}", hint.map(|hint| format!("\n    hint: {hint}")).unwrap_or_default())
}

fn table_text(path: &Path) -> Result<String, Error> {
    let read = |source| Error::Read { path: path.to_owned(), source };
    let needed = fs::metadata(path).map_err(read)?.len();
    if needed > MAX_TABLE_BYTES {
        return Err(Error::TooLarge { path: path.to_owned(), needed, limit: MAX_TABLE_BYTES });
    }
    let bytes = fs::read(path).map_err(read)?;
    let no_text =
        |_| Error::Samples { path: path.to_owned(), problems: vec!["it is not UTF-8 text".to_owned()] };
    String::from_utf8(bytes).map_err(no_text)
}
