//! A config at many settings: the parameter analysis of section 5.3.1 of [Hu2022], over any keys.
//!
//! **Input** a config, keys with lists of values. **Output** in a folder of its own: `base/`, the stages that no key
//! changes, run once; `runs/NNN/`, the stages from the first changed one to the embedding, for each combination;
//! `sweep.tsv` with one row per combination, `sweep.png` and `sweep.svg` with the losses against the first key,
//! `dictionary.tsv`, sealed by `SHA256SUMS`.
//! **Steps** 1. All combinations, the last key fastest. 2. If no combination is a legal config, that is an error; if some
//! are not, their rows say why. 3. The base. 4. Each combination; crossings are counted again from its layouts as
//! written. What cannot be embedded is a row with the reason; what cannot be written ends the sweep.
//! **Guarantees** a row is what `espalier run` with those settings comes to; the same bytes for any number of threads.
//! The topology ledger of a run in `runs/` tells of the stages that were done there.
//! **Source** [Hu2022] section 5.3.1.

mod plot;
mod rows;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use espalier_model::MethodRow;
use espalier_model::diagnose::{Class, Diagnose};

use crate::artifacts::{Artifacts, Lookup};
use crate::cache::Cache;
use crate::compare::{self, Files};
use crate::config::{Loaded, Override, Source};
use crate::error::{Error, NotSwept};
use crate::event::Event;
use crate::folder::RunFolder;
use crate::run::{self, Request, Summary, boxed, in_pool};
use crate::settings;
use crate::stage::{Artifact, Stage};

/// The most combinations: each is a run with files of its own.
pub(crate) const MOST_COMBINATIONS: u64 = 10_000;

/// A sweep to be made.
#[derive(Clone, Debug)]
pub struct SweepRequest {
    /// A config, or an input with every setting at its default.
    pub config_or_input: PathBuf,
    /// What all combinations have in common, beside the config.
    pub overrides: Vec<Override>,
    /// The keys and their values; the first is the x axis of the plot.
    pub axes: Vec<Axis>,
    /// Where the results go; `None` for `out/NAME-sweep`.
    pub out: Option<PathBuf>,
    /// As in [`Request`].
    pub threads: Option<usize>,
    /// As in [`Request`].
    pub max_memory_bytes: u64,
    /// As in [`Request`].
    pub data_dir: Option<PathBuf>,
    /// As in [`Request`].
    pub cache: Option<Cache>,
}

/// A key and its values.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Axis {
    /// The dotted key, such as `embed.w_length`.
    pub key: String,
    /// Its values as they would be written after `--set KEY=`.
    pub values: Vec<String>,
}

/// What a sweep came to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Swept {
    /// The table, for a terminal.
    pub table: String,
    /// The folder and its digest.
    pub summary: Summary,
}

/// A combination of values and what it came to.
struct Combination {
    /// One value for each axis.
    values: Vec<String>,
    /// The row of the embedding, or why there is none.
    outcome: Result<MethodRow, String>,
}

/// Embeds a config at every combination of values.
///
/// # Errors
/// [`Error`] if a key is unknown or in vain, no combination is a legal config, the stages that they share cannot be
/// done, or a result cannot be written.
pub fn sweep(request: &SweepRequest, events: &(dyn Fn(Event) + Sync)) -> Result<Swept, Error> {
    let changed = first_changed(&request.axes)?;
    let combinations = combinations(&request.axes)?;
    let configs: Vec<Result<Loaded, Error>> =
        combinations.iter().map(|values| config_at(request, values)).collect();
    let legal = configs.iter().find_map(|config| config.as_ref().ok());
    // Where no combination is legal, the first says why.
    let first = legal.cloned().map_or_else(|| config_at(request, &combinations[0]), Ok)?;
    let out = request
        .out
        .clone()
        .unwrap_or_else(|| PathBuf::from("out").join(format!("{}-sweep", first.config.name)));
    if out.join(settings::FILE).exists() {
        return Err(Error::RunInTheWay { folder: out });
    }
    let base = Base::prepare(request, &first, changed, (&out, events))?;
    let total = combinations.len();
    let mut done = Vec::new();
    for (idx, (values, config)) in combinations.into_iter().zip(configs).enumerate() {
        let folder = out.join("runs").join(format!("{:03}", idx + 1));
        let outcome = match config.and_then(|loaded| base.embed(request, loaded, &folder)) {
            Ok(row) => Ok(row),
            Err(error) if matches!(error.class(), Class::Io | Class::CannotCreate | Class::Locked) => {
                return Err(error);
            }
            Err(error) => Err(error.to_string().lines().next().unwrap_or_default().to_owned()),
        };
        let combination = Combination { values, outcome };
        let line = rows::phrase(&request.axes, &combination);
        events(Event::Combination { done: idx + 1, total, line });
        done.push(combination);
    }
    let files = in_pool(request.threads, || results(request, &first, &done))?;
    let mut folder = RunFolder::open(&out)?;
    for (file, bytes) in &files {
        folder.write(file, bytes)?;
    }
    let highlights = files.into_iter().map(|(file, _)| file).collect();
    let summary = Summary { digest: folder.seal()?, out, highlights };
    Ok(Swept { table: rows::terminal(&request.axes, &done), summary })
}

