//! Whether a scan is done: `provenance/sample.json`, written when its run has come to its end.
//!
//! **Input** a scan and its run folder. **Output** a [`Standing`].
//! **Steps** 1. The note is there, and is of these settings and paths. 2. `SHA256SUMS` is the one that the run printed the
//! digest of. 3. Every file that it names is there, as long as it was.
//! **Guarantees** results that were removed, cut or written over by others count as not done. A change that leaves a file as
//! long as it was is for `espalier verify` to see, and for the next run, which go by digests.
//! **Cost** a look at each file's entry in its folder; no result is read.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::Sample;
use crate::config::Loaded;
use crate::error::Error;
use crate::folder::{DIGEST_FILE, RunFolder, hex_digest};
use crate::settings;
use crate::stage::Stage;

const FILE: &str = "provenance/sample.json";
const FORMAT: &str = "espalier-sample";
const VERSION: u32 = 2;

/// Where a scan stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Standing {
    /// It is done.
    Done,
    /// Its last run has not come to its end, or others have made results there since.
    Undone,
    /// Its last run had other settings, or other paths.
    OtherSettings,
    /// A file of its results is gone, or not as long as it was.
    Altered {
        /// Its name in the run folder.
        file: String,
    },
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
    /// Bytes of each file that `SHA256SUMS` names.
    sizes: BTreeMap<String, u64>,
}

impl Sample {
    /// The file that is there once the scan is done.
    #[must_use]
    pub fn done_file(&self) -> PathBuf {
        self.out.join(FILE)
    }

    /// Whether it is done, with these settings and paths, and all its results are there as they were left.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.standing() == Standing::Done
    }

    /// Whether it was done with these settings and paths, and its results are not those any more.
    #[must_use]
    pub fn is_altered(&self) -> bool {
        self.done_file().exists() && matches!(self.standing(), Standing::Altered { .. } | Standing::Undone)
    }

    /// One digest over all that decides what its results are, but for what its files hold.
    #[must_use]
    pub fn settings(&self) -> String {
        let versions = Stage::ALL.map(|stage| format!("{stage} {}\n", stage.version())).concat();
        let Loaded { config, .. } = &self.loaded;
        let version = env!("CARGO_PKG_VERSION");
        let written: String = self.written.iter().map(|(key, path)| format!("{key} = {path}\n")).collect();
        hex_digest(format!("{version}\n{versions}{written}{}", settings::portable_text(config)).as_bytes())
    }

    pub(crate) fn standing(&self) -> Standing {
        let text = fs::read_to_string(self.done_file()).unwrap_or_default();
        let done = serde_json::from_str::<Done>(&text).ok();
        let Some(done) = done.filter(|done| done.format == FORMAT && done.version == VERSION) else {
            return Standing::Undone;
        };
        if done.settings != self.settings() {
            return Standing::OtherSettings;
        }
        let sums = fs::read(self.out.join(DIGEST_FILE)).unwrap_or_default();
        if hex_digest(&sums) != done.digest {
            return Standing::Undone;
        }
        let mut sizes = RunFolder::to_read(&self.out).sizes().into_iter();
        let altered = sizes.find(|(file, size)| size.is_none() || done.sizes.get(file) != size.as_ref());
        altered.map_or(Standing::Done, |(file, _)| Standing::Altered { file })
    }

    /// Takes the note away, and gives what it said.
    pub(super) fn undo(&self) -> Result<Option<Vec<u8>>, Error> {
        let path = self.done_file();
        let earlier = fs::read(&path).ok();
        match fs::remove_file(&path) {
            Err(source) if source.kind() != io::ErrorKind::NotFound => Err(Error::Write { path, source }),
            _ => Ok(earlier),
        }
    }

    /// Gives back a note that was taken away, unless there is another by now.
    pub(super) fn redo(&self, earlier: Option<Vec<u8>>) -> Result<(), Error> {
        let earlier = earlier.filter(|_| !self.done_file().exists());
        earlier.map_or(Ok(()), |note| RunFolder::to_read(&self.out).write_aside(FILE, &note))
    }

    /// Notes that it is done.
    pub(super) fn note_done(&self, digest: &str) -> Result<(), Error> {
        let folder = RunFolder::to_read(&self.out);
        let sizes = folder.sizes().into_iter().filter_map(|(file, size)| Some((file, size?))).collect();
        let done = Done {
            format: FORMAT.to_owned(),
            version: VERSION,
            settings: self.settings(),
            digest: digest.to_owned(),
            sizes,
        };
        let json = serde_json::to_string_pretty(&done).unwrap_or_default() + "\n";
        folder.write_aside(FILE, json.as_bytes())
    }
}
