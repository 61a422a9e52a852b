//! The command that does one scan alone: as it would be typed, and as a page may show it that is given away.
//!
//! **Guarantees** it has the settings and options of the call that it was made in, so that it does what that call would;
//! `--force` is not repeated: what stages that were done have left is kept.

use std::path::{Path, PathBuf};

use super::configure::{is_path, text_of};
use crate::config::Override;
use crate::shell;

/// A command in both forms.
#[derive(Clone, Debug)]
pub(crate) struct Retry {
    /// With paths as they were typed.
    pub(crate) typed: String,
    /// With the names alone of paths that begin at the root or go upwards.
    pub(crate) shown: String,
}

/// A part of an option of the command line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Word {
    /// As it is.
    Text(String),
    /// A path, of which a page shows only the name where it begins at the root.
    Path(PathBuf),
}

impl Retry {
    /// The command of these words; the function that they are given writes a path.
    pub(crate) fn of(words: impl Fn(&dyn Fn(&Path) -> String) -> Vec<String>) -> Self {
        let typed = words(&|path: &Path| path.to_string_lossy().into_owned()).join(" ");
        Self { typed, shown: words(&shell::shown).join(" ") }
    }

    /// A text as one word of a shell.
    pub(crate) fn word(text: &str) -> String {
        shell::word(text)
    }

    /// Settings of the command line; paths among them as they are to be written.
    pub(crate) fn settings(overrides: &[Override], path: &dyn Fn(&Path) -> String) -> Vec<String> {
        let value = |set: &Override| {
            if is_path(set) { path(Path::new(&text_of(&set.value))) } else { set.value.clone() }
        };
        let words = |set: &Override| format!("--set {}", shell::word(&format!("{}={}", set.key, value(set))));
        overrides.iter().map(words).collect()
    }

    /// Options that no result depends on.
    pub(crate) fn options(options: &[Word], path: &dyn Fn(&Path) -> String) -> Vec<String> {
        let word = |word: &Word| match word {
            Word::Text(text) => shell::word(text),
            Word::Path(file) => shell::word(&path(file)),
        };
        options.iter().map(word).collect()
    }
}
