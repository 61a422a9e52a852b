//! The loop over the stages.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use espalier_model::Diagnose;

use crate::artifacts::Artifacts;
use crate::cache::{Cache, Taken};
use crate::clock::Stopwatch;
use crate::config::{Config, Loaded, Source, Unit};
use crate::doctor;
use crate::error::Error;
use crate::estimate::{Cost, Sizes};
use crate::event::{Event, Took};
use crate::failure;
use crate::folder::{DIGEST_FILE, RunFolder, hex_digest};
use crate::lock::Patience;
use crate::provenance::{self, How, StageCost};
use crate::record::{MadeFrom, Reason, Record};
use crate::scan_of_map;
use crate::settings::{self, Settings};
use crate::side_file::SideFile;
use crate::stage::{Artifact, Stage};
use crate::steps::{self, Step};

/// The second words of the codes of warnings that speak of the input as it lies on the disk.
const READERS: [&str; 7] = ["VOLUME", "NIFTI", "NRRD", "META", "DICOM", "SWC", "POLYDATA"];

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
    let artifacts = artifacts_of(request, &source);
    let input = input_file(&stages, &artifacts);
    let sides = artifacts.side_paths.iter().filter(|(side, _)| stages.contains(&side.stage()));
    if let Some(input) = &input {
        steps::check_readable(input, matches!(source, Source::Volume(_)))?;
    }
    for (side, path) in sides {
        steps::check_readable(path, *side == SideFile::Image)?;
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

/// What a run would do with a stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The stage.
    pub stage: Stage,
    /// Why it would be done; none if its results stand.
    pub reason: Option<Reason>,
    /// Whether its results would be taken from the store that runs share.
    pub is_shared: bool,
    /// What it would cost, where that can be told.
    pub cost: Option<Cost>,
}

/// What a run would do, stage by stage; nothing is written and nothing is locked.
///
/// # Errors
/// [`Error`], as the run itself would before its first stage.
pub fn plan(request: &Request) -> Result<Vec<Plan>, Error> {
    in_pool(request.threads, || planned(request))
}

fn planned(request: &Request) -> Result<Vec<Plan>, Error> {
    let (mut run, stages) = prepare(request, &|_| {})?;
    let folder = RunFolder::to_read(&request.out);
    let settings = Settings::open(&folder, &request.loaded.config);
    run.refuse_other_settings(&folder, &settings, &stages)?;
    run.take_stock_of_input(&stages)?;
    run.refuse_to_overwrite(&folder, &stages)?;
    let mut planned: Vec<Plan> = Vec::new();
    for stage in stages {
        let before = planned.iter().rev().find(|plan| plan.reason.is_some() && stage.follows(plan.stage));
        let (reason, is_shared) = match before.map(|plan| plan.stage) {
            Some(earlier) if !request.force => (Some(Reason::After { stage: earlier }), false),
            _ => {
                let made_from = run.made_from(&folder, &settings, stage)?;
                let reason = run.standing(&folder, stage, &made_from)?.err();
                let is_shared = || run.cache_to_read().is_some_and(|cache| cache.has(stage, &made_from));
                (reason.clone(), reason.is_some() && is_shared())
            }
        };
        planned.push(Plan { stage, reason, is_shared, cost: None });
    }
    let is_to_do = |plan: &Plan| plan.reason.is_some() && !plan.is_shared;
    if planned.iter().any(is_to_do) {
        let costs = costs_of(request, &run.source, &folder, &planned)?;
        for plan in planned.iter_mut().filter(|plan| is_to_do(plan)) {
            plan.cost = costs.iter().find(|(stage, _)| *stage == plan.stage).map(|(_, cost)| *cost);
        }
    }
    Ok(planned)
}

