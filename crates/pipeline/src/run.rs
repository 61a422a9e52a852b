//! The loop over the stages.

use std::collections::BTreeMap;
use std::path::PathBuf;

use espalier_model::Diagnose;

use crate::artifacts::Artifacts;
use crate::clock::Stopwatch;
use crate::config::{Config, Loaded, Source, Unit};
use crate::error::Error;
use crate::event::Event;
use crate::folder::RunFolder;
use crate::provenance::{self, StageCost};
use crate::stage::{Artifact, Stage};
use crate::steps::{self, Step};

/// A run to be done.
#[derive(Clone, Debug)]
pub struct Request {
    /// The config, and where its paths start from.
    pub loaded: Loaded,
    /// The run folder; made if it is not there.
    pub out: PathBuf,
    /// The first stage to do; those before it have left their files in the run folder. Default: the first.
    pub from: Option<Stage>,
    /// The last stage to do. Default: the last.
    pub to: Option<Stage>,
    /// Files to use instead of those in the run folder.
    pub files: BTreeMap<Artifact, PathBuf>,
    /// Threads; `None` for one per core. No result depends on it.
    pub threads: Option<usize>,
    /// The most memory that reading a file may take, in bytes.
    pub max_memory_bytes: u64,
    /// What `$ESPALIER_DATA` stands for.
    pub data_dir: Option<PathBuf>,
}

/// What a run came to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Summary {
    /// The run folder.
    pub out: PathBuf,
    /// The files that say most, relative to it.
    pub highlights: Vec<String>,
    /// The SHA-256 of `SHA256SUMS`: equal for equal results.
    pub digest: String,
}

/// Does a run.
///
/// # Errors
/// [`Error`], which says at which stage and what to do. Files of stages that were done stay as they are; the
/// stage that failed has written nothing.
pub fn run(request: &Request, events: &(dyn Fn(Event) + Sync)) -> Result<Summary, Error> {
    let threads = request.threads.unwrap_or(0);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|error| Error::Threads { threads, message: error.to_string() })?;
    pool.install(|| run_stages(request, events))
}

fn run_stages(request: &Request, events: &(dyn Fn(Event) + Sync)) -> Result<Summary, Error> {
    let config = &request.loaded.config;
    let source = resolve_source(request)?;
    let stages = stages_to_do(request, &source)?;
    let mut artifacts = artifacts_of(request, &source);
    let input = input_file(&stages, &artifacts);
    // A missing input must not leave a folder behind.
    if let Some(path) = &input {
        steps::check_readable(path)?;
    }

    let mut folder = RunFolder::open(&request.out)?;
    let mut costs = Vec::new();
    let mut has_changed = false;
    for &stage in &stages {
        events(Event::Started { stage });
        let watch = Stopwatch::start();
        let mut step =
            Step { stage, config, source: &source, artifacts: &mut artifacts, events, folder: &folder };
        let outcome = match steps::perform(&mut step) {
            Ok(outcome) => outcome,
            Err(error) => {
                let kept = costs.iter().map(|cost: &StageCost| cost.stage).collect();
                folder.remove_if_unused();
                events(Event::Stopped { kept, out: request.out.clone() });
                return Err(error);
            }
        };
        if costs.is_empty() {
            provenance::write_config(&mut folder, config)?;
            if request.from.is_none_or(|from| from == stages_of(&source)[0]) {
                provenance::write_inputs(&mut folder, input.as_deref())?;
            }
        }
        has_changed |= write_outcome(&mut folder, stage, &outcome)?;
        for warning in &outcome.report.warnings {
            events(Event::Warning { stage, code: warning.code, message: warning.message.clone() });
        }
        let seconds = watch.seconds();
        events(Event::Finished { stage, seconds, line: outcome.line });
        costs.push(StageCost { stage, seconds });
    }
    if has_changed {
        remove_outdated(&mut folder, stages.last().copied())?;
    }
    let digest = folder.seal()?;
    provenance::write_run(&folder, config, &costs, &digest)?;
    let highlights = stages.last().map(|last| last.writes()).unwrap_or_default();
    let highlights = highlights.into_iter().filter(|file| folder.path().join(file).exists()).collect();
    Ok(Summary { out: request.out.clone(), highlights, digest })
}

