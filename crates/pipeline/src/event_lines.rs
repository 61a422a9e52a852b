//! What `--json` prints on standard error: one JSON object a line.
//!
//! **Input** an [`Event`], an [`Error`]. **Output** a [`Line`]; its field `event` says which.
//! **Guarantees** this is the one place where the format is written down: `espalier info --events` prints its JSON Schema,
//! made from these types. Under one [`VERSION`] fields and events are added, never renamed or given another meaning.
//! Equal runs print equal lines, but for seconds, memory and paths.

use std::collections::BTreeMap;
use std::path::Path;

use espalier_model::Diagnose;
use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde::{Deserialize, Serialize};

use crate::error::Error;
use crate::event::{Event, Setting, Took};
use crate::explain;
use crate::stage::Stage;

/// The name of the format, in the first line.
pub const FORMAT: &str = "espalier-events";
/// Its version, in the first line.
pub const VERSION: u32 = 1;

/// One line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "event", rename_all = "kebab-case")]
pub enum Line {
    /// The program begins: the first line.
    Begin {
        /// `espalier-events`.
        format: String,
        /// The version of this format.
        version: u32,
        /// The version of espalier.
        program_version: String,
        /// The command, such as `run`; empty where it cannot be told.
        command: String,
    },
    /// A run begins, and its folder is its own.
    RunStarted {
        /// The run folder.
        folder: String,
        /// The stages that it goes through, in order.
        stages: Vec<String>,
        /// The settings that are not at their default.
        settings: Vec<Changed>,
    },
    /// A stage begins.
    StageStarted {
        /// The stage, such as `embed`.
        stage: String,
        /// Why it is done: not yet, or what its earlier results were made from is another now.
        reason: String,
    },
    /// A stage goes on; at most once for each percent.
    StageProgress {
        /// The stage.
        stage: String,
        /// Work done.
        done: u64,
        /// All work.
        total: u64,
        /// The state so far, as a phrase.
        note: String,
    },
    /// A stage is done, and its files are in place.
    StageDone {
        /// The stage.
        stage: String,
        /// What it did, as a phrase.
        line: String,
        /// What it counted, as in its `report.json`; null where that is no finite number.
        counts: BTreeMap<String, Option<f64>>,
        /// How long it took.
        seconds: f64,
        /// The most memory that the program has held until then, in MB; null where the system does not tell.
        peak_mb: Option<f64>,
        /// The same of its parts, such as the layout methods of `embed`, in the order in which they ran.
        parts: Vec<Part>,
    },
    /// A stage has nothing to do: its results from before stand.
    StageKept {
        /// The stage.
        stage: String,
        /// What it did when they were made, as a phrase.
        line: String,
        /// What it counted then.
        counts: BTreeMap<String, Option<f64>>,
    },
    /// A stage's results were copied from the store that runs share.
    StageShared {
        /// The stage.
        stage: String,
        /// Why those in the folder, if there were any, did not stand.
        reason: String,
        /// What it did when they were made, as a phrase.
        line: String,
        /// What it counted then.
        counts: BTreeMap<String, Option<f64>>,
    },
    /// Something that the reader should know, and that stopped nothing.
    Warning {
        /// The stage.
        stage: String,
        /// Its code, such as `W-VOLUME-NO-UNITS`.
        code: String,
        /// The place and the fact.
        message: String,
        /// The file that it speaks of, where that is one of the user's; else null.
        file: Option<String>,
    },
    /// Another run holds the folder; this one waits.
    Waiting {
        /// The run folder.
        folder: String,
    },
    /// A combination of a sweep is done.
    Combination {
        /// Which, from 1.
        done: u64,
        /// How many there are.
        total: u64,
        /// Its settings and what they came to, as a phrase.
        line: String,
    },
    /// A scan of a cohort begins; the lines up to its end are of it.
    ScanStarted {
        /// Its id.
        scan: String,
        /// Its run folder.
        folder: String,
    },
    /// A scan of a cohort is done.
    ScanDone {
        /// Its id.
        scan: String,
        /// Its run folder.
        folder: String,
        /// The SHA-256 of its `SHA256SUMS`.
        digest: String,
    },
    /// A scan of a cohort has failed; the others go on.
    ScanFailed {
        /// Its id.
        scan: String,
        /// Its run folder.
        folder: String,
        /// Why.
        failure: Failure,
    },
    /// A remark without a place in the other lines.
    Note {
        /// The remark.
        message: String,
    },
    /// A run is at its end.
    RunDone {
        /// The run folder.
        folder: String,
        /// The files that say most, relative to it.
        files: Vec<String>,
        /// The SHA-256 of `SHA256SUMS`: equal for equal results.
        digest: String,
        /// What the certificate says of the embedding; null where the run has not come to one.
        verdict: Option<Verdict>,
        /// How many crossings it has; null where the run has not come to one.
        crossings: Option<u64>,
        /// Warnings of all stages.
        warnings: u64,
        /// How long it took.
        seconds: f64,
        /// The most memory that the program has held, in MB; null where the system does not tell.
        peak_mb: Option<f64>,
    },
    /// A run stops; a failure follows.
    RunStopped {
        /// The run folder.
        folder: String,
        /// The stages whose results were made in this run and are in place.
        done: Vec<String>,
    },
    /// The program ends with an error: the last line. One more may stand before it: that results could not be printed.
    Failed(Failure),
}