/// What the stages of a run would cost, as far as that can be told: by the reports of the stages that are kept, else from its
/// input.
///
/// # Errors
/// Those of the input, if a stage that is to be done reads it: the run would end with them.
fn costs_of(
    request: &Request,
    source: &Source,
    folder: &RunFolder,
    planned: &[Plan],
) -> Result<Vec<(Stage, Cost)>, Error> {
    let is_to_do = |plan: &&Plan| plan.reason.is_some() && !plan.is_shared;
    let makes_tree = planned.iter().any(|plan| plan.stage <= Stage::Tree && plan.reason.is_some());
    let reads_input = planned.iter().filter(is_to_do).any(|plan| Some(plan.stage) == reader_of(source));
    let of_input = match makes_tree.then(|| doctor::sizes_of(request, source)) {
        Some(Err(error)) if reads_input => return Err(error),
        found => found.and_then(Result::ok).flatten(),
    };
    let sizes = of_input.or_else(|| Sizes::of_reports(folder));
    Ok(sizes.map(|sizes| doctor::costs(request, &stages_of(source), sizes)).unwrap_or_default())
}

/// The stage that reads the user's input.
fn reader_of(source: &Source) -> Option<Stage> {
    match source {
        Source::Volume(_) => Some(Stage::Volume),
        Source::Tree(_) => Some(Stage::Tree),
        Source::PhantomScan(_) | Source::PhantomTree(_) => None,
    }
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

    /// Checks what stages hand over that are not done in this run: results made from it count as long as it is what it was.
    fn check_hand_over(&self, folder: &RunFolder, stages: &[Stage]) -> Result<(), Error> {
        let is_made_here =
            |file: &str| stages.iter().any(|stage| stage.writes().iter().any(|own| own == file));
        let handed = stages.iter().flat_map(|stage| stage.reads());
        let handed = handed.filter(|artifact| !self.artifacts.files.contains_key(artifact));
        for file in handed.map(|artifact| artifact.file()).filter(|file| !is_made_here(file)) {
            let (stated, found) = (folder.digest(file), folder.digest_if_there(file)?);
            if stated.is_some() && found.is_some() && found.as_ref() != stated {
                return Err(Error::Altered { path: folder.path().join(file) });
            }
        }
        Ok(())
    }

    /// Digests of the input's files.
    fn take_stock_of_input(&mut self, stages: &[Stage]) -> Result<(), Error> {
        let (Some(input), Some(&first)) = (&self.input, stages.first()) else { return Ok(()) };
        let files = input_files(&self.source, &self.artifacts, (first, input))?;
        self.refuse_own_input(&files, stages)?;
        self.input_rows = Some(provenance::input_rows(&files)?);
        Ok(())
    }

    /// No result may take the place of what it is made from.
    fn refuse_own_input(&self, files: &[PathBuf], stages: &[Stage]) -> Result<(), Error> {
        let Ok(out) = std::fs::canonicalize(&self.request.out) else { return Ok(()) };
        for path in files {
            let place = std::fs::canonicalize(path).ok();
            let name = place.as_ref().and_then(|place| place.strip_prefix(&out).ok()?.to_str());
            let is_written =
                |name: &str| stages.iter().any(|stage| stage.writes().iter().any(|own| own == name));
            if name.is_some_and(is_written) {
                return Err(Error::InputInTheWay { path: path.clone() });
            }
        }
        Ok(())
    }

    /// No result may take the place of a file that no run has made, unless that is asked for; of a folder in no case.
    fn refuse_to_overwrite(&self, folder: &RunFolder, stages: &[Stage]) -> Result<(), Error> {
        let beside =
            provenance::FILES.into_iter().chain(provenance::FILES_ASIDE).chain([failure::FILE, DIGEST_FILE]);
        let written: Vec<String> =
            stages.iter().flat_map(|stage| stage.writes()).chain(beside.map(str::to_owned)).collect();
        let recorded = recorded(folder);
        // The list of somebody else's files vouches for none of ours.
        let is_list_ours = !recorded.is_empty()
            || ["stages/", "provenance/"].iter().any(|place| folder.vouches_below(place))
            || std::fs::metadata(folder.path().join(DIGEST_FILE)).is_ok_and(|list| list.len() == 0);
        let may_write = self.request.force || folder.was_cut_short();
        for file in written {
            let path = folder.path().join(&file);
            let Ok(there) = std::fs::symlink_metadata(&path) else { continue };
            if there.is_dir() {
                return Err(Error::FolderInTheWay { path });
            }
            let is_listed = is_list_ours && (file == DIGEST_FILE || folder.digest(&file).is_some());
            // In folders of the names that ours have nobody else writes.
            if !may_write && !file.contains('/') && !is_listed && !recorded.contains(&file) {
                return Err(Error::FileInTheWay { path });
            }
        }
        Ok(())
    }

    /// The record of a stage's results, if they are to be kept; else why not.
    fn standing(
        &self,
        folder: &RunFolder,
        stage: Stage,
        made_from: &MadeFrom,
    ) -> Result<Result<Record, Reason>, Error> {
        if self.request.force { Ok(Err(Reason::Forced)) } else { Record::standing(folder, stage, made_from) }
    }

    /// Keeps a stage's results, and repeats what was said of them. The folder's inputs and settings are brought up to date
    /// only with the next results that are written: until then they are those of all that lies there.
    fn keep(&mut self, folder: &mut RunFolder, stage: Stage, record: Record) -> Result<(), Error> {
        let record_file = Record::file_of(stage);
        let own = folder.digest_if_there(&record_file)?.map(|digest| (record_file, digest));
        folder.adopt(record.files().clone().into_iter().chain(own));
        self.kept.push(stage);
        self.repeat_warnings(folder, stage)?;
        let counts = provenance::counts(folder, stage);
        (self.events)(Event::Kept { stage, line: record.line, counts });
        Ok(())
    }

    /// Says again what a stage had to say when its results were made.
    fn repeat_warnings(&mut self, folder: &RunFolder, stage: Stage) -> Result<(), Error> {
        for (code, message) in provenance::warnings(folder, stage)? {
            self.n_warnings += 1;
            let file = self.file_of_warning(stage, &code);
            (self.events)(Event::Warning { stage, code, message, file });
        }
        Ok(())
    }

    /// The user's file that a warning speaks of: the input, where a reader gave the warning.
    fn file_of_warning(&self, stage: Stage, code: &str) -> Option<PathBuf> {
        let read = match stage {
            Stage::Volume => Artifact::Volume,
            Stage::Tree => Artifact::Traced,
            _ => return None,
        };
        let is_of_reader = code.split('-').nth(1).is_some_and(|word| READERS.contains(&word));
        self.artifacts.files.get(&read).filter(|_| is_of_reader).cloned()
    }

    /// The store that runs share, unless all is to be made again.
    fn cache_to_read(&self) -> Option<&Cache> {
        self.request.cache.as_ref().filter(|_| !self.request.force)
    }

    /// A stage's results from the store that runs share.
    fn shared(&self, stage: Stage, made_from: &MadeFrom) -> Option<Taken> {
        self.cache_to_read()?.take(stage, made_from, self.request.max_memory_bytes)
    }

    /// Puts a stage's results in place that another run has made, and repeats what was said of them.
    fn take(
        &mut self,
        folder: &mut RunFolder,
        settings: &mut Settings,
        (stage, made_from): (Stage, MadeFrom),
        (reason, taken): (Reason, Taken),
    ) -> Result<(), Error> {
        let watch = Stopwatch::start();
        let Taken { files, line } = taken;
        self.put_in_place(folder, settings, (stage, made_from), (&files, &line))?;
        let (how, seconds) = (How::Shared, watch.seconds());
        let cost = StageCost { stage, how, seconds, cpu_seconds: None, peak_mb: None, parts: Vec::new() };
        self.note_cost(folder, cost)?;
        self.repeat_warnings(folder, stage)?;
        let counts = provenance::counts(folder, stage);
        (self.events)(Event::Taken { stage, reason, line, counts });
        Ok(())
    }

    /// Does a stage and writes what it made.
    fn make(
        &mut self,
        folder: &mut RunFolder,
        settings: &mut Settings,
        (stage, made_from): (Stage, MadeFrom),
        reason: Reason,
    ) -> Result<(), Error> {
        let (config, events) = (&self.request.loaded.config, self.events);
        events(Event::Started { stage, reason });
        let (watch, cpu_before) = (Stopwatch::start(), provenance::cpu_seconds());
        let (source, artifacts) = (&self.source, &mut self.artifacts);
        let mut step = Step { stage, config, source, artifacts, events, folder, parts: Vec::new() };
        folder.take_reads();
        let steps::Outcome { mut files, report, line } = steps::perform(&mut step)?;
        let parts = step.parts;
        debug_assert_eq!(undeclared(stage, folder.take_reads()), [""; 0], "read by {stage}");
        let report_file = format!("{}/report.json", stage.folder());
        files.push((report_file, provenance::report_json(stage, &report).into_bytes()));
        let record = self.put_in_place(folder, settings, (stage, made_from), (&files, &line))?;
        let (seconds, peak_mb) = (watch.seconds(), provenance::peak_memory_mb());
        let cpu_seconds = provenance::cpu_seconds().zip(cpu_before).map(|(now, before)| now - before);
        let told = parts.iter().map(|part| (part.name.clone(), part.seconds, part.peak_mb)).collect();
        self.note_cost(folder, StageCost { stage, how: How::Made, seconds, cpu_seconds, peak_mb, parts })?;
        self.share(stage, &record, &files);
        self.n_warnings += report.warnings.len();
        for warning in report.warnings {
            let (code, file) = (warning.code.to_owned(), self.file_of_warning(stage, warning.code));
            events(Event::Warning { stage, code, message: warning.message, file });
        }
        let counts = report.counts.iter().map(|count| (count.name.to_owned(), count.value)).collect();
        events(Event::Finished { stage, line, counts, cost: Took { seconds, peak_mb, parts: told } });
        Ok(())
    }

    /// Writes a stage's files with all that speaks of them.
    fn put_in_place(
        &mut self,
        folder: &mut RunFolder,
        settings: &mut Settings,
        (stage, made_from): (Stage, MadeFrom),
        (files, line): (&[(String, Vec<u8>)], &str),
    ) -> Result<Record, Error> {
        self.clear_away(folder, stage)?;
        self.settle_kept(folder, settings)?;
        let record = write_files(folder, (stage, made_from), files, line)?;
        self.write_provenance(folder, settings, stage)?;
        folder.seal()?;
        Ok(record)
    }

    /// Notes what a stage has cost, beside the results.
    fn note_cost(&mut self, folder: &RunFolder, cost: StageCost) -> Result<(), Error> {
        self.costs.push(cost);
        let files = (self.input.as_deref(), &self.artifacts.side_paths);
        provenance::write_run(folder, &self.request.loaded.config, files, &self.costs)
    }

    /// Stores what a stage has made for other runs. This one has its results: a store that cannot be written to is said,
    /// once, and no reason to stop.
    fn share(&mut self, stage: Stage, record: &Record, files: &[(String, Vec<u8>)]) {
        let Some(cache) = &self.request.cache else { return };
        match cache.keep(stage, record, files) {
            Ok(()) => self.has_stored = true,
            Err(error) if !self.is_store_lost => {
                self.is_store_lost = true;
                self.n_warnings += 1;
                let message = format!("results are not shared: {error}");
                let code = "W-RUN-CACHE".to_owned();
                (self.events)(Event::Warning { stage, code, message, file: Some(cache.folder.clone()) });
            }
            Err(_) => {}
        }
    }

    /// Inputs and settings of the stages that were kept.
    fn settle_kept(&mut self, folder: &mut RunFolder, settings: &mut Settings) -> Result<(), Error> {
        std::mem::take(&mut self.kept)
            .into_iter()
            .try_for_each(|stage| self.write_provenance(folder, settings, stage))
    }

    /// Inputs and settings as far as they are a stage's.
    fn write_provenance(
        &self,
        folder: &mut RunFolder,
        settings: &mut Settings,
        stage: Stage,
    ) -> Result<(), Error> {
        if Some(stage) == stages_of(&self.source).first().copied() {
            provenance::write_inputs(folder, self.input_rows.as_deref().unwrap_or_default())?;
        }
        for side in SideFile::ALL.into_iter().filter(|side| side.stage() == stage) {
            provenance::write_side_file(folder, side, &self.artifacts.files_beside(side, stage)?)?;
        }
        settings.adopt(folder, stage)
    }

    /// All that a stage's results depend on, as it is now.
    fn made_from(&self, folder: &RunFolder, settings: &Settings, stage: Stage) -> Result<MadeFrom, Error> {
        let mut facts = settings.of(stage);
        let version = format!("{} of espalier {}", stage.version(), env!("CARGO_PKG_VERSION"));
        facts.insert("version".to_owned(), version);
        let is_traced = stage == Stage::Tree && self.artifacts.is_traced(&self.source);
        let artifacts = if is_traced { &[Artifact::Traced] } else { stage.reads() };
        // Of the files that the user names it may read others too; and what lies in the folder beside them does not count.
        let named = self.request.files.keys();
        for artifact in artifacts.iter().chain(named) {
            let digest = match self.artifacts.files.get(artifact) {
                Some(path) => Some(self.digest_of_input(*artifact, path)?),
                None => folder.digest(artifact.file()).cloned(),
            };
            facts.extend(digest.map(|digest| (artifact.what().to_owned(), digest)));
        }
        facts.insert("files named".to_owned(), (!self.request.files.is_empty()).to_string());
        for file in stage.reads_beside() {
            facts.extend(folder.digest(&file).cloned().map(|digest| (file, digest)));
        }
        for (side, path) in self.artifacts.side_paths.iter().filter(|(side, _)| side.stage() == stage) {
            let digest = provenance::digest_of_all(&self.artifacts.files_beside(*side, stage)?, path)?;
            facts.insert(side.key().to_owned(), digest);
        }
        // A map that shows the run's own input depends on it.
        let shows_input = stage == Stage::Render && scan_of_map::is_of_input(&self.request.loaded.config);
        if let (true, Some(path)) = (shows_input, self.artifacts.files.get(&Artifact::Volume)) {
            let rows = provenance::input_rows(&input_files(&self.source, &self.artifacts, (stage, path))?)?;
            facts.insert(Artifact::Volume.what().to_owned(), hex_digest(rows.as_bytes()));
        }
        Ok(MadeFrom(facts))
    }

    /// The digest of a file that the user names; of a series, or a header with its data, one over all of its files.
    fn digest_of_input(&self, artifact: Artifact, path: &Path) -> Result<String, Error> {
        match (&self.input_rows, artifact) {
            (Some(rows), Artifact::Volume | Artifact::Traced) => Ok(hex_digest(rows.as_bytes())),
            (_, Artifact::Volume | Artifact::Mask | Artifact::Skeleton) => {
                // What cannot be read is told by the stage that reads it.
                let files = espalier_volume::files(path, &self.artifacts.read_options).unwrap_or_default();
                provenance::digest_of_all(&files, path)
            }
            _ => provenance::digest(path),
        }
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
        if input.exists() && self.is_other_input(folder, available[0], input)? {
            return Err(Error::OtherInput { from, path: input.clone(), first: available[0] });
        }
        Ok(())
    }

    fn is_other_input(&self, folder: &RunFolder, first: Stage, input: &Path) -> Result<bool, Error> {
        let files = input_files(&self.source, &self.artifacts, (first, input))?;
        provenance::is_other_input(folder, &files)
    }

    /// The stages whose files in the folder are not of this run: all, if input or seed are others; else those that a run
    /// from this input does not have.
    fn foreign(&self, settings: &Settings) -> Vec<Stage> {
        let available = stages_of(&self.source);
        let is_foreign = |stage: &Stage| settings.is_other_run() || !available.contains(stage);
        if self.request.files.is_empty() {
            Stage::ALL.into_iter().filter(is_foreign).collect()
        } else {
            Vec::new()
        }
    }

    /// Removes the files of another run, but for those of this stage and the ones before, which are in place.
    fn clear_away(&mut self, folder: &mut RunFolder, done: Stage) -> Result<(), Error> {
        let available = stages_of(&self.source);
        let foreign = std::mem::take(&mut self.foreign).into_iter();
        let outdated = foreign.filter(|stage| *stage > done || !available.contains(stage));
        folder.discard(&outdated.flat_map(Stage::writes).collect::<Vec<_>>())
    }
}

