//! Where the data is, and what a file comes to, for tests of readers.
#![allow(
    dead_code,
    clippy::panic,
    clippy::print_stdout,
    reason = "each test file uses its part, and speaks like this"
)]
#![allow(clippy::disallowed_methods, reason = "tests find their data through the environment")]

use std::path::{Path, PathBuf};

use espalier_model::Diagnose;
use espalier_volume::{Loaded, ReadOptions, read};

pub(crate) fn data() -> Option<PathBuf> {
    let folder = std::env::var_os("ESPALIER_DATA").map(PathBuf::from);
    if folder.is_none() {
        println!("skipped: ESPALIER_DATA not set");
    }
    folder
}

pub(crate) fn load(path: &Path, options: &ReadOptions) -> Loaded {
    read(path, options).unwrap_or_else(|error| panic!("{error}"))
}

/// `shape orientation warnings`, or the error's code and exit code.
pub(crate) fn outcome(path: &Path, options: &ReadOptions) -> String {
    match read(path, options) {
        Ok(loaded) => {
            let grid = loaded.volume.grid();
            let [nx, ny, nz] = grid.shape();
            let warnings = loaded.report.warnings.iter().map(|warning| warning.code);
            let words = [format!("{nx}x{ny}x{nz}"), grid.orientation()];
            words.into_iter().chain(warnings.map(str::to_owned)).collect::<Vec<_>>().join(" ")
        }
        Err(error) => {
            assert!(!error.hint().is_empty(), "{error} has no way out");
            let place = path.display().to_string();
            assert!(error.to_string().ends_with(&place), "{error} does not end with the path");
            format!("{} {}", error.code(), error.class().exit_code())
        }
    }
}
