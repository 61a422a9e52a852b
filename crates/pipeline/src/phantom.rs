//! A phantom on its own: scan, mask and true tree as files for any program.

use std::path::Path;

use espalier_model::{nifti_out, swc};

use crate::config::Config;
use crate::error::Error;
use crate::folder::RunFolder;
use crate::run::{Summary, boxed};
use crate::stage::Stage;

/// Makes the phantom of `config.input.phantom` with the shape of `config.phantom` and writes its files to `out`:
/// `truth.swc` always; `ct.nii.gz` and `mask.nii.gz` unless it is a neuron, which has no scan.
///
/// # Errors
/// [`Error`] if the shape is not possible or a file cannot be written.
pub fn make_phantom(config: &Config, out: &Path) -> Result<Summary, Error> {
    let kind = config.input.phantom.unwrap_or(espalier_phantom::Kind::Airway);
    let failed = |error| Error::stage(Stage::Phantom)(boxed(error));
    let header = [("phantom", kind.name())];
    let mut files: Vec<(&str, Vec<u8>)> = Vec::new();
    if kind == espalier_phantom::Kind::Neuron {
        let tree = espalier_phantom::grow_tree(kind, &config.phantom, config.seed).map_err(failed)?;
        files.push(("truth.swc", swc::write(&tree, &header).into_bytes()));
    } else {
        let made = espalier_phantom::generate(kind, &config.phantom, config.seed).map_err(failed)?;
        let scan = espalier_phantom::ct(&made, &config.phantom, config.seed);
        let written = |error| Error::stage(Stage::Phantom)(boxed(error));
        files.push(("ct.nii.gz", nifti_out::volume(&scan).map_err(written)?));
        files.push(("mask.nii.gz", nifti_out::mask(&made.mask).map_err(written)?));
        files.push(("truth.swc", swc::write(&made.tree, &header).into_bytes()));
    }
    let mut folder = RunFolder::open(out)?;
    for (name, bytes) in &files {
        folder.write(name, bytes)?;
    }
    let digest = folder.seal()?;
    let highlights = files.into_iter().map(|(name, _)| name.to_owned()).collect();
    Ok(Summary { out: out.to_owned(), highlights, digest })
}
