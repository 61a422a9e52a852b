//! One stage: of a run folder, with the folder's own settings and files, or on files.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::anyhow;
use espalier_pipeline::{Artifact, Request, SideFile, Stage, Summary};

use super::runs::{load, load_input, perform, request};
use crate::args::{Arguments, Rerun, StageArguments};

pub(super) fn run(arguments: &Arguments, stage: &StageArguments, which: Stage) -> anyhow::Result<Summary> {
    match stage.inputs.as_slice() {
        // A folder that is no run is one of DICOM slices.
        [folder] if folder.is_dir() && (which != Stage::Volume || is_run(folder)) => {
            of_folder(arguments, stage, which, folder)
        }
        files => on_files(arguments, stage, which, files),
    }
}

pub(super) fn is_run(folder: &Path) -> bool {
    folder.join("provenance").is_dir()
}

/// A stage of a run folder, with the folder's own settings and files.
fn of_folder(
    arguments: &Arguments,
    stage: &StageArguments,
    which: Stage,
    folder: &Path,
) -> anyhow::Result<Summary> {
    let own_config = folder.join("provenance/config.resolved.toml");
    let mut loaded = load(stage.config.as_ref().unwrap_or(&own_config), &arguments.common.overrides)?;
    if let (None, Some(_)) = (&stage.config, &loaded.config.input.path) {
        // The resolved config has only the name of the input; where it lies stands apart.
        loaded.config.input.path = espalier_pipeline::input_of_run(folder).or(loaded.config.input.path);
    }
    for side in SideFile::ALL {
        let (None, Some(path)) = (&stage.config, side.slot(&mut loaded.config)) else { continue };
        if path.is_empty() {
            continue;
        }
        // So has it of the files beside; a path given here and now starts from here.
        let is_set_now = arguments.common.overrides.iter().any(|set| set.key == side.key());
        let named = || Some(std::path::absolute(&*path).ok()?.to_string_lossy().into_owned());
        let known = if is_set_now { named() } else { espalier_pipeline::side_file_of_run(folder, side) };
        *path = known.unwrap_or_else(|| std::mem::take(path));
    }
    let out = stage.out.clone().unwrap_or_else(|| folder.to_owned());
    let Rerun { force, wait } = stage.rerun;
    let mut request =
        Request { from: Some(which), to: Some(which), force, wait, ..request(arguments, loaded, out) };
    if request.out != folder {
        let known = which.reads().iter().chain(&[Artifact::Volume, Artifact::Traced, Artifact::Comparison]);
        let files = known.map(|artifact| (*artifact, folder.join(artifact.file())));
        request.files = files.filter(|(_, file)| file.exists()).collect();
        if request.files.contains_key(&Artifact::Mask) {
            request.files.remove(&Artifact::Traced);
        }
    }
    perform(arguments, &request)
}

fn on_files(
    arguments: &Arguments,
    stage: &StageArguments,
    which: Stage,
    inputs: &[PathBuf],
) -> anyhow::Result<Summary> {
    let overrides = &arguments.common.overrides;
    let files = stage_files(which, inputs)?;
    let Rerun { force, wait } = stage.rerun;
    let out = stage.out.clone().ok_or_else(|| anyhow!("{which} on files needs -o DIR"))?;
    let mut loaded = match &stage.config {
        Some(config) => load(config, overrides)?,
        None => load_input(&inputs[0], overrides)?,
    };
    loaded.config.input.path = Some(std::path::absolute(&inputs[0])?.to_string_lossy().into_owned());
    loaded.config.input.phantom = None;
    perform(
        arguments,
        &Request {
            files,
            from: Some(which),
            to: Some(which),
            force,
            wait,
            ..request(arguments, loaded, out)
        },
    )
}

/// Which file is which artifact.
fn stage_files(stage: Stage, inputs: &[PathBuf]) -> anyhow::Result<BTreeMap<Artifact, PathBuf>> {
    let is_traced = stage == Stage::Tree && inputs.len() == 1;
    let wanted = if is_traced { &[Artifact::Traced] } else { stage.reads() };
    if wanted.len() != inputs.len() {
        let names: Vec<&str> = wanted.iter().map(|artifact| artifact.what()).collect();
        return Err(anyhow!(
            "{stage} takes {} files ({}), not {}",
            wanted.len(),
            names.join(", "),
            inputs.len()
        ));
    }
    Ok(wanted.iter().copied().zip(inputs.iter().cloned()).collect())
}
