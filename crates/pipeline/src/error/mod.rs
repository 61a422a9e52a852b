//! What can go wrong in a run.
//!
//! | file | what it says of an error |
//! |---|---|
//! | this file | its kinds, each with what it knows, and the sentence that is shown |
//! | `codes` | its code and its class, hence the exit code |
//! | `hints` | the way out |
//! | `places` | the file and the line that are wrong |

mod codes;
mod hints;
mod places;

use std::io;
use std::path::{Path, PathBuf};

use espalier_model::diagnose::{Diagnose, ParamError};
use thiserror::Error;

use crate::config::ConfigError;
use crate::settings::Difference;
use crate::stage::{Artifact, Stage};

/// How many of the problems of a table are told at once.
const MOST_PROBLEMS: usize = 20;

/// Why a run stopped.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// The config is wrong.
    #[error(transparent)]
    Config(#[from] Box<ConfigError>),
    /// A stage refused its input or its parameters.
    #[error("{stage}: {cause}")]
    Stage {
        /// The stage.
        stage: Stage,
        /// What it said.
        cause: Box<dyn Diagnose + Send + Sync>,
    },
    /// A stage file cannot be used.
    #[error("{path}: {cause}", path = path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        cause: Box<dyn Diagnose + Send + Sync>,
    },
    /// A stage needs a file that is not there.
    #[error("{stage} needs the {what}, but there is no {path}", what = artifact.what(), path = path.display())]
    MissingArtifact {
        /// The stage.
        stage: Stage,
        /// What it needs.
        artifact: Artifact,
        /// Where it was looked for.
        path: PathBuf,
    },
    /// A stage file is not the one that the run wrote.
    #[error("{path} is not what this run folder's SHA256SUMS says", path = path.display())]
    Altered {
        /// The file.
        path: PathBuf,
    },
    /// A folder that is to be compared holds no run.
    #[error("{folder} holds no run with an embedding: there is no {missing}", folder = folder.display())]
    NoRun {
        /// The folder.
        folder: PathBuf,
        /// The file that is not there.
        missing: &'static str,
    },
    /// A table of scans that cannot be used.
    #[error("{path}: {}", listed(problems), path = path.display())]
    Samples {
        /// The table.
        path: PathBuf,
        /// What is wrong with it, each with its line.
        problems: Vec<String>,
    },
    /// A scan that is not in the table.
    #[error("there is no scan {id} in the table")]
    NoSample {
        /// The id asked for.
        id: String,
    },
    /// Scans of a cohort that failed.
    #[error("{n_failed} of {n_samples} scans failed; the first: {first} ({})", cause.code())]
    Cohort {
        /// How many failed.
        n_failed: usize,
        /// How many there are.
        n_samples: usize,
        /// The first of them.
        first: String,
        /// Why that one failed.
        cause: Box<Error>,
    },
    /// A BIDS data set that is not one.
    #[error("{path}: {problem}", path = path.display())]
    BidsDataset {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// Results would lie in a data set of another program.
    #[error("{folder} holds a data set that espalier did not make", folder = folder.display())]
    BidsOutput {
        /// The folder.
        folder: PathBuf,
    },
    /// Volumes of several kinds.
    #[error("the data set has volumes of several kinds: {suffixes}")]
    BidsSuffix {
        /// Their suffixes, and how many have each.
        suffixes: String,
    },
    /// A data set without a volume that is meant.
    #[error("{folder} has no volume that is meant: suffix {suffix}{filters}", folder = folder.display())]
    NoBidsScan {
        /// The data set.
        folder: PathBuf,
        /// The suffix.
        suffix: String,
        /// The other conditions.
        filters: String,
    },
    /// A participant or session that is not there.
    #[error("there is no {what} {label}; there are {there}")]
    NoBidsLabel {
        /// `participant` or `session`.
        what: &'static str,
        /// The label asked for.
        label: String,
        /// The labels there are.
        there: String,
    },
    /// None of the folders of a group holds a run.
    #[error("{} holds no run folder", shown(folders))]
    NoGroup {
        /// The folders.
        folders: Vec<PathBuf>,
    },
    /// More runs than a page may have.
    #[error("the group has {n_runs} runs, allowed are {limit}")]
    GroupSize {
        /// How many there are.
        n_runs: usize,
        /// How many there may be.
        limit: usize,
    },
    /// Results would be written among those of a run.
    #[error("{folder} is a run folder; its own results would be overwritten", folder = folder.display())]
    RunInTheWay {
        /// The folder.
        folder: PathBuf,
    },
    /// A key that no result of a sweep depends on, or that is given twice.
    #[error("--over {key}: {reason}", reason = reason.text())]
    NotSwept {
        /// The key.
        key: String,
        /// Why not.
        reason: NotSwept,
    },
    /// More combinations than a sweep may have.
    #[error("the sweep has {n_combinations} combinations, allowed are {limit}")]
    SweepSize {
        /// How many there are.
        n_combinations: u64,
        /// How many there may be.
        limit: u64,
    },
    /// A setting that cannot be changed after the fact.
    #[error("--set {key}: {folder} was made with other settings already", folder = folder.display())]
    Settled {
        /// The key.
        key: String,
        /// The run folder.
        folder: PathBuf,
    },
    /// A setting that a finished run's tree depends on.
    #[error("--set {key}: the tree of {folder} was made with other settings already", folder = folder.display())]
    SettledTree {
        /// The key.
        key: String,
        /// The run folder.
        folder: PathBuf,
    },
    /// A folder without a tree to compare.
    #[error("{folder} holds no tree of a run: {missing} is missing", folder = folder.display())]
    NoTree {
        /// The folder.
        folder: PathBuf,
        /// The file that is not there.
        missing: &'static str,
    },
    /// An embedding whose certificate does not hold.
    #[error("{path} states {stated} crossings, its coordinates have {found}", path = path.display())]
    Certificate {
        /// The file.
        path: PathBuf,
        /// The crossings that the file states.
        stated: usize,
        /// The crossings of its coordinates.
        found: usize,
    },
    /// Claims of a run folder that do not hold.
    #[error("{folder}: {n_failed} of its claims do not hold; the first: {first}", folder = folder.display())]
    Unverified {
        /// The run folder.
        folder: PathBuf,
        /// How many claims do not hold.
        n_failed: usize,
        /// The first of them.
        first: String,
    },
    /// A node or branch that the tree does not have.
    #[error("there is no {what} {index}: the tree has {n_there}, counted from 0")]
    NoSuchPlace {
        /// `node` or `branch`.
        what: &'static str,
        /// The index asked for.
        index: usize,
        /// How many there are.
        n_there: usize,
    },
    /// A plot in a format that there is not.
    #[error("--plot {path}: a plot is an .svg or a .png", path = path.display())]
    PlotFormat {
        /// The file asked for.
        path: PathBuf,
    },
    /// A file that would be written over a result of a run.
    #[error("{path} is a result of the run, which would be overwritten", path = path.display())]
    ResultInTheWay {
        /// The file asked for.
        path: PathBuf,
    },
    /// An input that a result would be written over.
    #[error("{path} is the input, and a result of that name would take its place", path = path.display())]
    InputInTheWay {
        /// The input.
        path: PathBuf,
    },
    /// A file that no run has made, and that the run would write over, or remove as a result that does not hold any more.
    #[error("{path} was not made by a run here, and would give way: it has the name of a result", path = path.display())]
    FileInTheWay {
        /// The file.
        path: PathBuf,
    },
    /// A folder where a result should go.
    #[error("{path} is a folder, and a result of that name is to be written", path = path.display())]
    FolderInTheWay {
        /// The folder.
        path: PathBuf,
    },
    /// A text that is no point.
    #[error("{source_name}{cause}", source_name = source_name.as_ref().map(|name| format!("{name}: ")).unwrap_or_default())]
    Point {
        /// The file that has it; none for an argument.
        source_name: Option<String>,
        /// What is wrong.
        cause: crate::locate::PointError,
    },
    /// Points in a space that a run does not have.
    #[error("{option}: {why}")]
    NoSuchSpace {
        /// The option.
        option: &'static str,
        /// Why not.
        why: &'static str,
    },
    /// A stage that this input does not pass through was asked for.
    #[error("--{flag} {stage}: a run from this input has no such stage; it has {available}")]
    NoSuchStage {
        /// `from` or `to`.
        flag: &'static str,
        /// The stage asked for.
        stage: Stage,
        /// The stages there are.
        available: String,
    },
    /// The input cannot be told.
    #[error("input.{cause}")]
    Input {
        /// The key and what is wrong.
        cause: ParamError,
    },
    /// `--from` would build on results made with other settings.
    #[error(
        "--from {from} builds on what is there, but {key} is {wanted} now, and {stage} was done with {kept}",
        key = difference.key, wanted = difference.wanted, kept = difference.kept, stage = difference.stage
    )]
    OtherSettings {
        /// The first stage to do.
        from: Stage,
        /// The setting.
        difference: Box<Difference>,
    },
    /// `--from` would build on results of another input.
    #[error("--from {from} builds on what is there, which was not made from {path}", path = path.display())]
    OtherInput {
        /// The first stage to do.
        from: Stage,
        /// The input now.
        path: PathBuf,
        /// The first stage of a run from it.
        first: Stage,
    },
    /// `--from` lies behind `--to`.
    #[error("--from {from} comes after --to {to}")]
    EmptyRange {
        /// First stage asked for.
        from: Stage,
        /// Last stage asked for.
        to: Stage,
    },
    /// Reading failed.
    #[error("cannot read {path}: {source}", path = path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A file is larger than the memory allowed.
    #[error("{path} has {needed} bytes, allowed are {limit}", path = path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its size in bytes.
        needed: u64,
        /// The most that reading a file may take, in bytes.
        limit: u64,
    },
    /// A stage would take more memory than allowed.
    #[error("{stage} would take about {needed} bytes of memory, allowed are {limit}")]
    Memory {
        /// The stage.
        stage: Stage,
        /// What it would take, in bytes.
        needed: u64,
        /// What it may take, in bytes.
        limit: u64,
    },
    /// An output cannot be created.
    #[error("cannot create {path}: {source}", path = path.display())]
    Create {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Writing failed.
    #[error("cannot write {path}: {source}", path = path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Results cannot be printed.
    #[error("cannot print results: {source}")]
    Print {
        /// What the system said.
        source: io::Error,
    },
    /// Another run holds the folder.
    #[error("another run is at work in {folder}", folder = folder.display())]
    Locked {
        /// The run folder.
        folder: PathBuf,
    },
    /// A code that there is not.
    #[error("there is no code {code}")]
    UnknownCode {
        /// What was asked for.
        code: String,
        /// Codes like it.
        nearest: Vec<String>,
    },
    /// A key that no config has.
    #[error("there is no key {key}")]
    UnknownKey {
        /// What was asked for.
        key: String,
        /// Keys like it.
        nearest: Vec<String>,
    },
    /// The threads cannot be started.
    #[error("cannot start {threads} threads: {message}")]
    Threads {
        /// How many.
        threads: usize,
        /// What the pool said.
        message: String,
    },
}

