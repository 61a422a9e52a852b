//! What can go wrong in a run.

use std::io;
use std::path::{Path, PathBuf};

use espalier_model::diagnose::{Class, Diagnose, ParamError};
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
    /// A file that no run has made, and that a result would be written over.
    #[error("{path} was not made by a run here, and a result of that name would take its place", path = path.display())]
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

impl Diagnose for Error {
    fn code(&self) -> &'static str {
        match self {
            Self::Config(error) => error.code(),
            Self::Stage { cause, .. } | Self::File { cause, .. } => cause.code(),
            Self::MissingArtifact { .. } => "E-RUN-MISSING-FILE",
            Self::NoSuchPlace { .. } => "E-PROFILE-PLACE",
            Self::PlotFormat { .. } | Self::ResultInTheWay { .. } => "E-PROFILE-PLOT",
            Self::InputInTheWay { .. } => "E-RUN-INPUT-IN-WAY",
            Self::FileInTheWay { .. } | Self::FolderInTheWay { .. } => "E-RUN-IN-WAY",
            Self::Point { cause, .. } => cause.code(),
            Self::NoSuchSpace { .. } => "E-LOCATE-SPACE",
            Self::NoRun { .. } => "E-COMPARE-NO-RUN",
            Self::Samples { .. } => "E-COHORT-TABLE",
            Self::NoSample { .. } => "E-COHORT-NO-SCAN",
            Self::Cohort { .. } => "E-COHORT-FAILED",
            Self::BidsDataset { .. } => "E-BIDS-DATASET",
            Self::BidsOutput { .. } => "E-BIDS-OUTPUT",
            Self::BidsSuffix { .. } => "E-BIDS-SUFFIX",
            Self::NoBidsScan { .. } => "E-BIDS-NO-SCAN",
            Self::NoBidsLabel { .. } => "E-BIDS-LABEL",
            Self::NoGroup { .. } => "E-GROUP-NO-RUN",
            Self::GroupSize { .. } => "E-GROUP-SIZE",
            Self::RunInTheWay { .. } => "E-COMPARE-FOLDER",
            Self::Settled { .. } => "E-COMPARE-SETTINGS",
            Self::SettledTree { .. } => "E-JUXTAPOSE-SETTINGS",
            Self::NoTree { .. } => "E-JUXTAPOSE-NO-TREE",
            Self::NotSwept { .. } | Self::SweepSize { .. } => "E-SWEEP",
            Self::Altered { .. } => "E-RUN-ALTERED-FILE",
            Self::Certificate { .. } => "E-RUN-CERTIFICATE",
            Self::Unverified { .. } => "E-VERIFY",
            Self::NoSuchStage { .. } | Self::EmptyRange { .. } => "E-RUN-STAGES",
            Self::Input { .. } => "E-INPUT",
            Self::OtherSettings { .. } => "E-RUN-SETTINGS",
            Self::OtherInput { .. } => "E-RUN-INPUT",
            Self::Read { .. } => "E-IO-READ",
            Self::TooLarge { .. } | Self::Memory { .. } => "E-LIMIT-MEMORY",
            Self::Create { .. } => "E-IO-CREATE",
            Self::Write { .. } => "E-IO-WRITE",
            Self::Print { .. } => "E-IO-PRINT",
            Self::Locked { .. } => "E-RUN-LOCKED",
            Self::Threads { .. } => "E-RUN-THREADS",
            Self::UnknownCode { .. } => "E-EXPLAIN-CODE",
            Self::UnknownKey { .. } => "E-EXPLAIN-KEY",
        }
    }

    fn class(&self) -> Class {
        match self {
            Self::Config(error) => error.class(),
            Self::Stage { cause, .. } | Self::File { cause, .. } => cause.class(),
            Self::Point { cause, .. } => cause.class(),
            Self::Cohort { cause, .. } => cause.class(),
            Self::Samples { .. }
            | Self::NoSample { .. }
            | Self::BidsSuffix { .. }
            | Self::NoBidsLabel { .. }
            | Self::NoSuchStage { .. }
            | Self::NoSuchPlace { .. }
            | Self::PlotFormat { .. }
            | Self::ResultInTheWay { .. }
            | Self::InputInTheWay { .. }
            | Self::NoSuchSpace { .. }
            | Self::EmptyRange { .. }
            | Self::Input { .. }
            | Self::OtherSettings { .. }
            | Self::OtherInput { .. }
            | Self::RunInTheWay { .. }
            | Self::Settled { .. }
            | Self::SettledTree { .. }
            | Self::NotSwept { .. }
            | Self::SweepSize { .. }
            | Self::GroupSize { .. }
            | Self::UnknownCode { .. }
            | Self::UnknownKey { .. }
            | Self::Threads { .. } => Class::Usage,
            Self::BidsDataset { .. } => Class::Input,
            Self::NoRun { .. }
            | Self::NoGroup { .. }
            | Self::NoBidsScan { .. }
            | Self::NoTree { .. }
            | Self::MissingArtifact { .. }
            | Self::Read { .. }
            | Self::Write { .. }
            | Self::Print { .. } => Class::Io,
            Self::Altered { .. } | Self::Certificate { .. } | Self::Unverified { .. } => Class::Uncertified,
            Self::TooLarge { .. } | Self::Memory { .. } => Class::Limit,
            Self::Create { .. }
            | Self::FileInTheWay { .. }
            | Self::FolderInTheWay { .. }
            | Self::BidsOutput { .. } => Class::CannotCreate,
            Self::Locked { .. } => Class::Locked,
        }
    }

    fn hint(&self) -> String {
        match self {
            Self::Config(error) => error.hint(),
            Self::Stage { cause, .. } | Self::File { cause, .. } => cause.hint(),
            Self::Unverified { .. } => "use none of it; make it again with espalier run".to_owned(),
            Self::Certificate { .. } => "make the embedding again with espalier embed".to_owned(),
            Self::NoSuchPlace { .. } => "branches.tsv has the branches, nodes.tsv the nodes".to_owned(),
            Self::PlotFormat { .. } => "name it with one of these endings".to_owned(),
            Self::ResultInTheWay { .. } => "choose another name for the plot".to_owned(),
            Self::InputInTheWay { .. } => "choose another folder with -o".to_owned(),
            Self::FileInTheWay { .. } => {
                "move it away, or choose another folder with -o; --force writes over it".to_owned()
            }
            Self::FolderInTheWay { .. } => "move it away, or choose another folder with -o".to_owned(),
            Self::Point { cause, .. } => cause.hint(),
            Self::NoSuchSpace { .. } => "give points in RAS+ mm, with --lps in LPS+ mm, or on the map in mm".to_owned(),
            Self::NoRun { .. } => "run it with this version, at least up to --to embed".to_owned(),
            Self::NoTree { .. } => "run it with this version, at least up to --to tree".to_owned(),
            Self::SettledTree { .. } => {
                "of finished runs seed, views.*, embed.* and render.* can be changed; or give the configs".to_owned()
            }
            Self::Samples { .. } => {
                "columns are id, path, config, preset, label, labels, image, series, volume_index, seed, keys of the config such as embed.w_angle, and notes such as note or note.age; an empty cell or n/a says nothing".to_owned()
            }
            Self::NoSample { .. } => "the column id has the ids".to_owned(),
            Self::BidsDataset { .. } => "mend it, or take the data set as it is with --skip-bids-validation".to_owned(),
            Self::BidsOutput { .. } => "name a folder of its own for the results, such as derivatives/espalier".to_owned(),
            Self::BidsSuffix { .. } => "say which with --suffix, and --filter desc=… if one kind has several".to_owned(),
            Self::NoBidsScan { .. } => "volumes lie in sub-*/[ses-*/] and end with .nii or .nii.gz; see --suffix and --filter".to_owned(),
            Self::NoBidsLabel { .. } => "labels are what stands after sub- and ses-".to_owned(),
            Self::Cohort { .. } => "failures.tsv has the reasons, and the command that tries each again".to_owned(),
            Self::NoGroup { .. } => {
                "name run folders, or a folder that has run folders in it, such as the one that espalier run writes to".to_owned()
            }
            Self::GroupSize { .. } => "show them in several groups".to_owned(),
            Self::RunInTheWay { .. } => "choose another folder with -o".to_owned(),
            Self::NotSwept { .. } => "write --over KEY=V1,V2,…, such as --over embed.w_length=0.5,1,2,4".to_owned(),
            Self::SweepSize { .. } => "give fewer values, or sweep one key at a time".to_owned(),
            Self::Settled { .. } => "of a finished run only render.* can be changed; or compare its config".to_owned(),
            Self::UnknownKey { nearest, .. } if nearest.is_empty() => {
                "espalier config explain lists all keys".to_owned()
            }
            Self::UnknownKey { nearest, .. } => format!("did you mean {}?", nearest.join(" or ")),
            Self::UnknownCode { nearest, .. } if nearest.is_empty() => "espalier explain lists all codes".to_owned(),
            Self::UnknownCode { nearest, .. } => {
                format!("did you mean {}? espalier explain lists all codes", nearest.join(" or "))
            }
            Self::MissingArtifact { .. } => "start from an earlier stage with --from, or name the file".to_owned(),
            Self::Altered { .. } => {
                "run the stage that makes it again; or, if the edit is meant, give the file to the stage's own \
                 command with -o to another folder"
                    .to_owned()
            }
            Self::Read { source, .. } if source.kind() == io::ErrorKind::NotFound => {
                "check the path; a path in a config is relative to the config's own folder".to_owned()
            }
            Self::Read { source, .. } if source.kind() == io::ErrorKind::IsADirectory => {
                "name a file: a config (.toml), a volume (.nii, .nii.gz, .hdr, .nrrd, .nhdr, .mha, .mhd) or a traced tree (.swc, .vtp, .vtk)".to_owned()
            }
            Self::OtherSettings { difference, .. } => {
                format!("run with --from {}, or set {} back", difference.stage, difference.key)
            }
            Self::OtherInput { first, .. } => format!("run with --from {first}, or choose another folder with -o"),
            Self::Input { .. } => "set it to the folder of the data".to_owned(),
            Self::TooLarge { .. } => "allow more with --max-memory".to_owned(),
            Self::Memory { stage: Stage::Render, .. } => {
                "allow more with --max-memory, or take less with render.width_px, or render.space = false".to_owned()
            }
            Self::Memory { stage: Stage::Embed | Stage::Views, .. } => {
                "allow more with --max-memory, or take fewer nodes with tree.resample".to_owned()
            }
            Self::Memory { .. } => {
                "allow more with --max-memory, or take coarser voxels with volume.resample_mm".to_owned()
            }
            Self::Create { .. } => "choose another place for it with -o (a plot: with --plot)".to_owned(),
            Self::Write { .. } => "check the free space and the permissions of the folder".to_owned(),
            Self::Print { .. } => "what was done is in place; send standard output to where there is room".to_owned(),
            Self::Locked { .. } => "wait for it with --wait, or choose another folder with -o".to_owned(),
            Self::NoSuchStage { .. } | Self::EmptyRange { .. } | Self::Read { .. } | Self::Threads { .. } => {
                String::new()
            }
        }
    }

    fn file(&self) -> Option<&Path> {
        match self {
            Self::Config(error) => error.file(),
            Self::Stage { cause, .. } => cause.file(),
            Self::File { path, cause } => cause.file().or(Some(path)),
            Self::Point { source_name, .. } => source_name.as_ref().map(Path::new),
            Self::MissingArtifact { path, .. }
            | Self::Altered { path }
            | Self::Samples { path, .. }
            | Self::BidsDataset { path, .. }
            | Self::Certificate { path, .. }
            | Self::PlotFormat { path }
            | Self::ResultInTheWay { path }
            | Self::InputInTheWay { path }
            | Self::FileInTheWay { path }
            | Self::FolderInTheWay { path }
            | Self::OtherInput { path, .. }
            | Self::Read { path, .. }
            | Self::TooLarge { path, .. }
            | Self::Create { path, .. }
            | Self::Write { path, .. } => Some(path),
            Self::NoRun { folder, .. }
            | Self::NoTree { folder, .. }
            | Self::NoBidsScan { folder, .. }
            | Self::BidsOutput { folder }
            | Self::RunInTheWay { folder }
            | Self::Settled { folder, .. }
            | Self::SettledTree { folder, .. }
            | Self::Unverified { folder, .. }
            | Self::Locked { folder } => Some(folder),
            _ => None,
        }
    }

    fn line(&self) -> Option<usize> {
        match self {
            Self::Config(error) => error.line(),
            Self::Stage { cause, .. } | Self::File { cause, .. } => cause.line(),
            Self::Point { cause, .. } => cause.line(),
            _ => None,
        }
    }
}
