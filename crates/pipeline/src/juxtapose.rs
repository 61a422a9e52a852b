//! Two runs on one shared map: what was lost, what is new, what changed its calibre.
//!
//! **Input** two run folders, or configs to be run up to the tree: a baseline and a follow-up. **Output** in a folder of
//! its own: `juxtaposition.png` and `juxtaposition.svg`, `juxtaposition.tsv` with a row per branch, `juxtaposition.json`
//! with the alignment and the sums, the tree of both with its embedding (`shared.swc`, `shared-embedding.json`,
//! `shared-nodes.tsv`), `dictionary.tsv`, sealed by `SHA256SUMS`.
//! **Steps** 1. Match the branches of both trees. 2. Lay the tree of both flat with the baseline's settings and seed.
//! 3. Draw it twice.
//! **Guarantees** the layout is certified for the tree as written; each of both trees is a part of it.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use espalier_embed::PoseMode;
use espalier_juxtapose::Params;
use espalier_model::table::dictionary;
use espalier_model::{
    BranchChange, CHANGE_COLUMNS, Embedding, Fate, Juxtaposition, SHARED_NODE_COLUMNS, Tree, swc,
};
use espalier_render::ChangeOf;

use crate::artifacts::{Artifacts, Lookup, SOURCE_KEY, SOURCE_SCAN, SOURCE_TRACING};
use crate::cache::Cache;
use crate::compare::{Files, Place, Subject, figure, names, titles};
use crate::config::{Config, Override};
use crate::error::Error;
use crate::event::Event;
use crate::folder::RunFolder;
use crate::methods::MethodWatch;
use crate::run::{Summary, boxed, in_pool};
use crate::settings;
use crate::stage::{Artifact, Stage};

/// Branches that the terminal names, those that changed most.
const N_NAMED: usize = 5;
/// Changes of radius below this are not named there, in percent.
const LEAST_NAMED_PERCENT: f64 = 10.0;

/// A juxtaposition to be made.
#[derive(Clone, Debug)]
pub struct JuxtaposeRequest {
    /// Baseline and follow-up.
    pub subjects: [Subject; 2],
    /// Where the results go; the run of a config goes to a folder of its name in there.
    pub out: PathBuf,
    /// What the command line changes; of finished runs only `views`, `embed`, `render` and `seed`.
    pub overrides: Vec<Override>,
    /// How the follow-up is brought to the baseline.
    pub params: Params,
    /// What the colours mean.
    pub change: ChangeOf,
    /// As in [`Request`].
    pub threads: Option<usize>,
    /// As in [`Request`].
    pub max_memory_bytes: u64,
    /// As in [`Request`].
    pub data_dir: Option<PathBuf>,
    /// As in [`Request`].
    pub cache: Option<Cache>,
}

/// What a juxtaposition came to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JuxtaposedRuns {
    /// The sums, for a terminal.
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
}

/// Holds two runs against each other.
///
/// # Errors
/// [`Error`] if a folder holds no tree, a config cannot be run, the trees cannot be compared or laid flat, or the
/// results cannot be written.
pub fn juxtapose(
    request: &JuxtaposeRequest,
    events: &(dyn Fn(Event) + Sync),
) -> Result<JuxtaposedRuns, Error> {
    if request.out.join(settings::FILE).exists() {
        return Err(Error::RunInTheWay { folder: request.out.clone() });
    }
    let names = names(&request.subjects);
    let mut folders = Vec::new();
    for (subject, name) in request.subjects.iter().zip(&names) {
        let place = Place {
            out: request.out.join(name),
            to: Stage::Tree,
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
        let (table, files) = results(request, [&runs[0], &runs[1]], events)?;
        let mut folder = RunFolder::open(&request.out)?;
        for (file, bytes) in &files {
            folder.write(file, bytes)?;
        }
        let highlights = files.into_iter().map(|(file, _)| file).collect();
        let summary = Summary { out: request.out.clone(), highlights, digest: folder.seal()? };
        Ok(JuxtaposedRuns { table, summary })
    })
}

/// Reads a run folder up to its tree, every file checked against the folder's digests.
fn read_run(request: &JuxtaposeRequest, path: &Path, name: String) -> Result<Found, Error> {
    for missing in [settings::FILE, Artifact::Tree.file()] {
        if !path.join(missing).exists() {
            return Err(Error::NoTree { folder: path.to_owned(), missing });
        }
    }
    let folder = RunFolder::to_read(path);
    folder.check_all()?;
    let read_options = espalier_volume::ReadOptions {
        max_bytes: request.max_memory_bytes,
        ..espalier_volume::ReadOptions::default()
    };
    let mut artifacts = Artifacts { read_options, ..Artifacts::default() };
    let tree = artifacts.tree(Lookup { folder: &folder, stage: Stage::Views })?;
    Ok(Found { name, config: own_config(request, &folder)?, tree, is_of_scan: artifacts.is_of_scan })
}

/// The config of a run under the overrides that may still change something.
fn own_config(request: &JuxtaposeRequest, folder: &RunFolder) -> Result<Config, Error> {
    let is_finished = request.subjects.iter().any(|s| matches!(s, Subject::Run(run) if run == folder.path()));
    let is_open = |set: &&Override| {
        set.key == "seed" || ["views.", "embed.", "render."].iter().any(|table| set.key.starts_with(table))
    };
    if let (true, Some(other)) = (is_finished, request.overrides.iter().find(|set| !is_open(set))) {
        return Err(Error::SettledTree { key: other.key.clone(), folder: folder.path().to_owned() });
    }
    let text = String::from_utf8_lossy(&folder.read(settings::FILE)?).into_owned();
    let overrides: Vec<Override> = request.overrides.iter().filter(is_open).cloned().collect();
    Config::parse(&text, &folder.path().join(settings::FILE), &overrides).map_err(Error::from)
}

