//! A run: which stages there are to do, and one after the other done, kept or taken from the store.
//!
//! | step | file | what |
//! |--:|---|---|
//! | 1 | `source` | what a run begins with, its stages, its files |
//! | 2 | `refuse` | what a run will not do: build on other results, write over what is not its own |
//! | 3 | `key` | all that a stage's results depend on |
//! | 4 | `stage` | one stage kept, taken from the store, or made |
//! | 5 | `record` | results put in place with all that speaks of them |
//! | | `plan` | the same without doing it: which stages, why, at what cost |

mod key;
mod plan;
mod record;
mod refuse;
mod source;
mod stage;

use std::collections::BTreeMap;
use std::path::PathBuf;

use espalier_model::Diagnose;

use crate::artifacts::Artifacts;
use crate::cache::Cache;
use crate::clock::Stopwatch;
use crate::config::{Loaded, Source};
use crate::error::Error;
use crate::event::Event;
use crate::failure;
use crate::folder::{DIGEST_FILE, RunFolder};
use crate::lock::Patience;
use crate::provenance::{self, StageCost};
use crate::settings::{self, Settings};
use crate::stage::{Artifact, Stage};
use crate::steps;
use crate::{scan_of_map, scan_of_walls};

pub use plan::{Plan, plan};
pub use source::default_folder;
pub(crate) use source::{artifacts_of, source_of, stages_of};
use source::{input_file, input_files, resolve_source, stages_to_do};

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
    /// Whether stages are done also where their results stand.
    pub force: bool,
    /// Whether to wait for another run that holds the folder, rather than to stop.
    pub wait: bool,
    /// Threads; `None` for one per core. No result depends on it.
    pub threads: Option<usize>,
    /// The most memory that a stage may take, in bytes.
    pub max_memory_bytes: u64,
    /// What `$ESPALIER_DATA` stands for.
    pub data_dir: Option<PathBuf>,
    /// Results that runs share, if they do.
    pub cache: Option<Cache>,
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
    let watch = Stopwatch::start();
    let (mut run, stages) = prepare(request, events)?;
    let say_so = || events(Event::Waiting { out: request.out.clone() });
    let patience = if request.wait { Patience::Wait(&say_so) } else { Patience::None };
    let mut folder = RunFolder::open_or_wait(&request.out, patience)?;
    folder.forget_unless(is_known);
    folder.remove_leftovers(&every_file());
    failure::clear(&folder);
    let done = run.perform(&mut folder, &stages);
    if let (Some(cache), true) = (&request.cache, run.has_stored) {
        cache.make_room();
    }
    if let Err(error) = &done {
        if folder.is_unused() {
            folder.remove();
        } else {
            failure::write(&folder, error);
            folder.leave_as_found();
        }
        let kept = run.costs.iter().map(|cost| cost.stage).collect();
        events(Event::Stopped { kept, out: request.out.clone() });
    }
    let digest = done?;
    let highlights = stages.last().map(|last| last.writes()).unwrap_or_default();
    let is_highlight = |file: &String| !file.ends_with("/record.json") && folder.path().join(file).exists();
    let highlights: Vec<String> = highlights.into_iter().filter(is_highlight).collect();
    events(Event::Ended {
        out: request.out.clone(),
        files: highlights.clone(),
        digest: digest.clone(),
        crossings: crossings(&folder, &stages),
        seconds: watch.seconds(),
        peak_mb: provenance::peak_memory_mb(),
        n_warnings: run.n_warnings,
    });
    Ok(Summary { out: request.out.clone(), highlights, digest })
}

/// How many crossings the embedding of a run has, by its certificate; none where the run has not come to one.
fn crossings(folder: &RunFolder, stages: &[Stage]) -> Option<u64> {
    let has_embedding = stages.last().is_some_and(|last| *last >= Stage::Embed);
    let counts = has_embedding.then(|| provenance::counts(folder, Stage::Embed))?;
    counts.get("crossings").map(|crossings| *crossings as u64)
}

