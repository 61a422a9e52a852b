//! A phantom on its own: scan, mask and true tree as files for any program.

use std::path::Path;

use espalier_model::swc;

use crate::config::Config;
use crate::error::Error;
use crate::folder::RunFolder;
use crate::run::{Summary, boxed};
use crate::stage::Stage;
use crate::steps::phantom_files;

/// Makes the phantom of `config.input.phantom` with the shape of `config.phantom` and writes its files to `out`:
/// `truth.swc` always; `ct.nii.gz` and `truth-mask.nii.gz` unless it is a neuron, which has no scan.
///
/// # Errors
/// [`Error`] if the shape is not possible or a file cannot be written.
pub fn make_phantom(config: &Config, out: &Path) -> Result<Summary, Error> {
    let kind = config.input.phantom.unwrap_or(espalier_phantom::Kind::Airway);
    let failed = |error| Error::stage(Stage::Phantom)(boxed(error));
    let files: Vec<(&str, Vec<u8>)>;
    if kind == espalier_phantom::Kind::Neuron {
        let tree = espalier_phantom::grow_tree(kind, &config.phantom, config.seed).map_err(failed)?;
        files = vec![("truth.swc", swc::write(&tree, &[("phantom", kind.name())]).into_bytes())];
    } else {
        let made = espalier_phantom::generate(kind, &config.phantom, config.seed).map_err(failed)?;
        let scan = espalier_phantom::ct(&made, &config.phantom, config.seed).map_err(failed)?;
        files = phantom_files(&made, &scan)?;
    }
    let mut folder = RunFolder::open(out)?;
    for (name, bytes) in &files {
        folder.write(name, bytes)?;
    }
    let digest = folder.seal()?;
    let highlights = files.into_iter().map(|(name, _)| name.to_owned()).collect();
    Ok(Summary { out: out.to_owned(), highlights, digest })
}