fn results(
    request: &JuxtaposeRequest,
    runs: [&Found; 2],
    events: &(dyn Fn(Event) + Sync),
) -> Result<(String, Files), Error> {
    let failed = |error| Error::file(&request.out, error);
    let compared =
        espalier_juxtapose::juxtapose(&runs[0].tree, &runs[1].tree, &request.params).map_err(failed)?;
    for warning in compared.report.warnings {
        events(Event::Warning {
            file: None,
            stage: Stage::Tree,
            code: warning.code.to_owned(),
            message: warning.message,
        });
    }
    let mut found = compared.juxtaposition;
    // As every stage: what goes on is what was written.
    let source = if runs[0].is_of_scan { SOURCE_SCAN } else { SOURCE_TRACING };
    let text = swc::write(&found.shared, &[(SOURCE_KEY, source)]);
    found.shared =
        swc::read_tree(&text).map_err(|error| Error::file(&request.out.join("shared.swc"), error))?;
    let json = embed(runs[0], &found.shared, events)?.to_json();
    let embedding = Embedding::from_json(&json, &found.shared)
        .map_err(|error| Error::file(&request.out.join("shared-embedding.json"), error))?;

    let mut params = runs[0].config.render.clone();
    let titles = titles(&runs.map(|run| (&run.config, run.name.as_str())));
    params.title.get_or_insert_with(|| format!("{} and {}", titles[0], titles[1]));
    params.compass = figure::compass(params.compass, runs[0].is_of_scan);
    let panels = [format!("baseline: {}", titles[0]), format!("follow-up: {}", titles[1])];
    let panels = [panels[0].as_str(), panels[1].as_str()];
    let drawn = espalier_render::juxtaposed((&found, &embedding), request.change, panels, &params)
        .map_err(|error| Error::file(&request.out, error))?;
    let dictionary =
        dictionary(&[("juxtaposition.tsv", &CHANGE_COLUMNS), ("shared-nodes.tsv", &SHARED_NODE_COLUMNS)]);
    let files = [
        ("juxtaposition.png", drawn.png),
        ("juxtaposition.svg", drawn.svg.into_bytes()),
        ("juxtaposition.tsv", found.to_tsv().into_bytes()),
        ("juxtaposition.json", found.to_json().into_bytes()),
        ("shared.swc", text.into_bytes()),
        ("shared-embedding.json", json.into_bytes()),
        ("shared-nodes.tsv", found.nodes_tsv(&embedding.positions_mm).into_bytes()),
        ("dictionary.tsv", dictionary.into_bytes()),
    ];
    let files = files.into_iter().map(|(file, bytes)| (file.to_owned(), bytes)).collect();
    Ok((table(&found), files))
}

/// Lays the tree of both flat, with the settings of the baseline.
fn embed(run: &Found, shared: &Tree, events: &(dyn Fn(Event) + Sync)) -> Result<Embedding, Error> {
    let failed = |stage: Stage| Error::stage(stage);
    let views = espalier_views::find_views(shared, &run.config.views, run.config.seed)
        .map_err(|error| failed(Stage::Views)(boxed(error)))?
        .hierarchy;
    let mut params = run.config.embed.clone();
    if params.pose == PoseMode::Auto {
        params.pose = if run.is_of_scan { PoseMode::View } else { PoseMode::RootOnTop };
    }
    let watch = MethodWatch::new(Stage::Embed, events);
    let embedded =
        espalier_embed::embed(shared, &views, &params, run.config.seed, &|event| watch.hear(event))
            .map_err(|error| failed(Stage::Embed)(boxed(error)))?;
    Ok(embedded.embedding)
}

/// The sums, and the branches that changed most.
fn table(found: &Juxtaposition) -> String {
    let mut out = String::new();
    // Writing to a String cannot fail.
    for fate in [Fate::Matched, Fate::Lost, Fate::New] {
        let n = found.of_fate(fate).count();
        let noun = if n == 1 { "branch" } else { "branches" };
        let _ = write!(out, "{:<9}{n:>6} {noun:<9}{:>12.4} mm", fate.name(), found.length_mm(fate));
        if fate == Fate::Matched && found.alignment.residual_mean_mm.is_finite() {
            let alignment = &found.alignment;
            let _ = write!(
                out,
                "   forks {:.3} mm apart on average, {:.3} at most, after turning by {:.1}°",
                alignment.residual_mean_mm,
                alignment.residual_max_mm,
                alignment.angle_deg()
            );
        }
        out.push('\n');
    }
    let mut changed: Vec<&BranchChange> = found
        .of_fate(Fate::Matched)
        .filter(|row| row.radius_change_percent().abs() >= LEAST_NAMED_PERCENT)
        .collect();
    changed.sort_by(|a, b| b.radius_change_percent().abs().total_cmp(&a.radius_change_percent().abs()));
    for row in changed.into_iter().take(N_NAMED) {
        let branches: Vec<String> = row.baseline_branches.iter().map(usize::to_string).collect();
        let _ = writeln!(
            out,
            "branch {:<8} radius {:+.1} %, narrowest {:+.1} % at {:.4} mm of {:.4}",
            branches.join(","),
            row.radius_change_percent(),
            row.narrowest_percent,
            row.narrowest_at_mm,
            row.length_mm[0]
        );
    }
    out.truncate(out.trim_end().len());
    out
}
