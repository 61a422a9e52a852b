//! What a run begins with, the stages that it passes from there, and the files that they read.

use std::path::{Path, PathBuf};

use super::{Request, boxed};
use crate::artifacts::Artifacts;
use crate::config::{Config, Loaded, Source, Unit};
use crate::error::Error;
use crate::side_file::SideFile;
use crate::stage::{Artifact, Stage};

/// The default run folder of a config.
#[must_use]
pub fn default_folder(config: &Config) -> PathBuf {
    PathBuf::from("out").join(&config.name)
}

pub(super) fn resolve_source(request: &Request) -> Result<Source, Error> {
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

pub(super) fn stages_to_do(request: &Request, source: &Source) -> Result<Vec<Stage>, Error> {
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
pub(super) fn input_file(stages: &[Stage], artifacts: &Artifacts) -> Option<PathBuf> {
    let first = *stages.first()?;
    let wanted = if first == Stage::Tree { [Artifact::Traced].as_slice() } else { first.reads() };
    wanted.iter().find_map(|artifact| artifacts.files.get(artifact)).cloned()
}

/// The files that an input is read from: several where it is a DICOM series, or a header with its data.
pub(super) fn input_files(
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
