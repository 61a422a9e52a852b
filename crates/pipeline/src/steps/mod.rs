//! What each stage does with its hand-over data: take, call, hand on, say in one line.
//!
//! One file a stage; the page of a run has its own, [`crate::page`].

mod embed;
mod phantom;
mod radius;
mod render;
mod skeleton;
mod tree;
mod views;
mod volume;

use std::fs::File;
use std::path::Path;

use espalier_model::{Grid, Report};

use crate::artifacts::{Artifacts, Lookup};
use crate::config::{Config, Source};
use crate::error::Error;
use crate::estimate::{self, Sizes};
use crate::event::Event;
use crate::folder::RunFolder;
use crate::page;
use crate::provenance::PartCost;
use crate::run::boxed;
use crate::stage::{Artifact, Stage};

pub(crate) use embed::CONVERGENCE_COLUMNS;
pub(crate) use tree::too_large_for_a_neuron;

/// What a stage came to: its files, not yet written.
pub(crate) struct Outcome {
    pub(crate) files: Vec<(String, Vec<u8>)>,
    pub(crate) report: Report,
    pub(crate) line: String,
}

/// A stage about to be done.
pub(crate) struct Step<'a> {
    pub(crate) stage: Stage,
    pub(crate) config: &'a Config,
    pub(crate) source: &'a Source,
    pub(crate) artifacts: &'a mut Artifacts,
    pub(crate) events: &'a (dyn Fn(Event) + Sync),
    pub(crate) folder: &'a RunFolder,
    /// What parts of the stage have cost, filled in while it is done.
    pub(crate) parts: Vec<PartCost>,
}

/// Does a stage.
pub(crate) fn perform(step: &mut Step<'_>) -> Result<Outcome, Error> {
    match step.stage {
        Stage::Phantom => phantom::phantom(step),
        Stage::Volume => volume::volume(step),
        Stage::Skeleton => skeleton::skeleton(step),
        Stage::Radius => radius::radius(step),
        Stage::Tree => tree::tree(step),
        Stage::Views => views::views(step),
        Stage::Embed => embed::embed(step),
        Stage::Render => render::render(step),
        Stage::Report => page::report(step),
    }
}

impl<'a> Step<'a> {
    /// An artifact, from memory or from its file.
    pub(crate) fn take<T>(
        &mut self,
        artifact: impl FnOnce(&mut Artifacts, Lookup<'a>) -> Result<T, Error>,
    ) -> Result<T, Error> {
        let lookup = Lookup { folder: self.folder, stage: self.stage };
        artifact(self.artifacts, lookup)
    }

    /// Checks that the stage will not take more memory than allowed, before it takes any.
    pub(crate) fn must_fit(&self, sizes: &Sizes) -> Result<(), Error> {
        let (needed, limit) =
            (estimate::cost(self.stage, sizes).bytes, self.artifacts.read_options.max_bytes);
        if needed > limit { Err(Error::Memory { stage: self.stage, needed, limit }) } else { Ok(()) }
    }

    pub(crate) fn failed(&self, error: impl espalier_model::Diagnose + Send + Sync + 'static) -> Error {
        Error::stage(self.stage)(boxed(error))
    }

    pub(crate) fn is_traced(&self) -> bool {
        self.artifacts.is_traced(self.source)
    }

    /// An artifact's bytes at its place in the run folder.
    fn place(&self, artifact: Artifact, bytes: Vec<u8>) -> (String, Vec<u8>) {
        (artifact.file().to_owned(), bytes)
    }

    /// The bytes of another file in the stage's own folder.
    pub(crate) fn beside(&self, name: &str, bytes: Vec<u8>) -> (String, Vec<u8>) {
        (format!("{}/{name}", self.stage.folder()), bytes)
    }

    /// What a later reader will make of a text that is about to be written.
    fn read_back<T, E: espalier_model::Diagnose + Send + Sync + 'static>(
        &self,
        text: &str,
        parse: impl FnOnce(&str) -> Result<T, E>,
    ) -> Result<T, Error> {
        parse(text).map_err(|error| self.failed(error))
    }
}

/// Checks that a file can be opened and is a file, before anything is written.
pub(crate) fn check_readable(path: &Path, may_be_folder: bool) -> Result<(), Error> {
    let read = |source| Error::Read { path: path.to_owned(), source };
    if may_be_folder && path.is_dir() {
        return std::fs::read_dir(path).map(drop).map_err(read);
    }
    let file = File::open(path).map_err(read)?;
    if file.metadata().map_err(read)?.is_dir() {
        return Err(read(std::io::Error::from(std::io::ErrorKind::IsADirectory)));
    }
    Ok(())
}

fn describe_grid(grid: &Grid) -> String {
    let ([nx, ny, nz], spacing) = (grid.shape(), grid.spacing_mm());
    format!(
        "{nx}x{ny}x{nz} at {}x{}x{} mm {}",
        readable(spacing.x),
        readable(spacing.y),
        readable(spacing.z),
        grid.orientation()
    )
}

/// A number with at most four significant decimals and no trailing zeros.
fn readable(value: f64) -> String {
    let text = format!("{value:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
