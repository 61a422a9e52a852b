//! Mask → curve skeleton.

use std::sync::Arc;

use espalier_model::nifti_out;

use super::{Outcome, Step};
use crate::artifacts::Artifacts;
use crate::error::Error;
use crate::estimate::Sizes;
use crate::stage::Artifact;

pub(super) fn skeleton(step: &mut Step<'_>) -> Result<Outcome, Error> {
    let mask = step.take(Artifacts::mask)?;
    step.must_fit(&Sizes::of_mask(&mask))?;
    let made =
        espalier_skeleton::skeletonize(&mask, &step.config.skeleton).map_err(|error| step.failed(error))?;
    let line = format!("{} voxels", made.skeleton.voxels().len());
    let bytes = nifti_out::skeleton(&made.skeleton).map_err(|error| step.failed(error))?;
    step.artifacts.skeleton = Some(Arc::new(made.skeleton));
    Ok(Outcome { files: vec![step.place(Artifact::Skeleton, bytes)], report: made.report, line })
}
