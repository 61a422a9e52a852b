//! Why a run stopped, for those who look at many runs later: `provenance/failure.json`.
//!
//! **Input** the error, the stage, the paths of the run. **Output** a file beside the results of the stages that were done,
//! which no digest covers; gone when the next run begins.
//! **Guarantees** the reason holds no path of this machine and no name of a file beside the input: they may be a patient's.

use std::path::Path;

use serde::{Deserialize, Serialize};

use espalier_model::Diagnose;
use espalier_model::diagnose::Class;

use crate::error::Error;
use crate::folder::RunFolder;

const FILE: &str = "provenance/failure.json";
const FORMAT: &str = "espalier-failure";
const VERSION: u32 = 1;
/// What stands for a name.
const HIDDEN: &str = "…";
/// Names in a folder that are looked for.
const MOST_NAMES: usize = 10_000;
/// Bytes of a reason.
const MOST_LETTERS: usize = 500;

/// Why a run stopped.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Failure {
    format: String,
    version: u32,
    /// The stage that failed, if it was one.
    pub(crate) stage: Option<String>,
    /// The code of the error.
    pub(crate) code: String,
    /// What it said.
    pub(crate) reason: String,
}

/// Notes why a run stopped. A folder that cannot be written to has other troubles.
pub(crate) fn write(folder: &RunFolder, error: &Error, input: Option<&Path>) {
    // A command that asks for what cannot be says nothing of the results that are there.
    if !folder.path().exists() || matches!(error.class(), Class::Usage | Class::Locked) {
        return;
    }
    let (stage, message) = match error {
        Error::Stage { stage, cause } => (Some(stage), cause.to_string()),
        other => (None, other.to_string()),
    };
    let failure = Failure {
        format: FORMAT.to_owned(),
        version: VERSION,
        stage: stage.map(|stage| stage.name().to_owned()),
        code: error.code().to_owned(),
        reason: without_names(message.lines().next().unwrap_or_default(), folder.path(), input),
    };
    let json = serde_json::to_string_pretty(&failure).unwrap_or_default() + "\n";
    let _ = folder.write_aside(FILE, json.as_bytes());
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

/// A message without paths and names of files of the user's.
fn without_names(message: &str, folder: &Path, input: Option<&Path>) -> String {
    let mut names: Vec<String> = Vec::new();
    for path in [Some(folder), input].into_iter().flatten() {
        let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        names.extend([path, absolute.as_path()].map(|path| path.display().to_string()));
    }
    if let Some(input) = input {
        names.extend(input.file_name().map(|name| name.to_string_lossy().into_owned()));
        for place in [Some(input), input.parent()].into_iter().flatten() {
            let place = if place.as_os_str().is_empty() { Path::new(".") } else { place };
            let entries = std::fs::read_dir(place).into_iter().flatten().flatten().take(MOST_NAMES);
            names.extend(entries.map(|entry| entry.file_name().to_string_lossy().into_owned()));
        }
    }
    names.retain(|name| name.len() > 2);
    // The longest first, so that no part of a name is left over.
    names.sort_by(|a, b| b.len().cmp(&a.len()).then_with(|| a.cmp(b)));
    let hidden = names.iter().fold(message.to_owned(), |text, name| text.replace(name, HIDDEN));
    let is_path = |word: &str| word.contains('\\') || word.starts_with('/') || word.matches('/').count() > 1;
    let words = hidden.split(' ').map(|word| if is_path(word) { HIDDEN } else { word });
    words.collect::<Vec<_>>().join(" ").chars().take(MOST_LETTERS).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_path_is_left_in_a_reason() {
        let said = |message: &str, input: &str| {
            without_names(message, Path::new("out/DOE^JANE"), Some(Path::new(input)))
        };
        assert_eq!(said("cannot read data/DOE^JANE.nii: gone", "data/DOE^JANE.nii"), "cannot read …: gone");
        assert_eq!(
            said("DOE^JANE.nii: no voxel of 3 mm/px is left", "data/DOE^JANE.nii"),
            "…: no voxel of 3 mm/px is left"
        );
        assert_eq!(said("cannot write /home/jane/out/x.json now", "a.nii"), "cannot write … now");
        assert_eq!(said("cannot write C:\\jane\\x", "a.nii"), "cannot write …");
        assert_eq!(said("the mask is empty", "mask.nii"), "the mask is empty");
    }
}
