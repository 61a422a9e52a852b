//! Why a run stopped, for those who look at many runs later: `provenance/failure.json`.
//!
//! **Input** the error. **Output** a file beside the results of the stages that were done, which no digest covers; gone when
//! the next run begins.
//! **Guarantees** stage, code and a sentence for the kind of error, no word of the message: it may quote names of files, or
//! the input itself, and both may be a patient's. The same command tells the rest.

use std::path::Path;

use serde::{Deserialize, Serialize};

use espalier_model::Diagnose;
use espalier_model::diagnose::Class;

use crate::error::Error;
use crate::explain::explain;
use crate::folder::RunFolder;

pub(crate) const FILE: &str = "provenance/failure.json";
const FORMAT: &str = "espalier-failure";
const VERSION: u32 = 1;

/// Why a run stopped.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Failure {
    format: String,
    version: u32,
    /// The stage that failed, if it was one.
    pub(crate) stage: Option<String>,
    /// The code of the error.
    pub(crate) code: String,
    /// What kind of error it is.
    pub(crate) reason: String,
}

/// Notes why a run stopped.
pub(crate) fn write(folder: &RunFolder, error: &Error) {
    // A command that asks for what cannot be says nothing of the results that are there; where there are none, nor was a
    // run before, the folder is somebody else's.
    let is_in_the_way = matches!(error, Error::FileInTheWay { .. } | Error::FolderInTheWay { .. });
    let is_strange = is_in_the_way && !folder.path().join("provenance").is_dir();
    if !matches!(error.class(), Class::Usage | Class::Locked) && !is_strange {
        note(folder, error);
    }
}

/// Notes why a run stopped that its cohort waits for, whatever the reason. A folder that cannot be written to has other
/// troubles.
pub(crate) fn note(folder: &RunFolder, error: &Error) {
    let stage = if let Error::Stage { stage, .. } = error { Some(stage.name().to_owned()) } else { None };
    let failure = Failure {
        format: FORMAT.to_owned(),
        version: VERSION,
        stage,
        code: error.code().to_owned(),
        reason: reason(error),
    };
    let json = serde_json::to_string_pretty(&failure).unwrap_or_default() + "\n";
    let _ = folder.write_aside(FILE, json.as_bytes());
}

/// What the code stands for in the catalogue, else what its class has in common. The message itself may quote the input.
fn reason(error: &Error) -> String {
    let of_code = explain(error.code()).map(|entry| entry.title().to_owned());
    of_code.unwrap_or_else(|_| error.class().meaning().to_owned())
}

/// Forgets why an earlier run stopped.
pub(crate) fn clear(folder: &RunFolder) {
    let _ = std::fs::remove_file(folder.path().join(FILE));
}

/// Why the last run of a folder stopped, if it did and had time to say so.
pub(crate) fn read(folder: &Path) -> Option<Failure> {
    let text = std::fs::read_to_string(folder.join(FILE)).ok()?;
    let failure: Failure = serde_json::from_str(&text).ok()?;
    (failure.format == FORMAT && failure.version == VERSION).then_some(failure)
}