/// Why a key is not swept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotSwept {
    /// It only concerns pictures or names.
    Ineffective,
    /// It is there already.
    Twice,
    /// It has no values.
    Empty,
}

impl NotSwept {
    fn text(self) -> &'static str {
        match self {
            Self::Ineffective => "no embedding depends on it",
            Self::Twice => "is given twice",
            Self::Empty => "has no values",
        }
    }
}

/// A few folders, and how many more.
fn shown(folders: &[PathBuf]) -> String {
    let named: Vec<String> = folders.iter().take(3).map(|folder| folder.display().to_string()).collect();
    let more = folders.len().saturating_sub(3);
    if more > 0 { format!("none of {} and {more} more", named.join(", ")) } else { named.join(" or ") }
}

/// The first of many things that are wrong, a line each.
fn listed(problems: &[String]) -> String {
    let mut lines = problems.iter().take(MOST_PROBLEMS).cloned().collect::<Vec<_>>();
    if problems.len() > MOST_PROBLEMS {
        lines.push(format!("and {} more", problems.len() - MOST_PROBLEMS));
    }
    lines.join("\n  ")
}

impl Error {
    pub(crate) fn stage(stage: Stage) -> impl Fn(Box<dyn Diagnose + Send + Sync>) -> Self {
        move |cause| Self::Stage { stage, cause }
    }

    pub(crate) fn file(path: &Path, cause: impl Diagnose + Send + Sync + 'static) -> Self {
        Self::File { path: path.to_owned(), cause: Box::new(cause) }
    }
}