/// Why something failed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Failure {
    /// The code of the error, such as `E-VOLUME-4D`; null where a signal or a bug ends the program.
    pub code: Option<String>,
    /// The exit code of the program, were this its only error.
    pub exit_code: u8,
    /// The stage that failed, if it was one; else null.
    pub stage: Option<String>,
    /// The file or folder that is wrong, where it is one; else null.
    pub file: Option<String>,
    /// The line of that file, from 1, where it is one; else null.
    pub line: Option<u64>,
    /// What is wrong, and where.
    pub message: String,
    /// What can be done about it; null where the message says it all.
    pub hint: Option<String>,
    /// What errors of this code come from in general, as `espalier explain` says; null where there is no code.
    pub cause: Option<String>,
    /// What can be done about errors of this code in general; null where there is no code.
    pub way_out: Option<String>,
}

/// What the certificate says of an embedding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// No crossings, by exact arithmetic over the coordinates as written.
    Certified,
    /// Some crossings.
    NotPlanar,
}

/// A setting that is not at its default.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Changed {
    /// Its dotted key.
    pub key: String,
    /// Its value as TOML; of a file only that there is one.
    pub value: String,
    /// What it is where nobody says; null where it then has no value.
    pub default: Option<String>,
}

/// What a part of a stage took.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Part {
    /// Its name, such as that of a method.
    pub name: String,
    /// How long it took.
    pub seconds: f64,
    /// The most memory that the program had held until its end, in MB; null where the system does not tell.
    pub peak_mb: Option<f64>,
}

impl Line {
    /// The first line.
    #[must_use]
    pub fn begin(command: &str) -> Self {
        Self::Begin {
            format: FORMAT.to_owned(),
            version: VERSION,
            program_version: env!("CARGO_PKG_VERSION").to_owned(),
            command: command.to_owned(),
        }
    }

    /// The line of an event.
    #[must_use]
    pub fn of(event: Event) -> Self {
        match event {
            Event::Opened { out, stages, settings } => {
                let settings = settings.into_iter().map(Changed::of).collect();
                Self::RunStarted { folder: shown(&out), stages: names(&stages), settings }
            }
            Event::Started { stage, reason } => {
                Self::StageStarted { stage: name(stage), reason: reason.to_string() }
            }
            Event::Progress { stage, done, total, note } => {
                Self::StageProgress { stage: name(stage), done, total, note }
            }
            Event::Warning { stage, code, message, file } => {
                Self::Warning { stage: name(stage), code, message, file: file.as_deref().map(shown) }
            }
            Event::Finished { stage, line, counts, cost } => {
                let Took { seconds, peak_mb, parts } = cost;
                let parts = parts.into_iter().map(|(name, seconds, peak_mb)| Part { name, seconds, peak_mb });
                let (stage, counts, parts) = (name(stage), finite(counts), parts.collect());
                Self::StageDone { stage, line, counts, seconds, peak_mb, parts }
            }
            Event::Kept { stage, line, counts } => {
                Self::StageKept { stage: name(stage), line, counts: finite(counts) }
            }
            Event::Taken { stage, reason, line, counts } => {
                let (stage, reason, counts) = (name(stage), reason.to_string(), finite(counts));
                Self::StageShared { stage, reason, line, counts }
            }
            Event::Waiting { out } => Self::Waiting { folder: shown(&out) },
            Event::Combination { done, total, line } => {
                Self::Combination { done: done as u64, total: total as u64, line }
            }
            Event::Ended { out, files, digest, crossings, seconds, peak_mb, n_warnings } => Self::RunDone {
                folder: shown(&out),
                files,
                digest,
                verdict: crossings.map(Verdict::of),
                crossings,
                warnings: n_warnings as u64,
                seconds,
                peak_mb,
            },
            Event::Stopped { kept, out } => Self::RunStopped { folder: shown(&out), done: names(&kept) },
        }
    }

    /// Its text, without the end of the line.
    #[must_use]
    pub fn to_json(&self) -> String {
        // Plain structs of numbers and strings: serialisation cannot fail.
        serde_json::to_string(self).unwrap_or_default()
    }
}