/// A run that has all it needs, and its stages. Nothing is made yet: a missing input must not leave a folder behind.
fn prepare<'a>(
    request: &'a Request,
    events: &'a (dyn Fn(Event) + Sync),
) -> Result<(Run<'a>, Vec<Stage>), Error> {
    let source = resolve_source(request)?;
    let stages = stages_to_do(request, &source)?;
    if stages.contains(&Stage::Render) {
        let refused = |problem| Error::stage(Stage::Render)(boxed(problem));
        scan_of_map::check(&request.loaded.config, &source).map_err(refused)?;
    }
    if stages.contains(&Stage::Radius) {
        let refused = |problem| Error::stage(Stage::Radius)(boxed(problem));
        scan_of_walls::check(&request.loaded.config, &source).map_err(refused)?;
    }
    let artifacts = artifacts_of(request, &source);
    let input = input_file(&stages, &artifacts);
    let sides = artifacts.side_paths.iter().filter(|(side, _)| stages.contains(&side.stage()));
    if let Some(input) = &input {
        steps::check_readable(input, matches!(source, Source::Volume(_)))?;
    }
    for (side, path) in sides {
        steps::check_readable(path, side.is_volume())?;
    }
    let run = Run {
        request,
        source,
        artifacts,
        events,
        input,
        input_rows: None,
        foreign: Vec::new(),
        kept: Vec::new(),
        costs: Vec::new(),
        has_stored: false,
        is_store_lost: false,
        n_warnings: 0,
    };
    Ok((run, stages))
}

/// A run under way.
struct Run<'a> {
    request: &'a Request,
    source: Source,
    artifacts: Artifacts,
    events: &'a (dyn Fn(Event) + Sync),
    /// The file that the first stage begins with, if it is the user's.
    input: Option<PathBuf>,
    /// The rows of `provenance/inputs.tsv` for it, if it is.
    input_rows: Option<String>,
    /// Stages whose files in the folder are of another run.
    foreign: Vec<Stage>,
    /// Stages that were kept, as long as inputs and settings do not yet say so.
    kept: Vec<Stage>,
    costs: Vec<StageCost>,
    /// Whether something has come to the store that runs share.
    has_stored: bool,
    /// Whether it was said that nothing comes there.
    is_store_lost: bool,
    /// Warnings of all stages, also of those that were kept.
    n_warnings: usize,
}

impl Run<'_> {
    /// Does the stages one after the other, but for those whose results stand; gives the digest of the sealed folder.
    fn perform(&mut self, folder: &mut RunFolder, stages: &[Stage]) -> Result<String, Error> {
        let mut settings = Settings::open(folder, &self.request.loaded.config);
        self.refuse_other_settings(folder, &settings, stages)?;
        self.check_hand_over(folder, stages)?;
        self.take_stock_of_input(stages)?;
        self.refuse_to_overwrite(folder, stages)?;
        self.foreign = self.foreign(&settings);
        (self.events)(Event::Opened {
            out: self.request.out.clone(),
            stages: stages.to_vec(),
            settings: settings::changed(&self.request.loaded.config, stages),
        });
        for &stage in stages {
            folder.turn_to(stage);
            if stage == Stage::Report {
                // It reads the inputs of all stages before, which are in place by now.
                self.settle_kept(folder, &mut settings)?;
                folder.seal()?;
            }
            let made_from = self.made_from(folder, &settings, stage)?;
            match self.standing(folder, stage, &made_from)? {
                Ok(record) => self.keep(folder, stage, record)?,
                Err(reason) => match self.shared(stage, &made_from) {
                    Some(taken) => self.take(folder, &mut settings, (stage, made_from), (reason, taken))?,
                    None => self.make(folder, &mut settings, (stage, made_from), reason)?,
                },
            }
        }
        stages.last().map_or(Ok(()), |&last| self.clear_away(folder, last))?;
        self.settle_kept(folder, &mut settings)?;
        folder.seal()
    }

    /// Digests of the input's files.
    fn take_stock_of_input(&mut self, stages: &[Stage]) -> Result<(), Error> {
        let named: Vec<PathBuf> = self.artifacts.files.values().cloned().collect();
        self.refuse_own_input(&named, stages)?;
        let (Some(input), Some(&first)) = (&self.input, stages.first()) else { return Ok(()) };
        let files = input_files(&self.source, &self.artifacts, (first, input))?;
        self.refuse_own_input(&files, stages)?;
        self.input_rows = Some(provenance::input_rows(&files)?);
        Ok(())
    }
}

/// Every file that a run may write, relative to its folder.
fn every_file() -> Vec<String> {
    let of_stages = Stage::ALL.into_iter().flat_map(Stage::writes);
    let beside =
        provenance::FILES.into_iter().chain(provenance::FILES_ASIDE).chain([failure::FILE, DIGEST_FILE]);
    of_stages.chain(beside.map(str::to_owned)).collect()
}

/// Whether a file of a run folder is one that `SHA256SUMS` may name.
fn is_known(file: &str) -> bool {
    provenance::FILES.contains(&file)
        || Stage::ALL.into_iter().any(|stage| stage.writes().iter().any(|own| own == file))
}

/// Boxes a stage's error.
pub(crate) fn boxed(error: impl Diagnose + Send + Sync + 'static) -> Box<dyn Diagnose + Send + Sync> {
    Box::new(error)
}
