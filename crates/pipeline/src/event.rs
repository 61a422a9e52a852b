//! What a run tells its caller while it goes on.

use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::record::Reason;
use crate::stage::Stage;

/// Something that happened in a run.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Event {
    /// A run begins, and its folder is its own.
    Opened {
        /// The run folder.
        out: PathBuf,
        /// The stages that it goes through.
        stages: Vec<Stage>,
        /// The settings that are not at their default.
        settings: Vec<Setting>,
    },
    /// A stage begins.
    Started {
        /// The stage.
        stage: Stage,
        /// Why its results, if there are any, do not stand.
        reason: Reason,
    },
    /// A stage goes on.
    Progress {
        /// The stage.
        stage: Stage,
        /// Work done.
        done: u64,
        /// All work.
        total: u64,
        /// The state so far, as a phrase.
        note: String,
    },
    /// A stage has something to say that did not stop it.
    Warning {
        /// The stage.
        stage: Stage,
        /// Its code.
        code: String,
        /// The place and the fact.
        message: String,
        /// The file that it speaks of, where it is one of the user's.
        file: Option<PathBuf>,
    },
    /// A stage is done and its files are in place.
    Finished {
        /// The stage.
        stage: Stage,
        /// What it did, as a phrase.
        line: String,
        /// What it counted, by name.
        counts: BTreeMap<String, f64>,
        /// What it took.
        cost: Took,
    },
    /// Another run holds the folder; this one waits for it.
    Waiting {
        /// The run folder.
        out: PathBuf,
    },
    /// A stage has nothing to do: its results are in place.
    Kept {
        /// The stage.
        stage: Stage,
        /// What it did when they were made, as a phrase.
        line: String,
        /// What it counted then, by name.
        counts: BTreeMap<String, f64>,
    },
    /// A stage's results were taken from the store that runs share.
    Taken {
        /// The stage.
        stage: Stage,
        /// Why those in the folder, if there were any, did not stand.
        reason: Reason,
        /// What it did when they were made, as a phrase.
        line: String,
        /// What it counted then, by name.
        counts: BTreeMap<String, f64>,
    },
    /// The run is at its end.
    Ended {
        /// The run folder.
        out: PathBuf,
        /// The files that say most, relative to it.
        files: Vec<String>,
        /// The SHA-256 of `SHA256SUMS`.
        digest: String,
        /// How many crossings the embedding has; none where the run has not come to one.
        crossings: Option<u64>,
        /// How long it took.
        seconds: f64,
        /// The most memory that the program has held, in MB, where the system tells it.
        peak_mb: Option<f64>,
        /// Warnings of all stages.
        n_warnings: usize,
    },
    /// A combination of a sweep is done.
    Combination {
        /// Which, from 1.
        done: usize,
        /// How many there are.
        total: usize,
        /// Its settings, and what they came to, as a phrase.
        line: String,
    },
    /// The run stops with an error.
    Stopped {
        /// The stages whose results are in place.
        kept: Vec<Stage>,
        /// The run folder.
        out: PathBuf,
    },
}

/// A setting that is not at its default.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Setting {
    /// Its dotted key.
    pub key: String,
    /// Its value as TOML; of a file only that there is one.
    pub value: String,
    /// What it is where nobody says; none where it then has no value.
    pub default: Option<String>,
}

/// What a stage took. No result depends on it.
#[derive(Clone, Debug, PartialEq)]
pub struct Took {
    /// How long.
    pub seconds: f64,
    /// The most memory that the program has held until its end, in MB, where the system tells it.
    pub peak_mb: Option<f64>,
    /// The same of its parts, such as layout methods: name, seconds, memory.
    pub parts: Vec<(String, f64, Option<f64>)>,
}