fn results(request: &SweepRequest, first: &Loaded, done: &[Combination]) -> Result<Files, Error> {
    let mut params = first.config.render.clone();
    let own_name = first.config.own_name().unwrap_or("sweep");
    let title = params.title.get_or_insert_with(|| own_name.to_owned()).clone();
    let figure = plot::draw(&title, &request.axes, done, &params)
        .map_err(|error| Error::stage(Stage::Render)(boxed(error)))?;
    Ok(vec![
        ("sweep.tsv".to_owned(), rows::tsv(&request.axes, done).into_bytes()),
        ("sweep.png".to_owned(), figure.png),
        ("sweep.svg".to_owned(), figure.svg.into_bytes()),
        ("dictionary.tsv".to_owned(), rows::dictionary(&request.axes).into_bytes()),
    ])
}

/// The first stage whose settings the axes change.
fn first_changed(axes: &[Axis]) -> Result<Stage, Error> {
    let mut first = Stage::Render;
    for (idx, Axis { key, values }) in axes.iter().enumerate() {
        let refuse = |reason| Err(Error::NotSwept { key: key.clone(), reason });
        if axes[..idx].iter().any(|other| other.key == *key) {
            return refuse(NotSwept::Twice);
        }
        if values.is_empty() {
            return refuse(NotSwept::Empty);
        }
        let table = key.split('.').next().unwrap_or_default();
        // Input and seed concern all stages; a table that there is not is an unknown key, which the config refuses.
        let stage = Stage::from_name(table).unwrap_or(Stage::Phantom);
        if stage >= Stage::Render || matches!(table, "name" | "schema") {
            return refuse(NotSwept::Ineffective);
        }
        first = first.min(stage);
    }
    Ok(first)
}

/// All combinations, the last axis fastest.
fn combinations(axes: &[Axis]) -> Result<Vec<Vec<String>>, Error> {
    let n_combinations = axes.iter().fold(1_u64, |n, axis| n.saturating_mul(axis.values.len() as u64));
    if n_combinations > MOST_COMBINATIONS {
        return Err(Error::SweepSize { n_combinations, limit: MOST_COMBINATIONS });
    }
    let mut list = vec![Vec::new()];
    for axis in axes {
        let with = |start: &Vec<String>, value: &String| start.iter().chain([value]).cloned().collect();
        list =
            list.iter().flat_map(|start| axis.values.iter().map(move |value| with(start, value))).collect();
    }
    Ok(list)
}

fn config_at(request: &SweepRequest, values: &[String]) -> Result<Loaded, Error> {
    let swept = request.axes.iter().zip(values);
    let swept = swept.map(|(axis, value)| Override { key: axis.key.clone(), value: value.clone() });
    let overrides: Vec<Override> = request.overrides.iter().cloned().chain(swept).collect();
    Loaded::read(&request.config_or_input, &overrides)
}

/// What all combinations share.
struct Base {
    /// The first stage that is done for each of them; `None` for the first there is.
    from: Option<Stage>,
    /// What they begin with.
    files: BTreeMap<Artifact, PathBuf>,
}

impl Base {
    /// Does the stages before the first changed one.
    fn prepare(
        request: &SweepRequest,
        first: &Loaded,
        changed: Stage,
        (out, events): (&Path, &(dyn Fn(Event) + Sync)),
    ) -> Result<Self, Error> {
        let source = run::source_of(first, request.data_dir.as_deref())?;
        let stages = run::stages_of(&source);
        let from = stages.iter().copied().find(|stage| *stage >= changed);
        let Some(&to) = stages.iter().rfind(|stage| **stage < changed) else {
            return Ok(Self { from: None, files: BTreeMap::new() });
        };
        let folder = out.join("base");
        let base = request_of(request, first.clone(), folder.clone(), (None, to));
        run::run(&base, events)?;
        let is_traced = matches!(source, Source::Tree(_) | Source::PhantomTree(_));
        let artifacts =
            Artifact::ALL.into_iter().filter(|artifact| *artifact != Artifact::Traced || is_traced);
        let files = artifacts.map(|artifact| (artifact, folder.join(artifact.file())));
        Ok(Self { from, files: files.filter(|(_, file)| file.exists()).collect() })
    }

    /// Embeds a combination in a folder of its own, and gives the row of its embedding as it was written.
    fn embed(&self, request: &SweepRequest, loaded: Loaded, folder: &Path) -> Result<MethodRow, Error> {
        let run = request_of(request, loaded, folder.to_owned(), (self.from, Stage::Embed));
        run::run(&Request { files: self.files.clone(), ..run }, &|_| {})?;
        let read_options = espalier_volume::ReadOptions {
            max_bytes: request.max_memory_bytes,
            ..espalier_volume::ReadOptions::default()
        };
        let mut artifacts = Artifacts { files: self.files.clone(), read_options, ..Artifacts::default() };
        let folder = RunFolder::to_read(folder);
        let lookup = Lookup { folder: &folder, stage: Stage::Embed };
        let tree = artifacts.tree(lookup)?;
        let path = folder.path().join(Artifact::Comparison.file());
        let missing =
            || Error::NoRun { folder: folder.path().to_owned(), missing: Artifact::Comparison.file() };
        let comparison = artifacts.comparison(lookup)?.ok_or_else(missing)?;
        compare::check_crossings(&tree, &comparison, &path)?;
        Ok(comparison.layouts[comparison.chosen].row.clone())
    }
}

fn request_of(
    request: &SweepRequest,
    loaded: Loaded,
    out: PathBuf,
    (from, to): (Option<Stage>, Stage),
) -> Request {
    Request {
        loaded,
        out,
        from,
        to: Some(to),
        files: BTreeMap::new(),
        force: false,
        wait: false,
        threads: request.threads,
        max_memory_bytes: request.max_memory_bytes,
        data_dir: request.data_dir.clone(),
        cache: request.cache.clone(),
    }
}
