//! A run folder held against itself: digests, formats, and every number computed again.
//!
//! **Input** a run folder that is done with its embed stage. **Output** one check per claim, by file.
//! **Steps** 1. `SHA256SUMS`: each file in it is there and is what it was, and what is read below or was made by a stage is in it. 2. Read
//! what the checks need, as strangers' files. 3. `espalier_verify` on what was read.
//! **Guarantees** nothing is written, nothing is locked, nothing is taken over from the code that made the results.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Component, Path, PathBuf};

use espalier_embed::CrossingWeight;
use espalier_model::diagnose::{Class, Diagnose};
use espalier_model::{Comparison, Embedding, FileError, ViewHierarchy, swc};
use espalier_verify::{
    Check, Claim, Outcome, Rule, Value, Weights, check_compare_table, check_comparison, check_embedding,
    check_header, check_nodes_table,
};
use serde::Serialize;
use thiserror::Error as ThisError;

use crate::config::Config;
use crate::error::Error;
use crate::folder::{file_digest, hex_digest, is_absent};
use crate::record::Record;
use crate::run;
use crate::stage::{Artifact, Stage};

const SUMS: &str = "SHA256SUMS";
const CONFIG: &str = "provenance/config.resolved.toml";
const NODES: &str = "nodes.tsv";
const COMPARE: &str = "compare.tsv";
const DICTIONARY: &str = "dictionary.tsv";
/// What the checks read beside those.
const CHECKED: [Artifact; 4] = [Artifact::Tree, Artifact::Views, Artifact::Embedding, Artifact::Comparison];

/// What became of each claim of a run folder.
#[derive(Clone, Debug, PartialEq)]
pub struct Verification {
    /// The run folder.
    pub folder: PathBuf,
    /// Each check with the file that makes the claim.
    pub checks: Vec<(String, Check)>,
    /// The SHA-256 of `SHA256SUMS`: what the run printed.
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

/// Why a file of a run folder cannot be read as what it should be.
#[derive(Debug, ThisError)]
enum Malformed {
    #[error("line {line} is no digest and file name: {text}")]
    Sums { line: usize, text: String },
    #[error("no text: {0}")]
    Text(#[from] std::str::Utf8Error),
    #[error("no config of this version: {0}")]
    Config(String),
}

impl Diagnose for Malformed {
    fn code(&self) -> &'static str {
        "E-VERIFY-MALFORMED"
    }

    fn class(&self) -> Class {
        Class::Input
    }
}

/// Checks a run folder.
///
/// # Errors
/// A file that is missing or cannot be read, or that is malformed although its digest is right. Claims that do not
/// hold are no error here: see [`Verification::verdict`].
pub fn verify(folder: &Path, threads: Option<usize>) -> Result<Verification, Error> {
    run::in_pool(threads, || {
        let folder = Folder(folder);
        let (mut checks, digest) = folder.check_digests()?;
        let is_altered = checks.iter().any(|(_, check)| check.fails());
        let tables: Vec<String> =
            checks.iter().map(|(file, _)| file).filter(|file| is_table(file)).cloned().collect();
        match folder.check_contents().and_then(|mut contents| {
            contents.extend(folder.check_headers(&tables)?);
            Ok(contents)
        }) {
            Ok(contents) => checks.extend(contents),
            // What was altered since may well be unreadable; that it was altered is the finding.
            Err(Error::File { path, cause }) if is_altered => checks.push(folder.unreadable(&path, &cause)),
            Err(Error::Read { path, source }) if is_altered => checks.push(folder.unreadable(&path, &source)),
            Err(error) => return Err(error),
        }
        Ok(Verification { folder: folder.0.to_owned(), checks, digest })
    })
}

struct Folder<'a>(&'a Path);

