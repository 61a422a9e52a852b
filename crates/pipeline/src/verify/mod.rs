//! A folder of results held against itself: digests, formats, and every number computed again.
//!
//! | step | file | what |
//! |--:|---|---|
//! | 1 | `below` | the folders to look at: this one, or those of a cohort |
//! | 2 | `sums` | each file of `SHA256SUMS` is what it was, and what a stage has made is in it |
//! | 3 | `contents` | of a run, every number computed again; of all, the columns of tables |
//!
//! **Input** a run folder, as far as its run has come; the folder of a comparison, a sweep, a juxtaposition or a group; or a
//! folder that has such folders in it, as a cohort's has. **Output** one check per claim, by file.
//! **Guarantees** nothing is written, nothing is locked, nothing is taken over from the code that made the results. What a
//! file claims and is not so fails, be it that the file cannot be read at all; what a run has not come to is untested.

mod below;
mod contents;
mod sums;

use std::fs;
use std::path::{Path, PathBuf};

use espalier_model::diagnose::{Class, Diagnose};
use espalier_verify::{Check, Outcome, Value};
use serde::Serialize;
use thiserror::Error as ThisError;

use crate::error::Error;
use crate::folder::{DIGEST_FILE as SUMS, hex_digest, is_absent};
use crate::run;
use crate::settings::FILE as CONFIG;
use crate::stage::{Artifact, Stage};
use below::Found;

const NODES: &str = "nodes.tsv";
const COMPARE: &str = "compare.tsv";
const DICTIONARY: &str = "dictionary.tsv";

/// What became of each claim of a folder.
#[derive(Clone, Debug, PartialEq)]
pub struct Verification {
    /// The folder.
    pub folder: PathBuf,
    /// Each check with the file that makes the claim.
    pub checks: Vec<(String, Check)>,
    /// The SHA-256 of `SHA256SUMS`: what the run printed. Of several folders, one over theirs.
    pub digest: String,
}

impl Verification {
    /// How many checks came out so.
    #[must_use]
    pub fn n_of(&self, outcome: Outcome) -> usize {
        self.checks.iter().filter(|(_, check)| check.outcome == outcome).count()
    }

    /// Nothing, if no claim fails.
    ///
    /// # Errors
    /// [`Error::Unverified`] with the number of claims that do not hold, and the first of them.
    pub fn verdict(&self) -> Result<(), Error> {
        let first = self.checks.iter().find(|(_, check)| check.fails());
        first.map_or(Ok(()), |(file, check)| {
            Err(Error::Unverified {
                folder: self.folder.clone(),
                n_failed: self.n_of(Outcome::Fails),
                first: format!("{file}, {}: {}", check.name, check.found),
            })
        })
    }

    /// The whole as JSON, format `espalier-verification` version 1.
    #[must_use]
    pub fn to_json(&self) -> String {
        let number = |value: &Value| match value {
            Value::Number(number) => serde_json::Value::from(*number),
            Value::Count(count) => (*count).into(),
            Value::Text(text) => text.as_str().into(),
        };
        let record = VerificationRecord {
            format: "espalier-verification",
            version: 1,
            holds: self.n_of(Outcome::Fails) == 0,
            sha256_of_sums: &self.digest,
            checks: self
                .checks
                .iter()
                .map(|(file, check)| CheckRecord {
                    file,
                    name: &check.name,
                    outcome: check.outcome.name(),
                    stated: number(&check.stated),
                    found: number(&check.found),
                    tolerance: check.tolerance,
                })
                .collect(),
        };
        serde_json::to_string_pretty(&record).unwrap_or_default() + "\n"
    }
}

#[derive(Serialize)]
struct VerificationRecord<'a> {
    format: &'static str,
    version: u32,
    holds: bool,
    sha256_of_sums: &'a str,
    checks: Vec<CheckRecord<'a>>,
}

#[derive(Serialize)]
struct CheckRecord<'a> {
    file: &'a str,
    name: &'a str,
    outcome: &'static str,
    stated: serde_json::Value,
    found: serde_json::Value,
    tolerance: Option<f64>,
}

