//! The loop over the stages.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use espalier_model::Diagnose;

use crate::artifacts::Artifacts;
use crate::clock::Stopwatch;
use crate::config::{Config, Loaded, Source, Unit};
use crate::error::Error;
use crate::event::Event;
use crate::folder::RunFolder;
use crate::provenance::{self, StageCost};
use crate::settings::Settings;
use crate::side_file::SideFile;
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
    in_pool(request.threads, || run_stages(request, events))
}

/// Works in a thread pool of so many threads; one per core if none are given.
pub(crate) fn in_pool<T: Send>(
    threads: Option<usize>,
    work: impl FnOnce() -> Result<T, Error> + Send,
) -> Result<T, Error> {
    let threads = threads.unwrap_or(0);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|error| Error::Threads { threads, message: error.to_string() })?;
    pool.install(work)
}

fn run_stages(request: &Request, events: &(dyn Fn(Event) + Sync)) -> Result<Summary, Error> {
    let source = resolve_source(request)?;
    let stages = stages_to_do(request, &source)?;
    let artifacts = artifacts_of(request, &source);
    let input = input_file(&stages, &artifacts);
    // A missing input must not leave a folder behind.
    let sides = artifacts.side_paths.iter().filter(|(side, _)| stages.contains(&side.stage()));
    for path in input.iter().chain(sides.map(|(_, path)| path)) {
        let may_be_folder = matches!(source, Source::Volume(_)) && Some(path) == input.as_ref();
        steps::check_readable(path, may_be_folder)?;
    }

    let mut folder = RunFolder::open(&request.out)?;
    let mut run = Run { request, source, artifacts, events, costs: Vec::new() };
    let done = run.perform(&mut folder, &stages, input.as_deref());
    if done.is_err() {
        folder.remove_if_unused();
        let kept = run.costs.iter().map(|cost| cost.stage).collect();
        events(Event::Stopped { kept, out: request.out.clone() });
    }
    let digest = done?;
    let highlights = stages.last().map(|last| last.writes()).unwrap_or_default();
    let highlights = highlights.into_iter().filter(|file| folder.path().join(file).exists()).collect();
    Ok(Summary { out: request.out.clone(), highlights, digest })
}

/// A run under way.
struct Run<'a> {
    request: &'a Request,
    source: Source,
    artifacts: Artifacts,
    events: &'a (dyn Fn(Event) + Sync),
    costs: Vec<StageCost>,
}

impl Run<'_> {
    /// Does the stages one after the other; gives the digest of the sealed folder.
    fn perform(
        &mut self,
        folder: &mut RunFolder,
        stages: &[Stage],
        input: Option<&Path>,
    ) -> Result<String, Error> {
        let (config, events) = (&self.request.loaded.config, self.events);
        let mut settings = Settings::open(folder, config);
        self.refuse_other_settings(folder, &settings, stages)?;
        for &stage in stages {
            events(Event::Started { stage });
            let watch = Stopwatch::start();
            let (source, artifacts) = (&self.source, &mut self.artifacts);
            let mut step = Step { stage, config, source, artifacts, events, folder, parts: Vec::new() };
            let outcome = steps::perform(&mut step)?;
            let parts = step.parts;

            if Some(&stage) == stages.first() {
                self.clear_away(folder, &settings)?;
                if Some(stage) == stages_of(&self.source).first().copied() {
                    let files = input.map(|input| self.input_files(stage, input)).transpose()?;
                    provenance::write_inputs(folder, &files.unwrap_or_default())?;
                }
            }
            for side in SideFile::ALL.into_iter().filter(|side| side.stage() == stage) {
                provenance::write_side_file(folder, side, self.artifacts.side_paths.get(&side))?;
            }
            write_outcome(folder, stage, &outcome)?;
            settings.adopt(folder, stage)?;
            let digest = folder.seal()?;
            let peak_mb = provenance::peak_memory_mb();
            let cost = StageCost { stage, seconds: watch.seconds(), peak_mb, parts };
            let seconds = cost.seconds;
            self.costs.push(cost);
            let files = (input, &self.artifacts.side_paths);
            provenance::write_run(folder, config, files, &self.costs, &digest)?;

            for warning in outcome.report.warnings {
                events(Event::Warning { stage, code: warning.code, message: warning.message });
            }
            events(Event::Finished { stage, seconds, line: outcome.line });
        }
        folder.seal()
    }

    /// A run that begins in the middle builds on results that were made with the same settings, or not at all.
    /// Files that the user names are the user's to answer for.
    fn refuse_other_settings(
        &self,
        folder: &RunFolder,
        settings: &Settings,
        stages: &[Stage],
    ) -> Result<(), Error> {
        let available = stages_of(&self.source);
        let (Some(from), true) = (self.request.from, self.request.files.is_empty()) else { return Ok(()) };
        let earlier: Vec<Stage> =
            available.iter().copied().filter(|stage| Some(stage) < stages.first()).collect();
        if earlier.is_empty() {
            return Ok(());
        }
        if let Some(difference) = settings.difference(&earlier, available[0]) {
            return Err(Error::OtherSettings { from, difference: Box::new(difference) });
        }
        let sides = self.artifacts.side_paths.iter().filter(|(_, path)| path.is_file());
        for (side, path) in sides.filter(|(side, _)| earlier.contains(&side.stage())) {
            if provenance::is_other_side_file(folder, *side, path)? {
                return Err(Error::OtherInput { from, path: path.clone(), first: side.stage() });
            }
        }
        // Scans of many patients share one name; their content tells them apart. A scan that lies elsewhere now, or
        // nowhere, is no reason to stop: nothing will be read from it.
        let (Source::Volume(input) | Source::Tree(input)) = &self.source else { return Ok(()) };
        if input.exists() && provenance::is_other_input(folder, &self.input_files(available[0], input)?)? {
            return Err(Error::OtherInput { from, path: input.clone(), first: available[0] });
        }
        Ok(())
    }

    /// The files that an input is read from: several where it is a DICOM series.
    fn input_files(&self, stage: Stage, input: &Path) -> Result<Vec<PathBuf>, Error> {
        match self.source {
            Source::Volume(_) => espalier_volume::files(input, &self.artifacts.read_options)
                .map_err(|error| Error::stage(stage)(boxed(error))),
            _ => Ok(vec![input.to_owned()]),
        }
    }

    /// Removes what is not of this run: everything, if input or seed are others; else the files of stages that a run
    /// from this input does not have.
    fn clear_away(&self, folder: &mut RunFolder, settings: &Settings) -> Result<(), Error> {
        if !self.request.files.is_empty() {
            return Ok(());
        }
        let available = stages_of(&self.source);
        let is_foreign = |stage: &Stage| settings.is_other_run() || !available.contains(stage);
        let files: Vec<String> =
            Stage::ALL.iter().filter(|stage| is_foreign(stage)).flat_map(|s| s.writes()).collect();
        folder.discard(&files)
    }
}

