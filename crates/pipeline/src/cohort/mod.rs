//! Many scans, each with its own settings: done one by one, shown on one page.
//!
//! | step | file | what |
//! |--:|---|---|
//! | 1 | `table` | the table of the scans |
//! | 2 | this file | each row with its config: what is wrong is told before anything is done |
//! | 3 | `sample` | one scan: doing it, and whether it is done |
//! | 4 | `page` | the page over all, and the list of those that failed |
//!
//! **Input** a table, as `samples.tsv`: a row a scan. **Output** `runs/ID/`, a run folder a scan; `group/`, the page;
//! `failures.tsv`, which scans have no map, why, and the command that tries each again.
//! **Guarantees** a scan that fails stops no other. A scan that is done is looked at, not done again.

mod page;
mod sample;
mod table;

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::json;

use crate::config::{DATA_VARIABLE, Loaded, Override};
use crate::error::Error;
use crate::event::Event;
use crate::run::{self, Summary};
use crate::shell;
use crate::side_file::SideFile;
use table::{Row, quoted};

pub use page::{CohortPage, FailedSample, PageRequest};
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
    /// What the command line changes, for all scans; it has the last word.
    pub overrides: Vec<Override>,
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
}

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
    pub(crate) fn new(out: PathBuf) -> Self {
        Self { samples: Vec::new(), absent: Vec::new(), out }
    }

    /// Reads the table and the configs; nothing is done yet.
    ///
    /// # Errors
    /// [`Error::Samples`] with all that is wrong, line by line; [`Error::Read`] if there is no such table.
    pub fn read(request: &CohortRequest) -> Result<Self, Error> {
        let text = table_text(&request.table)?;
        let refused = |problems| Error::Samples { path: request.table.clone(), problems };
        let rows = table::rows(&text).map_err(refused)?;
        let (mut cohort, mut problems) = (Self::new(request.out.clone()), Vec::new());
        for row in &rows {
            match sample(request, row) {
                Ok(sample) => cohort.samples.push(sample),
                Err(error) => problems.push(format!("line {}: {}: {error}", row.line, row.id)),
            }
        }
        if problems.is_empty() { Ok(cohort) } else { Err(refused(problems)) }
    }

    /// Those of the scans that have these ids, in the order of the table.
    ///
    /// # Errors
    /// [`Error::NoSample`] for an id that none has.
    pub fn only(mut self, ids: &[String]) -> Result<Self, Error> {
        for id in ids {
            if !self.samples.iter().any(|sample| sample.id == *id) {
                return Err(Error::NoSample { id: id.clone() });
            }
        }
        self.samples.retain(|sample| ids.contains(&sample.id));
        Ok(self)
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
    /// that it is made from, and one digest over its settings.
    #[must_use]
    pub fn list(&self, effort: &Effort) -> String {
        let sample = |sample: &Sample| {
            json!({
                "id": sample.id, "folder": sample.out, "done_file": sample.done_file(),
                "files": sample.files(effort), "settings": sample.settings(), "done": sample.is_done(),
            })
        };
        let samples: Vec<_> = self.samples.iter().map(sample).collect();
        let list = json!({ "format": LIST_FORMAT, "version": LIST_VERSION, "samples": samples });
        serde_json::to_string_pretty(&list).unwrap_or_default() + "\n"
    }
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

/// A row with its config.
fn sample(request: &CohortRequest, row: &Row) -> Result<Sample, Error> {
    let base_dir = request.table.parent().unwrap_or(Path::new(""));
    let in_table = row.config.as_ref().map(|config| base_dir.join(config));
    let config_file = in_table.or_else(|| request.config.clone());
    let from_here = |set: &Override| Override { value: from_folder(base_dir, set), ..set.clone() };
    let mut overrides: Vec<Override> = row.settings.iter().map(from_here).collect();
    overrides.extend(request.overrides.iter().cloned());
    let written = row.settings.iter().find(|set| set.key == "input.path").map(|set| set.value.clone());
    let loaded = match (&config_file, &written) {
        (Some(config), _) => Loaded::read_config(config, &overrides)?,
        (None, path) => Loaded::read(Path::new(&text_of(path.as_deref().unwrap_or_default())), &overrides)?,
    };
    run::source_of(&loaded, request.data_dir.as_deref())?;
    let (retry, retry_shown) = retries(request, &row.id);
    let out = request.out.join("runs").join(&row.id);
    let written = written.or_else(|| loaded.config.input.path.clone()).unwrap_or_default();
    Ok(Sample { id: row.id.clone(), out, loaded, config_file, written, retry, retry_shown })
}

/// The value of a setting; a path in the table is relative to the table's folder, whatever config it goes into.
fn from_folder(base_dir: &Path, set: &Override) -> String {
    let text = text_of(&set.value);
    if !is_path(set) || text.is_empty() || text.starts_with(DATA_VARIABLE) {
        return set.value.clone();
    }
    let path = base_dir.join(text);
    quoted(&std::path::absolute(&path).unwrap_or(path).to_string_lossy())
}

fn is_path(set: &Override) -> bool {
    set.key == "input.path" || SideFile::ALL.iter().any(|side| side.key() == set.key)
}

/// The text in a TOML string; of what is none, as it is.
fn text_of(value: &str) -> String {
    let table = toml::from_str::<toml::Table>(&format!("value = {value}")).ok();
    let text = table.as_ref().and_then(|table| table.get("value")?.as_str());
    text.unwrap_or(value).to_owned()
}

/// The commands that do a scan alone: as it would be typed, and as a page may show it.
fn retries(request: &CohortRequest, id: &str) -> (String, String) {
    let command = |path: &dyn Fn(&Path) -> String| {
        let mut words = vec!["espalier cohort".to_owned(), shell::word(&path(&request.table))];
        words.push(format!("-o {}", shell::word(&path(&request.out))));
        words.extend(request.config.iter().map(|config| format!("--config {}", shell::word(&path(config)))));
        words.extend(settings_words(&request.overrides, path));
        words.push(format!("--only {id}"));
        words.join(" ")
    };
    let as_typed = |path: &Path| path.to_string_lossy().into_owned();
    (command(&as_typed), command(&shell::shown))
}

/// Settings of the command line as words of a shell; paths among them as they are to be shown.
pub(crate) fn settings_words(overrides: &[Override], path: &dyn Fn(&Path) -> String) -> Vec<String> {
    let value = |set: &Override| {
        if is_path(set) { path(Path::new(&text_of(&set.value))) } else { set.value.clone() }
    };
    let words = |set: &Override| format!("--set {}", shell::word(&format!("{}={}", set.key, value(set))));
    overrides.iter().map(words).collect()
}