impl Folder<'_> {
    fn bytes(&self, file: &str) -> Result<Vec<u8>, Error> {
        let path = self.0.join(file);
        fs::read(&path).map_err(|source| Error::Read { path, source })
    }

    fn text(&self, file: &str) -> Result<String, Error> {
        let bytes = self.bytes(file)?;
        String::from_utf8(bytes).map_err(|error| self.malformed(file, error.utf8_error().into()))
    }

    fn unreadable(&self, path: &Path, cause: &dyn std::fmt::Display) -> (String, Check) {
        let file = path.strip_prefix(self.0).unwrap_or(path).display().to_string();
        (file, Check::unless("readable", "yes", Some(cause.to_string())))
    }

    fn malformed(&self, file: &str, cause: Malformed) -> Error {
        Error::file(&self.0.join(file), cause)
    }

    /// Every file of `SHA256SUMS`, what ought to be in it, and the digest of that file itself.
    fn check_digests(&self) -> Result<(Vec<(String, Check)>, String), Error> {
        let text = self.text(SUMS)?;
        let mut checks = Vec::new();
        for (idx, line) in text.lines().enumerate() {
            let (digest, file) = digest_line(line).ok_or_else(|| {
                self.malformed(SUMS, Malformed::Sums { line: idx + 1, text: line.chars().take(80).collect() })
            })?;
            let path = self.0.join(file);
            let found = match file_digest(&path) {
                Ok((_, found)) => found,
                Err(source) if is_absent(&source) => "no such file".to_owned(),
                Err(source) => return Err(Error::Read { path, source }),
            };
            checks.push((file.to_owned(), Check::same("sha256", digest, found)));
        }
        let checked =
            CHECKED.map(|artifact| artifact.file()).into_iter().chain([NODES, COMPARE, DICTIONARY, CONFIG]);
        let mut expected: BTreeSet<String> = checked.map(str::to_owned).collect();
        expected.extend(self.made_by_stages());
        for file in expected {
            if !checks.iter().any(|(listed, _)| *listed == file) {
                let fault = Some("no line in SHA256SUMS".to_owned());
                checks.push((file, Check::unless("sealed", "yes", fault)));
            }
        }
        Ok((checks, hex_digest(text.as_bytes())))
    }

    /// What the records of the stages name, and the records.
    fn made_by_stages(&self) -> Vec<String> {
        let made = |stage: Stage| {
            let record_file = Record::file_of(stage);
            let record = Record::parsed(stage, &self.bytes(&record_file).ok()?)?;
            Some(record.files().keys().cloned().chain([record_file]).collect::<Vec<_>>())
        };
        Stage::ALL.into_iter().filter_map(made).flatten().collect()
    }

    /// Everything that can be computed again.
    fn check_contents(&self) -> Result<Vec<(String, Check)>, Error> {
        let config = self.config()?;
        let tree_file = Artifact::Tree.file();
        let tree = swc::read_tree(&self.text(tree_file)?)
            .map_err(|error| Error::file(&self.0.join(tree_file), error))?;
        let mut checks = Vec::new();
        let views =
            self.of_tree(Artifact::Views, &mut checks, |text| ViewHierarchy::from_json(text, &tree))?;
        let embedding =
            self.of_tree(Artifact::Embedding, &mut checks, |text| Embedding::from_json(text, &tree))?;
        let comparison =
            self.of_tree(Artifact::Comparison, &mut checks, |text| Comparison::from_json(text, &tree))?;
        let (Some(embedding), Some(views)) = (embedding, views) else { return Ok(checks) };

        let weights = weights(&config);
        let must_be_best = config.embed.method.is_optimiser();
        let claim = Claim {
            tree: &tree,
            views: Some(&views),
            embedding: &embedding,
            weights: &weights,
            must_be_best,
        };
        let of = |file: &str, found: Vec<Check>| {
            found.into_iter().map(|check| (file.to_owned(), check)).collect::<Vec<_>>()
        };
        checks.extend(of(Artifact::Embedding.file(), check_embedding(&claim)));
        if let Some(comparison) = &comparison {
            checks.extend(of(Artifact::Comparison.file(), check_comparison(&claim, comparison)));
        }
        checks.extend(of(NODES, vec![check_nodes_table(&self.text(NODES)?, &tree, &embedding)]));
        checks.extend(of(COMPARE, vec![check_compare_table(&self.text(COMPARE)?, &embedding.methods)]));
        let seed = usize::try_from(config.seed).unwrap_or(usize::MAX);
        let embedded = usize::try_from(embedding.seed).unwrap_or(usize::MAX);
        checks.extend(of(CONFIG, vec![Check::same("seed", seed, embedded)]));
        Ok(checks)
    }

    /// The columns of each sealed table, and of the times beside them, against the dictionary.
    fn check_headers(&self, tables: &[String]) -> Result<Vec<(String, Check)>, Error> {
        let dictionary = self.text(DICTIONARY)?;
        let check = |file: &String| {
            let name = Path::new(file).file_name().and_then(|name| name.to_str()).unwrap_or(file);
            let text = String::from_utf8_lossy(&self.bytes(file)?).into_owned();
            Ok((file.clone(), check_header(&dictionary, &[file, name], &text)))
        };
        tables.iter().map(check).collect()
    }

    fn config(&self) -> Result<Config, Error> {
        let text = self.text(CONFIG)?;
        Config::parse(&text, Path::new(CONFIG), &[])
            .map_err(|error| self.malformed(CONFIG, Malformed::Config(error.to_string())))
    }

    /// What a file says of the tree; nothing, and a check that fails, if it was made for another tree.
    fn of_tree<T>(
        &self,
        artifact: Artifact,
        checks: &mut Vec<(String, Check)>,
        parse: impl FnOnce(&str) -> Result<T, FileError>,
    ) -> Result<Option<T>, Error> {
        let file = artifact.file();
        match parse(&self.text(file)?) {
            Ok(parsed) => Ok(Some(parsed)),
            Err(FileError::OtherTree { found, expected, .. }) => {
                checks.push((file.to_owned(), Check::same("tree", found, expected)));
                Ok(None)
            }
            Err(error) => Err(Error::file(&self.0.join(file), error)),
        }
    }
}

