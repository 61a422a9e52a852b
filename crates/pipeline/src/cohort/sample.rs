//! One scan of a cohort: doing it.
//!
//! **Input** a config with its paths, and a run folder. **Output** the run, and beside its results the note that it is done.
//! **Steps** 1. The note of an earlier run goes. 2. The run. 3. A new note, or why there is none.
//! **Guarantees** a run that is killed leaves no note; one that fails leaves `provenance/failure.json`, also where it made
//! nothing else.

use std::collections::BTreeMap;
use std::path::PathBuf;

use espalier_report::group::Failed;

use super::Retry;
use super::done::Standing;
use crate::cache::Cache;
use crate::config::{Loaded, Source};
use crate::error::Error;
use crate::event::Event;
use crate::failure;
use crate::folder::RunFolder;
use crate::group;
use crate::run::{self, Request, Summary};
use crate::side_file::SideFile;
use crate::stage::Artifact;

/// Volumes whose voxels lie in a file of their own.
const WITH_DATA_BESIDE: [&str; 4] = ["nhdr", "mhd", "hdr", "img"];

/// A scan of a cohort.
#[derive(Clone, Debug)]
pub struct Sample {
    /// What it is called: on the page, and on the command line.
    pub id: String,
    /// Its run folder.
    pub out: PathBuf,
    pub(crate) loaded: Loaded,
    /// The config file that was read for it.
    pub(crate) config_file: Option<PathBuf>,
    /// The paths of its files as they were written, by key.
    pub(crate) written: BTreeMap<&'static str, String>,
    /// The command that does it alone.
    pub(crate) retry: Retry,
}

/// How scans are done.
#[derive(Clone, Debug, Default)]
pub struct Effort {
    /// As in [`Request`].
    pub threads: Option<usize>,
    /// As in [`Request`].
    pub max_memory_bytes: u64,
    /// As in [`Request`].
    pub data_dir: Option<PathBuf>,
    /// As in [`Request`].
    pub force: bool,
    /// As in [`Request`].
    pub wait: bool,
    /// As in [`Request`].
    pub cache: Option<Cache>,
}

impl Sample {
    /// Does the scan.
    ///
    /// # Errors
    /// [`Error`], as [`run()`](fn@crate::run).
    pub fn perform(&self, effort: &Effort, events: &(dyn Fn(Event) + Sync)) -> Result<Summary, Error> {
        let done_file = self.done_file();
        // A folder that is there keeps the note of a failure; that of another's making would take it away.
        let provenance = done_file.parent().unwrap_or(&self.out);
        std::fs::create_dir_all(provenance)
            .map_err(|source| Error::Create { path: provenance.to_owned(), source })?;
        let earlier = self.undo()?;
        let done = run::run(&self.request(effort), events);
        match &done {
            Ok(summary) => self.note_done(&summary.digest)?,
            // Nothing was done, and whoever holds the folder will say how that went.
            Err(Error::Locked { .. }) => self.redo(earlier)?,
            Err(error) => failure::note(&RunFolder::to_read(&self.out), error),
        }
        done
    }

    fn request(&self, effort: &Effort) -> Request {
        Request {
            loaded: self.loaded.clone(),
            out: self.out.clone(),
            from: None,
            to: None,
            files: BTreeMap::new(),
            force: effort.force,
            wait: effort.wait,
            threads: effort.threads,
            max_memory_bytes: effort.max_memory_bytes,
            data_dir: effort.data_dir.clone(),
            cache: effort.cache.clone(),
        }
    }

    /// The files that its results are made from, as far as they are there.
    pub(crate) fn files(&self, effort: &Effort) -> Vec<PathBuf> {
        let Loaded { config, base_dir } = &self.loaded;
        let mut files: Vec<PathBuf> = self.config_file.iter().cloned().collect();
        if let Ok(Source::Volume(path) | Source::Tree(path)) =
            run::source_of(&self.loaded, effort.data_dir.as_deref())
        {
            let extension = path.extension().unwrap_or_default();
            if WITH_DATA_BESIDE.iter().any(|known| extension.eq_ignore_ascii_case(known)) {
                files.extend(
                    espalier_volume::files(&path, &espalier_volume::ReadOptions::default())
                        .unwrap_or_default(),
                );
            }
            files.push(path);
        }
        files.extend(SideFile::ALL.into_iter().filter_map(|side| Some(base_dir.join(side.path_in(config)?))));
        files.retain(|file| file.exists());
        files.sort();
        files.dedup();
        files
    }

    /// Why it is not done; none if it is.
    pub(crate) fn trouble(&self) -> Option<Failed> {
        let standing = self.standing();
        if standing == Standing::Done {
            return None;
        }
        let is_noted = failure::read(&self.out).is_some();
        if is_noted || !self.out.join(Artifact::Embedding.file()).exists() {
            // The command that does it again is the cohort's own, and a page without names has none.
            return Some(Failed { retry: None, ..group::without_map(&self.out, &self.id) });
        }
        Some(Failed {
            code: "E-GROUP-UNFINISHED".to_owned(),
            reason: match standing {
                Standing::OtherSettings => {
                    "done before, but not with these settings and paths: the page takes the options that the scan was done \
                     with"
                    .to_owned()
                }
                Standing::Altered { file } => {
                    format!("done before, but {file} is gone since, or not as long as it was")
                }
                Standing::Done | Standing::Undone => {
                    "done before, but its last run has not come to its end, or others have made results there since"
                        .to_owned()
                }
            },
            done_to: None,
            retry: None,
        })
    }
}
