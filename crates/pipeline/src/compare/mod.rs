//! Methods, or runs, side by side: one table, one figure.
//!
//! **Input** run folders, or configs to be run up to the embedding. **Output** in a folder of its own: `compare.tsv`
//! and `compare.json` with a row per run and method, `compare.png` and `compare.svg`, `dictionary.tsv`, sealed by
//! `SHA256SUMS`; and the table as text for a terminal.
//! **Guarantees** no result holds a time; the terminal's table takes seconds from each run's `timings.tsv`. Crossings are
//! counted again from the layouts as written.

pub(crate) mod figure;
pub(crate) mod terminal;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use espalier_model::{ComparedRun, ComparedRuns, Comparison, Tree, ViewHierarchy};

use crate::artifacts::{Artifacts, Lookup};
use crate::cache::Cache;
use crate::config::{Config, Loaded, Override};
use crate::dictionary;
use crate::error::Error;
use crate::event::Event;
use crate::folder::RunFolder;
use crate::provenance;
use crate::run::{self, Request, Summary, in_pool};
use crate::settings;
use crate::stage::{Artifact, Stage};

/// A comparison to be made.
#[derive(Clone, Debug)]
pub struct CompareRequest {
    /// What to compare, in this order.
    pub subjects: Vec<Subject>,
    /// Where the results go; the run of a config goes to a folder of its name in there.
    pub out: PathBuf,
    /// What the command line changes; of finished runs only the pictures.
    pub overrides: Vec<Override>,
    /// As in [`Request`].
    pub threads: Option<usize>,
    /// As in [`Request`].
    pub max_memory_bytes: u64,
    /// As in [`Request`].
    pub data_dir: Option<PathBuf>,
    /// As in [`Request`].
    pub cache: Option<Cache>,
}

/// Something to compare.
#[derive(Clone, Debug)]
pub enum Subject {
    /// A run folder.
    Run(PathBuf),
    /// A config to be run.
    Config(Box<Loaded>),
}

/// Where and how far a config is run.
pub(crate) struct Place {
    pub(crate) out: PathBuf,
    pub(crate) to: Stage,
    pub(crate) threads: Option<usize>,
    pub(crate) max_memory_bytes: u64,
    pub(crate) data_dir: Option<PathBuf>,
    pub(crate) cache: Option<Cache>,
}

impl Subject {
    /// The run folder; a config is run first.
    pub(crate) fn folder(&self, place: Place, events: &(dyn Fn(Event) + Sync)) -> Result<PathBuf, Error> {
        let loaded = match self {
            Self::Run(folder) => return Ok(folder.clone()),
            Self::Config(loaded) => loaded.as_ref().clone(),
        };
        let Place { out, to, threads, max_memory_bytes, data_dir, cache } = place;
        let run = Request {
            loaded,
            out,
            from: None,
            to: Some(to),
            files: std::collections::BTreeMap::new(),
            force: false,
            wait: false,
            threads,
            max_memory_bytes,
            data_dir,
            cache,
        };
        run::run(&run, events).map(|summary| summary.out)
    }
}

/// What a comparison came to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Compared {
    /// The table, for a terminal.
    pub table: String,
    /// The folder and its digest.
    pub summary: Summary,
}

/// A run as it was read.
struct Found {
    name: String,
    config: Config,
    tree: Arc<Tree>,
    is_of_scan: bool,
    views: Arc<ViewHierarchy>,
    comparison: Arc<Comparison>,
    /// Seconds of each method, where the run has noted them.
    seconds: Vec<(String, f64)>,
}

/// Compares methods and runs.
///
/// # Errors
/// [`Error`] if a folder holds no run, a config cannot be run, or the results cannot be written.
pub fn compare(request: &CompareRequest, events: &(dyn Fn(Event) + Sync)) -> Result<Compared, Error> {
    if request.out.join(settings::FILE).exists() {
        return Err(Error::RunInTheWay { folder: request.out.clone() });
    }
    let names = names(&request.subjects);
    let mut folders = Vec::new();
    for (subject, name) in request.subjects.iter().zip(&names) {
        let place = Place {
            out: request.out.join(name),
            to: Stage::Embed,
            threads: request.threads,
            max_memory_bytes: request.max_memory_bytes,
            data_dir: request.data_dir.clone(),
            cache: request.cache.clone(),
        };
        folders.push(subject.folder(place, events)?);
    }
    in_pool(request.threads, || {
        let runs = folders.iter().zip(names).map(|(folder, name)| read_run(request, folder, name));
        let runs: Vec<Found> = runs.collect::<Result<_, _>>()?;
        let (rows, files) = results(request, &runs)?;
        let table = terminal::table(&rows, &runs.iter().map(|run| &run.seconds[..]).collect::<Vec<_>>());
        let highlights = files.iter().map(|(file, _)| file.clone()).collect();
        let mut folder = RunFolder::open(&request.out)?;
        for (file, bytes) in &files {
            folder.write(file, bytes)?;
        }
        let summary = Summary { out: request.out.clone(), highlights, digest: folder.seal()? };
        Ok(Compared { table, summary })
    })
}

/// A name for each subject, no two alike.
pub(crate) fn names(subjects: &[Subject]) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for subject in subjects {
        let name = match subject {
            Subject::Run(folder) => fs::canonicalize(folder)
                .unwrap_or_else(|_| folder.clone())
                .file_name()
                .map_or_else(|| "run".to_owned(), |name| name.to_string_lossy().into_owned()),
            Subject::Config(loaded) => loaded.config.name.clone(),
        };
        let free = (1..).map(|n| if n == 1 { name.clone() } else { format!("{name}-{n}") });
        names.extend(free.into_iter().find(|candidate| !names.contains(candidate)));
    }
    names
}