/// Writes a stage's files. If any of them is not what the folder had, the files of later stages go first: what they
/// were made from is no more.
fn write_outcome(folder: &mut RunFolder, stage: Stage, outcome: &steps::Outcome) -> Result<(), Error> {
    let report_json = provenance::report_json(stage, &outcome.report);
    let report = (format!("{}/report.json", stage.folder()), report_json.into_bytes());
    let files: Vec<&(String, Vec<u8>)> = outcome.files.iter().chain([&report]).collect();
    let is_same = files.iter().all(|(file, bytes)| folder.vouches_for(file, bytes));
    let outdated: Vec<String> = Stage::ALL
        .into_iter()
        .filter(|other| *other == stage || (*other > stage && !is_same))
        .flat_map(Stage::writes)
        .filter(|file| !is_same || !files.iter().any(|(written, _)| written == file))
        .collect();
    folder.discard(&outdated)?;
    for (file, bytes) in files {
        folder.write(file, bytes)?;
    }
    Ok(())
}

fn resolve_source(request: &Request) -> Result<Source, Error> {
    source_of(&request.loaded, request.data_dir.as_deref())
}

/// Where a run of this config begins.
pub(crate) fn source_of(loaded: &Loaded, data_dir: Option<&Path>) -> Result<Source, Error> {
    let Loaded { config, base_dir } = loaded;
    config.input.resolve(base_dir, data_dir).map_err(|cause| Error::Input { cause })
}

/// The stages that a run from this source passes through.
pub(crate) fn stages_of(source: &Source) -> Vec<Stage> {
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
    let to = request.to.unwrap_or(Stage::Report);
    if from > to {
        return Err(Error::EmptyRange { from, to });
    }
    Ok(available.into_iter().filter(|stage| (from..=to).contains(stage)).collect())
}

fn artifacts_of(request: &Request, source: &Source) -> Artifacts {
    let Loaded { config, base_dir } = &request.loaded;
    let input = &config.input;
    let mut files = request.files.clone();
    match source {
        Source::Volume(path) => _ = files.entry(Artifact::Volume).or_insert_with(|| path.clone()),
        Source::Tree(path) => _ = files.entry(Artifact::Traced).or_insert_with(|| path.clone()),
        Source::PhantomScan(_) | Source::PhantomTree(_) => {}
    }
    Artifacts {
        files,
        side_paths: SideFile::ALL
            .into_iter()
            .filter_map(|side| Some((side, base_dir.join(side.path_in(config)?))))
            .collect(),
        read_options: espalier_volume::ReadOptions {
            max_bytes: request.max_memory_bytes,
            volume_index: input.volume_index,
            assume_space: input.assume_space,
            unit_mm: (input.unit != Unit::Auto).then(|| input.unit.mm()),
            strict: input.strict,
            series: input.series,
            resample: input.resample,
        },
        orientation: config.volume.orientation,
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
