//! What a run tells its caller while it goes on.

use std::path::PathBuf;

use crate::stage::Stage;

/// Something that happened in a run.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Event {
    /// A stage begins.
    Started {
        /// The stage.
        stage: Stage,
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
    },
    /// A stage is done and its files are in place.
    Finished {
        /// The stage.
        stage: Stage,
        /// How long it took.
        seconds: f64,
        /// What it did, as a phrase.
        line: String,
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
    },
    /// A stage's results were taken from the store that runs share.
    Taken {
        /// The stage.
        stage: Stage,
        /// What it did when they were made, as a phrase.
        line: String,
    },
    /// The run is at its end.
    Ended {
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