/// Writes a stage's files; tells whether any of them is not what the folder had.
fn write_outcome(folder: &mut RunFolder, stage: Stage, outcome: &steps::Outcome) -> Result<bool, Error> {
    let mut has_changed = false;
    // Until the new files are in place nothing vouches for the old ones.
    folder.forget(&stage.writes())?;
    for (file, bytes) in &outcome.files {
        has_changed |= folder.write(file, bytes)?;
    }
    let report = provenance::report_json(stage, &outcome.report);
    has_changed |= folder.write(&format!("{}/report.json", stage.folder()), report.as_bytes())?;
    // A file that this stage wrote in an earlier run, but not in this one, is not of this run.
    let report_file = format!("{}/report.json", stage.folder());
    for file in stage.writes() {
        if file != report_file && !outcome.files.iter().any(|(written, _)| *written == file) {
            folder.remove(&file)?;
        }
    }
    folder.seal()?;
    Ok(has_changed)
}

/// Removes the files of later stages: what they were made from is no more.
fn remove_outdated(folder: &mut RunFolder, last_done: Option<Stage>) -> Result<(), Error> {
    for stage in Stage::ALL.into_iter().filter(|stage| Some(*stage) > last_done) {
        for file in stage.writes() {
            folder.remove(&file)?;
        }
    }
    Ok(())
}

fn resolve_source(request: &Request) -> Result<Source, Error> {
    let Loaded { config, base_dir } = &request.loaded;
    config
        .input
        .resolve(base_dir, request.data_dir.as_deref())
        .map_err(|error| Error::Stage { stage: Stage::Phantom, cause: Box::new(error) })
}

/// The stages that a run from this source passes through.
fn stages_of(source: &Source) -> Vec<Stage> {
    Stage::ALL
        .into_iter()
        .filter(|stage| match source {
            Source::Volume(_) => *stage != Stage::Phantom,
            Source::Tree(_) => *stage >= Stage::Tree,
            Source::PhantomScan(_) => true,
            Source::PhantomTree(_) => *stage == Stage::Phantom || *stage >= Stage::Tree,
        })
        .collect()
}

fn stages_to_do(request: &Request, source: &Source) -> Result<Vec<Stage>, Error> {
    let available = stages_of(source);
    for (flag, stage) in [("from", request.from), ("to", request.to)] {
        if let Some(stage) = stage.filter(|stage| !available.contains(stage)) {
            let available = available.iter().map(|stage| stage.name()).collect::<Vec<_>>().join(", ");
            return Err(Error::NoSuchStage { flag, stage, available });
        }
    }
    let from = request.from.unwrap_or(Stage::Phantom);
    let to = request.to.unwrap_or(Stage::Render);
    if from > to {
        return Err(Error::EmptyRange { from, to });
    }
    Ok(available.into_iter().filter(|stage| (from..=to).contains(stage)).collect())
}

fn artifacts_of(request: &Request, source: &Source) -> Artifacts {
    let input = &request.loaded.config.input;
    let mut files = request.files.clone();
    match source {
        Source::Volume(path) => _ = files.entry(Artifact::Volume).or_insert_with(|| path.clone()),
        Source::Tree(path) => _ = files.entry(Artifact::Traced).or_insert_with(|| path.clone()),
        Source::PhantomScan(_) | Source::PhantomTree(_) => {}
    }
    Artifacts {
        files,
        read_options: espalier_volume::ReadOptions {
            max_bytes: request.max_memory_bytes,
            volume_index: input.volume_index,
            assume_space: input.assume_space,
            unit_mm: (input.unit != Unit::Auto).then(|| input.unit.mm()),
            strict: input.strict,
        },
        input: input.clone(),
        ..Artifacts::default()
    }
}

/// The file that the first stage begins with, if it is the user's.
fn input_file(stages: &[Stage], artifacts: &Artifacts) -> Option<PathBuf> {
    let first = *stages.first()?;
    let wanted = if first == Stage::Tree { [Artifact::Traced].as_slice() } else { first.reads() };
    wanted.iter().find_map(|artifact| artifacts.files.get(artifact)).cloned()
}

/// The default run folder of a config.
#[must_use]
pub fn default_folder(config: &Config) -> PathBuf {
    PathBuf::from("out").join(&config.name)
}

/// Boxes a stage's error.
pub(crate) fn boxed(error: impl Diagnose + Send + Sync + 'static) -> Box<dyn Diagnose + Send + Sync> {
    Box::new(error)
}