/// What pictures call each run, by its config and its name in the table: its title, or the name that its config gives it,
/// with the table's name behind it where another is called the same; else the table's name.
pub(crate) fn titles(runs: &[(&Config, &str)]) -> Vec<String> {
    let title = |config: &Config| config.render.title.clone().or(config.own_name().map(str::to_owned));
    let own: Vec<Option<String>> = runs.iter().map(|(config, _)| title(config)).collect();
    let called = |(own_title, (_, name)): (&Option<String>, &(&Config, &str))| match own_title {
        None => (*name).to_owned(),
        Some(title) if title == name || own.iter().filter(|other| *other == own_title).count() == 1 => {
            title.clone()
        }
        Some(title) => format!("{title} ({name})"),
    };
    own.iter().zip(runs).map(called).collect()
}

/// Reads a run folder, every file checked against the folder's digests.
fn read_run(request: &CompareRequest, path: &Path, name: String) -> Result<Found, Error> {
    for missing in
        [settings::FILE, Artifact::Tree.file(), Artifact::Views.file(), Artifact::Comparison.file()]
    {
        if !path.join(missing).exists() {
            return Err(Error::NoRun { folder: path.to_owned(), missing });
        }
    }
    let folder = RunFolder::to_read(path);
    folder.check_all()?;
    let mut artifacts = Artifacts {
        read_options: espalier_volume::ReadOptions {
            max_bytes: request.max_memory_bytes,
            ..espalier_volume::ReadOptions::default()
        },
        ..Artifacts::default()
    };
    let lookup = Lookup { folder: &folder, stage: Stage::Render };
    let (tree, views) = (artifacts.tree(lookup)?, artifacts.views(lookup)?);
    let missing = || Error::NoRun { folder: path.to_owned(), missing: Artifact::Comparison.file() };
    let comparison = artifacts.comparison(lookup)?.ok_or_else(missing)?;
    check_crossings(&tree, &comparison, &path.join(Artifact::Comparison.file()))?;
    let config = own_config(request, &folder)?;
    let seconds = provenance::method_seconds(&folder, Stage::Embed);
    Ok(Found { name, config, tree, is_of_scan: artifacts.is_of_scan, views, comparison, seconds })
}

/// The config of a run under the overrides of the comparison.
fn own_config(request: &CompareRequest, folder: &RunFolder) -> Result<Config, Error> {
    let is_finished = request.subjects.iter().any(|s| matches!(s, Subject::Run(run) if run == folder.path()));
    let of_pictures = |set: &&Override| set.key.starts_with("render.");
    if let (true, Some(other)) = (is_finished, request.overrides.iter().find(|set| !of_pictures(set))) {
        return Err(Error::Settled { key: other.key.clone(), folder: folder.path().to_owned() });
    }
    let text = String::from_utf8_lossy(&folder.read(settings::FILE)?).into_owned();
    let overrides: Vec<Override> = request.overrides.iter().filter(of_pictures).cloned().collect();
    Config::parse(&text, &folder.path().join(settings::FILE), &overrides).map_err(Error::from)
}

/// What a file says of its layouts is checked before a table repeats it.
pub(crate) fn check_crossings(tree: &Tree, comparison: &Comparison, path: &Path) -> Result<(), Error> {
    for layout in &comparison.layouts {
        let found = espalier_embed::certify(tree, &layout.positions_mm).crossings;
        if found != layout.row.crossings {
            return Err(Error::Certificate { path: path.to_owned(), stated: layout.row.crossings, found });
        }
    }
    Ok(())
}

/// The files of a comparison by name, with their bytes.
pub(crate) type Files = Vec<(String, Vec<u8>)>;

fn results(request: &CompareRequest, runs: &[Found]) -> Result<(ComparedRuns, Files), Error> {
    let rows = ComparedRuns { runs: runs.iter().map(rows_of).collect() };
    let mut params = runs.first().map(|run| run.config.render.clone()).unwrap_or_default();
    params.title.get_or_insert_with(|| match runs {
        [only] => only.config.own_name().unwrap_or(&only.name).to_owned(),
        several => format!("{} runs", several.len()),
    });
    let called: Vec<(&Config, &str)> = runs.iter().map(|run| (&run.config, run.name.as_str())).collect();
    let titles = titles(&called);
    let title = |idx: usize| (runs.len() > 1).then_some(titles[idx].as_str());
    let subject = |(idx, run)| figure_subject(run, title(idx), params.compass);
    let subjects: Vec<figure::Subject<'_>> = runs.iter().enumerate().map(subject).collect();
    let drawn = figure::draw(&subjects, &params).map_err(|error| Error::file(&request.out, error))?;
    let mut files = vec![
        ("compare.tsv".to_owned(), rows.to_tsv().into_bytes()),
        ("compare.json".to_owned(), rows.to_json().into_bytes()),
        ("dictionary.tsv".to_owned(), dictionary::of_runs().into_bytes()),
    ];
    files.extend(drawn);
    Ok((rows, files))
}

fn figure_subject<'a>(
    run: &'a Found,
    name: Option<&'a str>,
    compass: espalier_render::Compass,
) -> figure::Subject<'a> {
    figure::Subject {
        name,
        tree: &run.tree,
        views: &run.views,
        comparison: &run.comparison,
        compass: figure::compass(compass, run.is_of_scan),
    }
}

fn rows_of(run: &Found) -> ComparedRun {
    let comparison = &run.comparison;
    ComparedRun {
        name: run.name.clone(),
        tree: comparison.tree.clone(),
        targets: comparison.targets.clone(),
        seed: comparison.seed,
        chosen: comparison.chosen,
        rows: comparison.layouts.iter().map(|layout| layout.row.clone()).collect(),
    }
}
