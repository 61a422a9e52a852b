//! Helpers of the end-to-end suite.

pub mod degenerate;
pub mod ground_truth;
pub mod hostile;
pub mod peer_ends;

use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use espalier_model::{Embedding, Tree, swc};
use espalier_pipeline::{Cache, Config, Error, Event, Loaded, Override, Request, Stage, Summary};

/// The folder of real data; `None`, and a line that says so, where `ESPALIER_DATA` is not set.
///
/// # Panics
/// If the variable is set and does not lead to the data: a test must not pass by looking elsewhere.
#[must_use]
#[allow(clippy::disallowed_methods, clippy::print_stderr, clippy::panic, reason = "a helper of tests")]
pub fn real_data() -> Option<PathBuf> {
    let Some(folder) = std::env::var_os("ESPALIER_DATA").map(PathBuf::from) else {
        eprintln!("skipped: ESPALIER_DATA not set");
        return None;
    };
    assert!(folder.join("volumes").is_dir(), "ESPALIER_DATA is {}, which has no volumes", folder.display());
    Some(folder)
}

/// A `--set` of the command line.
#[must_use]
pub fn set(key: &str, value: impl Display) -> Override {
    Override { key: key.to_owned(), value: value.to_string() }
}

/// A swarm small enough for tests in a debug build.
#[must_use]
pub fn small_swarm() -> Vec<Override> {
    vec![set("embed.pso.particles", 24), set("embed.pso.iterations", 4), set("render.width_px", 400)]
}

/// A run of a config or an input into a folder.
///
/// # Errors
/// As the run's.
pub fn run(source: &Path, out: &Path, overrides: &[Override], threads: usize) -> Result<Summary, Error> {
    espalier_pipeline::run(&request(source, out, overrides, threads)?, &|_| {})
}

/// As [`run`], from a stage on.
///
/// # Errors
/// As the run's.
pub fn run_from(source: &Path, out: &Path, overrides: &[Override], from: Stage) -> Result<Summary, Error> {
    run_range(source, out, overrides, (Some(from), None))
}

/// As [`run`], from a stage to a stage.
///
/// # Errors
/// As the run's.
pub fn run_range(
    source: &Path,
    out: &Path,
    overrides: &[Override],
    (from, to): (Option<Stage>, Option<Stage>),
) -> Result<Summary, Error> {
    // Done in any case: what stands already would be kept.
    let request = Request { from, to, force: true, ..request(source, out, overrides, 2)? };
    espalier_pipeline::run(&request, &|_| {})
}

/// As [`run`] on two threads, with the stages that were done; the others had results that stand.
///
/// # Errors
/// As the run's.
pub fn run_seen(source: &Path, out: &Path, overrides: &[Override]) -> Result<(Summary, Vec<Stage>), Error> {
    let done = Mutex::new(Vec::new());
    let summary = espalier_pipeline::run(&request(source, out, overrides, 2)?, &|event| {
        if let (Event::Finished { stage, .. }, Ok(mut done)) = (event, done.lock()) {
            done.push(stage);
        }
    })?;
    Ok((summary, done.into_inner().unwrap_or_default()))
}

/// As [`run_seen`], with a store that runs share: also the stages whose results were taken from there.
///
/// # Errors
/// As the run's.
pub fn run_sharing(
    source: &Path,
    out: &Path,
    overrides: &[Override],
    cache: &Cache,
) -> Result<(Summary, Vec<Stage>, Vec<Stage>), Error> {
    let (done, taken) = (Mutex::new(Vec::new()), Mutex::new(Vec::new()));
    let request = Request { cache: Some(cache.clone()), ..request(source, out, overrides, 2)? };
    let summary = espalier_pipeline::run(&request, &|event| match event {
        Event::Finished { stage, .. } => done.lock().into_iter().for_each(|mut done| done.push(stage)),
        Event::Taken { stage, .. } => taken.lock().into_iter().for_each(|mut taken| taken.push(stage)),
        _ => {}
    })?;
    Ok((summary, done.into_inner().unwrap_or_default(), taken.into_inner().unwrap_or_default()))
}

fn request(source: &Path, out: &Path, overrides: &[Override], threads: usize) -> Result<Request, Error> {
    let is_config = source.extension().is_some_and(|extension| extension == "toml");
    let config = if is_config {
        let text = std::fs::read_to_string(source)
            .map_err(|cause| Error::Read { path: source.to_owned(), source: cause })?;
        Config::parse(&text, source, overrides)?
    } else {
        Config::for_input(source, overrides)?
    };
    Ok(Request {
        loaded: Loaded { config, base_dir: source.parent().unwrap_or(Path::new("")).to_owned() },
        out: out.to_owned(),
        from: None,
        to: None,
        files: std::collections::BTreeMap::new(),
        force: false,
        wait: false,
        threads: Some(threads),
        max_memory_bytes: 4 << 30,
        data_dir: None,
        cache: None,
    })
}

/// The tree and the embedding of a run folder.
///
/// # Panics
/// If a file is missing or refused.
#[must_use]
#[allow(clippy::expect_used, reason = "a helper of tests")]
pub fn results(out: &Path) -> (Tree, Embedding) {
    let text = std::fs::read_to_string(out.join("tree.swc")).expect("tree.swc");
    let tree = swc::read_tree(&text).expect("a tree");
    let json = std::fs::read_to_string(out.join("embedding.json")).expect("embedding.json");
    let embedding = Embedding::from_json(&json, &tree).expect("an embedding");
    (tree, embedding)
}
