//! Mask and skeleton, and the scan if there is one → inscribed spheres.

use std::sync::Arc;

use espalier_model::{InscribedSpheres, Mask, nifti_out};

use super::{Outcome, Step};
use crate::artifacts::Artifacts;
use crate::error::Error;
use crate::estimate::Sizes;
use crate::scan_of_walls;
use crate::stage::Artifact;

pub(super) fn radius(step: &mut Step<'_>) -> Result<Outcome, Error> {
    let mask = step.take(Artifacts::mask)?;
    let skeleton = step.take(Artifacts::skeleton)?;
    let sampled = scan_of_walls::n_voxels(step.config, step.source, &mask);
    step.must_fit(&Sizes { sampled, ..Sizes::of_mask(&mask) })?;
    let measured = espalier_radius::inscribed_spheres(&mask, &skeleton, &step.config.radius)
        .map_err(|error| step.failed(error))?;
    let (mut spheres, mut report) = (measured.spheres, measured.report);
    let scan = scan_of_walls::around(step, &mask)?;
    if let Some((scan, notes)) = &scan {
        let walls = espalier_radius::walls((&mask, &skeleton), &spheres, scan, &step.config.radius)
            .map_err(|error| step.failed(error))?;
        spheres = walls.spheres;
        report.warnings.extend(notes.warnings.clone());
        report.extend(walls.report);
        report.count_usize("scan_voxels", scan.grid().n_voxels());
    }
    let radii = || spheres.0.iter().map(|sphere| sphere.radius_mm + sphere.wall_mm);
    let line = format!(
        "{:.2} to {:.2} mm{}",
        radii().fold(f64::INFINITY, f64::min),
        radii().fold(0.0, f64::max),
        if spheres.0.iter().any(|sphere| sphere.wall_mm != 0.0) { ", to the wall in the scan" } else { "" }
    );
    let single: Vec<f32> = radii().map(|radius_mm| radius_mm as f32).collect();
    let radius_image = nifti_out::skeleton_scalars(&skeleton, &single).map_err(|error| step.failed(error))?;
    let table = spheres.to_tsv();
    step.artifacts.spheres = Some(Arc::new(step.read_back(&table, InscribedSpheres::from_tsv)?));
    let mut files =
        vec![step.beside("radius.nii.gz", radius_image), step.place(Artifact::Spheres, table.into_bytes())];
    if step.config.radius.field {
        files.push(step.beside("distance.nii.gz", distance_image(step, &mask)?));
    }
    Ok(Outcome { files, report, line })
}

/// The distance of every voxel of the mask to the background, in mm.
fn distance_image(step: &Step<'_>, mask: &Mask) -> Result<Vec<u8>, Error> {
    let limit = step.artifacts.read_options.max_bytes;
    let field = espalier_radius::distance_field_within(mask, limit).map_err(|error| step.failed(error))?;
    let distance_mm = |voxel: [usize; 3]| field.distance_mm(voxel.map(|c| c as i64)) as f32;
    nifti_out::mask_scalars(mask, distance_mm).map_err(|error| step.failed(error))
}