/// The files that an input is read from: several where it is a DICOM series, or a header with its data.
fn input_files(
    source: &Source,
    artifacts: &Artifacts,
    (stage, input): (Stage, &Path),
) -> Result<Vec<PathBuf>, Error> {
    match source {
        Source::Volume(_) => espalier_volume::files(input, &artifacts.read_options)
            .map_err(|error| Error::stage(stage)(boxed(error))),
        _ => Ok(vec![input.to_owned()]),
    }
}

/// Writes a stage's files, its record last. What was made from another version of them goes first.
fn write_files(
    folder: &mut RunFolder,
    (stage, made_from): (Stage, MadeFrom),
    files: &[(String, Vec<u8>)],
    line: &str,
) -> Result<Record, Error> {
    let is_written = |file: &String| files.iter().any(|(written, _)| written == file);
    let gone = stage.writes().into_iter().filter(|file| !is_written(file) && folder.digest(file).is_some());
    let new = files.iter().filter(|(file, bytes)| !folder.vouches_for(file, bytes));
    let changed: BTreeSet<String> = gone.chain(new.map(|(file, _)| file.clone())).collect();
    folder.discard(&outdated(stage, changed))?;
    for (file, bytes) in files {
        folder.write(file, bytes)?;
    }
    let digest = |(file, _): &(String, Vec<u8>)| Some((file.clone(), folder.digest(file)?.clone()));
    let digests = files.iter().filter_map(digest).collect();
    let record = Record::new(stage, made_from, digests, line.to_owned());
    folder.write(&Record::file_of(stage), record.to_json().as_bytes())?;
    Ok(record)
}

