//! Phantoms: scan, mask and true tree as files for any program.

use std::path::Path;

use espalier_model::{Mask, Tree, Volume, nifti_out, swc};
use espalier_phantom::Kind;

use crate::config::Config;
use crate::error::Error;
use crate::folder::RunFolder;
use crate::run::{Summary, boxed, in_pool};
use crate::stage::Stage;

/// A phantom with what its kind has: a neuron has neither scan nor mask.
pub(crate) struct Made {
    pub(crate) kind: Kind,
    pub(crate) tree: Tree,
    pub(crate) mask: Option<Mask>,
    pub(crate) scan: Option<Volume>,
}

/// Makes the phantom of `config.phantom`; only its tree, unless it is `scanned`.
pub(crate) fn make(kind: Kind, config: &Config, scanned: bool) -> Result<Made, Error> {
    let failed = |error| Error::stage(Stage::Phantom)(boxed(error));
    let (params, seed) = (&config.phantom, config.seed);
    if !scanned {
        let tree = espalier_phantom::grow_tree(kind, params, seed).map_err(failed)?;
        return Ok(Made { kind, tree, mask: None, scan: None });
    }
    let phantom = espalier_phantom::generate(kind, params, seed).map_err(failed)?;
    let scan = espalier_phantom::ct(&phantom, params, seed).map_err(failed)?;
    Ok(Made { kind, tree: phantom.tree, mask: phantom.mask, scan: Some(scan) })
}

impl Made {
    /// Its files by name: `ct.nii.gz` and `truth-mask.nii.gz` where it has them, `truth.swc` always.
    pub(crate) fn files(&self) -> Result<Vec<(&'static str, Vec<u8>)>, Error> {
        let failed = |error| Error::stage(Stage::Phantom)(boxed(error));
        let mut files = Vec::new();
        if let Some(scan) = &self.scan {
            files.push(("ct.nii.gz", nifti_out::volume(scan).map_err(failed)?));
        }
        if let Some(mask) = &self.mask {
            files.push(("truth-mask.nii.gz", nifti_out::mask(mask).map_err(failed)?));
        }
        let header = [("phantom", self.kind.name())];
        files.push(("truth.swc", swc::write(&self.tree, &header).into_bytes()));
        Ok(files)
    }
}

/// Makes the phantom of `config.input.phantom` (an airway if there is none) with the shape of `config.phantom` and
/// writes its files to `out`: `truth.swc` always; `ct.nii.gz` and `truth-mask.nii.gz` unless it is a neuron, which
/// has no scan.
///
/// # Errors
/// [`Error`] if the shape is not possible or a file cannot be written.
pub fn make_phantom(config: &Config, out: &Path, threads: Option<usize>) -> Result<Summary, Error> {
    let kind = config.input.phantom.unwrap_or(Kind::Airway);
    let files = in_pool(threads, || make(kind, config, kind != Kind::Neuron)?.files())?;
    let mut folder = RunFolder::open(out)?;
    for (name, bytes) in &files {
        folder.write(name, bytes)?;
    }
    let digest = folder.seal()?;
    let highlights = files.into_iter().map(|(name, _)| name.to_owned()).collect();
    Ok(Summary { out: out.to_owned(), highlights, digest })
}