/// Why the list of a folder's results cannot be used.
#[derive(Debug, ThisError)]
enum Malformed {
    #[error("line {line} is no digest and file name: {text}")]
    Line { line: usize, text: String },
    #[error("there is no such file, so nothing vouches for the results")]
    Absent,
    #[error("it names no file")]
    Empty,
    #[error("no text: {0}")]
    Text(#[from] std::str::Utf8Error),
}

impl Diagnose for Malformed {
    fn code(&self) -> &'static str {
        "E-VERIFY-MALFORMED"
    }

    fn class(&self) -> Class {
        Class::Uncertified
    }

    fn hint(&self) -> String {
        "name a run folder, or a folder that has run folders in it; of a damaged one make the run again"
            .to_owned()
    }

    fn line(&self) -> Option<usize> {
        if let Self::Line { line, .. } = self { Some(*line) } else { None }
    }
}

/// Checks a folder of results, or all such folders in one.
///
/// # Errors
/// A folder or file that cannot be read though it is there, and a `SHA256SUMS` that is missing or malformed. Claims that do
/// not hold are no error here: see [`Verification::verdict`].
pub fn verify(folder: &Path, threads: Option<usize>) -> Result<Verification, Error> {
    run::in_pool(threads, || match below::find(folder)? {
        Found::Sealed => {
            let (checks, digest) = Folder(folder).verified()?;
            Ok(Verification { folder: folder.to_owned(), checks, digest })
        }
        Found::Below { sealed, unsealed, unfinished } => {
            let (mut checks, mut digests) = (Vec::new(), String::new());
            for name in sealed {
                let (of_folder, digest) = match Folder(&folder.join(&name)).verified() {
                    // The others are looked at all the same.
                    Err(Error::File { cause, .. }) if cause.code() == Malformed::Empty.code() => {
                        checks.push(unsealed_by(&name, cause.to_string()));
                        continue;
                    }
                    verified => verified?,
                };
                checks.extend(of_folder.into_iter().map(|(file, check)| (format!("{name}/{file}"), check)));
                digests += &format!("{digest}  {name}/{SUMS}\n");
            }
            let absent = |name: &String| unsealed_by(name, Malformed::Absent.to_string());
            checks.extend(unsealed.iter().map(absent));
            let why = "the run has not come to a result";
            checks.extend(unfinished.into_iter().map(|name| (name, Check::untested("results", "yes", why))));
            Ok(Verification { folder: folder.to_owned(), checks, digest: hex_digest(digests.as_bytes()) })
        }
    })
}

/// The claim of a folder among several whose list of results is missing or cannot be used.
fn unsealed_by(name: &str, fault: String) -> (String, Check) {
    (format!("{name}/{SUMS}"), Check::unless("sealed", "yes", Some(fault)))
}

/// A folder that has a `SHA256SUMS`.
struct Folder<'a>(&'a Path);

impl Folder<'_> {
    /// All checks, and the digest of `SHA256SUMS`.
    fn verified(&self) -> Result<(Vec<(String, Check)>, String), Error> {
        let sums = self.sums()?;
        let mut checks = sums.checks;
        self.check_contents(&sums.has, &mut checks)?;
        Ok((checks, sums.digest))
    }

    fn bytes(&self, file: &str) -> Result<Vec<u8>, Error> {
        let path = self.0.join(file);
        fs::read(&path).map_err(|source| Error::Read { path, source })
    }

    /// A file's text, or what is wrong with it; none where it cannot be read for reasons of the disk.
    fn text(&self, file: &str) -> Result<Result<String, String>, Error> {
        match self.bytes(file) {
            Err(Error::Read { source, .. }) if is_absent(&source) => Ok(Err("no such file".to_owned())),
            bytes => {
                Ok(String::from_utf8(bytes?).map_err(|error| format!("no text: {}", error.utf8_error())))
            }
        }
    }
}

/// What a folder claims to have.
struct Has {
    /// Whether it is a run's.
    is_run: bool,
    stages: Vec<Stage>,
    /// The tables in `SHA256SUMS`.
    tables: Vec<String>,
}

/// What the checks read of a stage's results, where it was done.
fn read_of(stage: Stage) -> Vec<&'static str> {
    match stage {
        Stage::Tree => vec![Artifact::Tree.file(), DICTIONARY],
        Stage::Views => vec![Artifact::Views.file()],
        Stage::Embed => {
            let [embedding, comparison] = [Artifact::Embedding, Artifact::Comparison].map(Artifact::file);
            vec![embedding, comparison, NODES, COMPARE, DICTIONARY]
        }
        _ => Vec::new(),
    }
}