/// The files that do not hold any more once some files of a stage change: those of the stage itself, and those of later
/// stages that read one of them.
fn outdated(stage: Stage, mut changed: BTreeSet<String>) -> Vec<String> {
    let earlier: BTreeSet<String> =
        Stage::ALL.into_iter().filter(|s| *s < stage).flat_map(Stage::writes).collect();
    let kept: BTreeSet<String> = stage.writes().into_iter().filter(|file| !changed.contains(file)).collect();
    for later in Stage::ALL.into_iter().filter(|later| *later > stage) {
        if later.files_read().any(|file| changed.contains(&file)) {
            changed.extend(later.writes());
        }
    }
    changed.into_iter().filter(|file| !earlier.contains(file) && !kept.contains(file)).collect()
}

/// The files that a stage has read without being known to: its results would be kept when one of them changes.
fn undeclared(stage: Stage, reads: BTreeSet<String>) -> Vec<String> {
    let known: Vec<String> = stage.files_read().collect();
    reads.into_iter().filter(|file| !known.contains(file)).collect()
}

/// The files that the records in a folder name.
fn recorded(folder: &RunFolder) -> BTreeSet<String> {
    let record = |stage: Stage| {
        let bytes = folder.bytes_if_there(&Record::file_of(stage)).ok().flatten()?;
        Record::parsed(stage, &bytes)
    };
    let records = Stage::ALL.into_iter().filter_map(record);
    records.flat_map(|record| record.files().keys().cloned().collect::<Vec<_>>()).collect()
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

pub(crate) fn artifacts_of(request: &Request, source: &Source) -> Artifacts {
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
