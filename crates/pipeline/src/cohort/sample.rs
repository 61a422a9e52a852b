//! One scan of a cohort: doing it, and whether it is done.
//!
//! **Input** a config with its paths, and a run folder. **Output** the run, and beside its results
//! `provenance/sample.json`: what it was made with, written when it is done.
//! **Steps** 1. The note of an earlier run goes. 2. The run. 3. A new note, or why there is none.
//! **Guarantees** a scan counts as done only if its last run came to its end and had these settings and this path. A run
//! that is killed leaves no such note; one that fails leaves `provenance/failure.json`, also where it made nothing else.

use std::collections::BTreeMap;
use std::path::PathBuf;

use espalier_report::group::Failed;
use serde::{Deserialize, Serialize};

use crate::cache::Cache;
use crate::config::{Config, Loaded, Source};
use crate::error::Error;
use crate::event::Event;
use crate::failure;
use crate::folder::{RunFolder, hex_digest};
use crate::group;
use crate::run::{self, Request, Summary};
use crate::settings;
use crate::side_file::SideFile;
use crate::stage::{Artifact, Stage};

/// Where it is noted that a scan is done.
const DONE_FILE: &str = "provenance/sample.json";
const FORMAT: &str = "espalier-sample";
const VERSION: u32 = 1;
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
    /// Its path as it was written.
    pub(crate) written: String,
    /// The command that does it alone, as it would be typed.
    pub(crate) retry: String,
    /// The same as a page may show it.
    pub(crate) retry_shown: String,
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

/// That a scan is done.
#[derive(Serialize, Deserialize)]
struct Done {
    format: String,
    version: u32,
    /// What it was made with.
    settings: String,
    /// The digest that the run printed.
    digest: String,
}

impl Sample {
    /// Does the scan.
    ///
    /// # Errors
    /// [`Error`], as [`run()`](fn@crate::run).
    pub fn perform(&self, effort: &Effort, events: &(dyn Fn(Event) + Sync)) -> Result<Summary, Error> {
        let folder = RunFolder::to_read(&self.out);
        let done_file = self.done_file();
        // A folder that is there keeps the note of a failure; that of another's making would take it away.
        let provenance = done_file.parent().unwrap_or(&self.out);
        std::fs::create_dir_all(provenance)
            .map_err(|source| Error::Create { path: provenance.to_owned(), source })?;
        let earlier = std::fs::read(&done_file).ok();
        match std::fs::remove_file(&done_file) {
            Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
                return Err(Error::Write { path: done_file, source });
            }
            _ => {}
        }
        let done = run::run(&self.request(effort), events);
        match &done {
            Ok(summary) => folder.write_aside(DONE_FILE, self.done(&summary.digest).as_bytes())?,
            // Nothing was done, and whoever holds the folder will say how that went.
            Err(Error::Locked { .. }) => {
                if let Some(earlier) = earlier.filter(|_| !done_file.exists()) {
                    folder.write_aside(DONE_FILE, &earlier)?;
                }
            }
            Err(error) => failure::note(&folder, error),
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

    /// The file that is there once the scan is done.
    #[must_use]
    pub fn done_file(&self) -> PathBuf {
        self.out.join(DONE_FILE)
    }

    fn done(&self, digest: &str) -> String {
        let done = Done {
            format: FORMAT.to_owned(),
            version: VERSION,
            settings: self.settings(),
            digest: digest.to_owned(),
        };
        serde_json::to_string_pretty(&done).unwrap_or_default() + "\n"
    }

    /// One digest over all that decides what its results are, but for what its files hold.
    #[must_use]
    pub fn settings(&self) -> String {
        let versions = Stage::ALL.map(|stage| format!("{stage} {}\n", stage.version())).concat();
        let Loaded { config, .. } = &self.loaded;
        let version = env!("CARGO_PKG_VERSION");
        let (written, settings, beside) = (&self.written, settings::portable_text(config), beside(config));
        hex_digest(format!("{version}\n{versions}{written}\n{beside}{settings}").as_bytes())
    }

    /// Whether it is done, with these settings and this path, and nobody has made other results there since.
    #[must_use]
    pub fn is_done(&self) -> bool {
        let text = std::fs::read_to_string(self.done_file()).unwrap_or_default();
        let sums = std::fs::read(self.out.join("SHA256SUMS")).ok();
        let digest = sums.map(|sums| hex_digest(&sums));
        serde_json::from_str::<Done>(&text).is_ok_and(|done| {
            done.format == FORMAT
                && done.version == VERSION
                && done.settings == self.settings()
                && Some(done.digest) == digest
        })
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
        if self.is_done() {
            return None;
        }
        let is_noted = failure::read(&self.out).is_some();
        if is_noted || !self.out.join(Artifact::Embedding.file()).exists() {
            // The command that does it again is the cohort's own, and a page without names has none.
            return Some(Failed { retry: None, ..group::without_map(&self.out, &self.id) });
        }
        Some(Failed {
            code: "E-GROUP-UNFINISHED".to_owned(),
            reason: "done before, but not with these settings and this path, or not to its end".to_owned(),
            done_to: None,
            retry: None,
        })
    }
}

/// The names of the files beside the input, as the config has them.
fn beside(config: &Config) -> String {
    SideFile::ALL.into_iter().filter_map(|side| Some(format!("{}\n", side.path_in(config)?))).collect()
}
