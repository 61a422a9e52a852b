//! One embedding with the seconds of each of its methods.

use std::error::Error;
use std::sync::Mutex;
use std::time::Instant;

use espalier_embed::{Event, Params, Progress, embed};
use espalier_model::{Embedding, MethodRow, Tree, ViewHierarchy};

/// An embedding and what it took.
pub(crate) struct Measured {
    pub(crate) embedding: Embedding,
    /// Until the first method began: targets and the search for their sides.
    pub(crate) targets_seconds: f64,
    /// Each method's own seconds, by its name in the table.
    pub(crate) seconds: Vec<(String, f64)>,
    /// All of it.
    pub(crate) total_seconds: f64,
    /// How the first swarm went, with the seconds since it began.
    pub(crate) swarm: Vec<(f64, Progress)>,
}

impl Measured {
    pub(crate) fn row(&self, method: &str) -> Option<&MethodRow> {
        self.embedding.methods.iter().find(|row| row.method.starts_with(method))
    }

    /// The seconds of the first row of a method.
    pub(crate) fn seconds_of(&self, name: &str) -> f64 {
        let rows = &self.embedding.methods;
        rows.iter().position(|row| row.method.starts_with(name)).map_or(0.0, |idx| self.seconds_of_row(idx))
    }

    /// The seconds of a row; the solver's with the search for sides, which is its first part. Rows stand in the order
    /// in which methods ran, and one may have run twice, against other targets.
    pub(crate) fn seconds_of_row(&self, idx: usize) -> f64 {
        let (name, own) = &self.seconds[idx];
        if name.starts_with("solver") { own + self.targets_seconds } else { *own }
    }
}

/// The seconds at which things happened.
#[derive(Default)]
struct Log {
    started: Option<f64>,
    targets_seconds: Option<f64>,
    seconds: Vec<(String, f64)>,
    swarm: Vec<(f64, Progress)>,
}

/// The views of a tree; no table counts the time they take.
pub(crate) fn views(tree: &Tree) -> Result<ViewHierarchy, Box<dyn Error>> {
    Ok(espalier_views::find_views(tree, &espalier_views::Params::default(), 0)?.hierarchy)
}

/// Lays a tree flat.
pub(crate) fn measure(
    tree: &Tree,
    views: &ViewHierarchy,
    params: &Params,
) -> Result<Measured, Box<dyn Error>> {
    let start = Instant::now();
    let log = Mutex::new(Log::default());
    let embedded = embed(tree, views, params, 0, &|event| {
        let now = start.elapsed().as_secs_f64();
        let Ok(mut log) = log.lock() else { return };
        let since = now - log.started.unwrap_or(now);
        match event {
            Event::Started { .. } => {
                log.started = Some(now);
                log.targets_seconds.get_or_insert(now);
            }
            // A second swarm has other targets.
            Event::Searching(progress) if log.seconds.iter().all(|(name, _)| !name.starts_with("pso")) => {
                log.swarm.push((since, progress));
            }
            Event::Finished { name } => log.seconds.push((name, since)),
            _ => {}
        }
    })?;
    let Log { targets_seconds, seconds, swarm, .. } = log.into_inner()?;
    Ok(Measured {
        embedding: embedded.embedding,
        targets_seconds: targets_seconds.unwrap_or(0.0),
        seconds,
        total_seconds: start.elapsed().as_secs_f64(),
        swarm,
    })
}

/// A number with about three digits that tell.
pub(crate) fn short(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        size if size >= 100.0 => format!("{value:.0}"),
        size if size >= 1.0 => format!("{value:.2}"),
        size if size >= 1e-3 => format!("{value:.4}"),
        _ => format!("{value:.1e}"),
    }
}