impl Failure {
    /// Of an error of ours.
    #[must_use]
    pub fn of(error: &Error) -> Self {
        let stage = if let Error::Stage { stage, .. } = error { Some(name(*stage)) } else { None };
        Self {
            stage,
            file: error.file().map(shown),
            line: error.line().map(|line| line as u64),
            hint: Some(error.hint()).filter(|hint| !hint.is_empty()),
            ..Self::with_code(error.code(), error.class().exit_code(), error.to_string())
        }
    }

    /// Of an error that has no more than a code and a message.
    #[must_use]
    pub fn with_code(code: &str, exit_code: u8, message: String) -> Self {
        let entry = explain::explain(code).ok();
        Self {
            code: Some(code.to_owned()),
            cause: entry.as_ref().map(|entry| entry.cause().to_owned()),
            way_out: entry.map(|entry| entry.way_out().to_owned()),
            ..Self::without_code(exit_code, message)
        }
    }

    /// Of a signal, or a bug of ours.
    #[must_use]
    pub fn without_code(exit_code: u8, message: String) -> Self {
        let (code, stage, file, line, hint, cause, way_out) = (None, None, None, None, None, None, None);
        Self { code, exit_code, stage, file, line, message, hint, cause, way_out }
    }
}

impl Verdict {
    fn of(crossings: u64) -> Self {
        if crossings == 0 { Self::Certified } else { Self::NotPlanar }
    }
}

impl Changed {
    fn of(setting: Setting) -> Self {
        let Setting { key, value, default } = setting;
        Self { key, value, default }
    }
}

fn name(stage: Stage) -> String {
    stage.name().to_owned()
}

fn names(stages: &[Stage]) -> Vec<String> {
    stages.iter().copied().map(name).collect()
}

fn finite(counts: BTreeMap<String, f64>) -> BTreeMap<String, Option<f64>> {
    counts.into_iter().map(|(name, value)| (name, value.is_finite().then_some(value))).collect()
}

fn shown(path: &Path) -> String {
    path.display().to_string()
}

/// The JSON Schema of a line, as text.
#[must_use]
pub fn schema_text() -> String {
    let mut settings = SchemaSettings::draft2020_12();
    settings.inline_subschemas = true;
    let schema = settings.into_generator().into_root_schema_for::<Line>();
    serde_json::to_string_pretty(&schema).unwrap_or_default() + "\n"
}

#[cfg(test)]
#[allow(clippy::expect_used, reason = "a test says what it expects")]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::record::Reason;

    #[test]
    fn every_line_is_one_line_and_is_read_back() {
        let counts = BTreeMap::from([("branches".to_owned(), 7.0), ("share".to_owned(), f64::NAN)]);
        let cost = Took { seconds: 1.5, peak_mb: Some(80.0), parts: vec![("radial".to_owned(), 0.25, None)] };
        let out = PathBuf::from("out/a \"quoted\"\nname");
        let (stage, line, digest) = (Stage::Embed, "one\ntwo".to_owned(), "0".repeat(64));
        let setting = Setting { key: "seed".to_owned(), value: "3".to_owned(), default: None };
        let reason = Reason::Absent;
        let events = [
            Event::Opened { out: out.clone(), stages: vec![stage], settings: vec![setting] },
            Event::Started { stage, reason: reason.clone() },
            Event::Progress { stage, done: 1, total: 9, note: "pso".to_owned() },
            Event::Warning {
                stage,
                code: "W-RUN-CACHE".to_owned(),
                message: line.clone(),
                file: Some(out.clone()),
            },
            Event::Finished { stage, line: line.clone(), counts: counts.clone(), cost },
            Event::Kept { stage, line: line.clone(), counts: counts.clone() },
            Event::Taken { stage, reason, line: line.clone(), counts },
            Event::Waiting { out: out.clone() },
            Event::Combination { done: 1, total: 4, line },
            Event::Stopped { kept: vec![stage], out: out.clone() },
            Event::Ended {
                out: out.clone(),
                files: Vec::new(),
                digest,
                crossings: Some(0),
                seconds: 1.0,
                peak_mb: None,
                n_warnings: 2,
            },
        ];
        let failed = Line::Failed(Failure::of(&Error::Locked { folder: out }));
        for line in events.map(Line::of).into_iter().chain([Line::begin("run"), failed]) {
            let text = line.to_json();
            assert!(!text.contains('\n') && text.starts_with("{\"event\":"), "{text}");
            assert_eq!(serde_json::from_str::<Line>(&text).expect("a line"), line);
        }
    }

    #[test]
    fn a_failure_has_its_cause_and_way_out() {
        let failure = Failure::of(&Error::Locked { folder: "out/a".into() });
        assert_eq!((failure.code.as_deref(), failure.exit_code), (Some("E-RUN-LOCKED"), 75));
        assert_eq!(failure.file.as_deref(), Some("out/a"));
        assert!(failure.cause.is_some_and(|cause| cause.contains("lock")));
        assert!(failure.hint.is_some_and(|hint| hint.contains("--wait")) && failure.way_out.is_some());
    }
}