/// Whether a file is a table that the dictionary has to explain: not itself.
fn is_table(file: &str) -> bool {
    Path::new(file).extension().is_some_and(|extension| extension == "tsv") && file != DICTIONARY
}

/// A line of `SHA256SUMS`; no file outside of the folder is anyone's business.
fn digest_line(line: &str) -> Option<(&str, &str)> {
    let (digest, file) = line.split_once("  ")?;
    let is_digest = digest.len() == 64 && digest.bytes().all(|byte| byte.is_ascii_hexdigit());
    let is_inside = Path::new(file).components().all(|part| matches!(part, Component::Normal(_)));
    (is_digest && is_inside && !file.is_empty()).then_some((digest, file))
}

/// The weights of the energy in the checker's terms.
fn weights(config: &Config) -> Weights {
    let params = &config.embed;
    let rule = |rule: &espalier_embed::WeightRule| Rule {
        generations: rule.generations.map(|[first, last]| (first, last)),
        depth_mm: rule.depth_mm.map(|[least, most]| (least, most)),
        branches: rule.branches.clone(),
        nodes: rule.nodes.clone(),
        length: rule.w_length,
        angle: rule.w_angle,
    };
    Weights {
        length: params.w_length,
        angle: params.w_angle,
        side: params.w_side,
        placement: params.w_placement,
        crossing: match params.w_crossing {
            CrossingWeight::Auto => None,
            CrossingWeight::Fixed(weight) => Some(weight),
        },
        rules: params.weights.iter().map(rule).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_sums() {
        let digest = "0123456789abcdef".repeat(4);
        assert_eq!(digest_line(&format!("{digest}  a/b c.tsv")), Some((digest.as_str(), "a/b c.tsv")));
        for file in ["/etc/passwd", "../other/tree.swc", "a/../../b", ""] {
            assert_eq!(digest_line(&format!("{digest}  {file}")), None, "{file}");
        }
        assert_eq!(digest_line("short  tree.swc"), None);
    }
}
