//! Radii: a mask and its curve skeleton in, the inscribed sphere at each skeleton voxel out.
//!
//! | step | file | what |
//! |--:|---|---|
//! | 1 | `distance` | exact anisotropic distance of each foreground voxel to the background |
//! | 2 | `tangent` | which way the skeleton runs at each of its voxels |
//! | 3 | `center` | from the voxel up to the ridge of the distance field, across the branch only |
//! | 4 | `boundary` | the background centres around it: the distance at any point between voxels |
//! | 5 | `gap` | the wall lies between the last voxels inside and the first outside |
//! | 6 | `section` | area of the mask's cross-section there |
//!
//! **Spaces** inside this crate points are *grid mm*: voxel coordinates times spacing. Spheres come out in RAS+ mm.

mod boundary;
mod center;
mod distance;
mod error;
mod gap;
mod params;
mod section;
mod tangent;

use espalier_model::{Grid, InscribedSpheres, Mask, Report, Skeleton, Sphere};
use glam::DVec3;
use rayon::prelude::*;

pub use distance::{DistanceField, distance_field};
pub use error::Error;
pub use params::{Params, Rule};

use boundary::Boundary;

/// The inscribed spheres of a skeleton and what their making did.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// One sphere for each skeleton voxel, in the same order.
    pub spheres: InscribedSpheres,
    /// Counts `spheres`, `cut_spheres`, `sections_without_direction`, `radius_min_mm`, `radius_max_mm`,
    /// `center_shift_mean_mm`; a warning where the border of the scan cuts spheres.
    pub report: Report,
}

/// The inscribed sphere at each voxel of `skeleton` in `mask`.
///
/// # Errors
/// [`Error::GridMismatch`] if the two have different grids, [`Error::EmptySkeleton`], and [`Error::OutsideMask`]
/// at the first skeleton voxel that is background.
pub fn inscribed_spheres(mask: &Mask, skeleton: &Skeleton, params: &Params) -> Result<Measured, Error> {
    check(mask, skeleton)?;
    let field = distance_field(mask);
    let tangents = tangent::tangents(skeleton, &field);
    let spheres: Vec<Sphere> = skeleton
        .voxels()
        .par_iter()
        .zip(&tangents)
        .map(|(&voxel, &tangent)| measure(mask, &field, voxel, tangent, params))
        .collect();
    let report = report(skeleton, &spheres);
    Ok(Measured { spheres: InscribedSpheres(spheres), report })
}

fn check(mask: &Mask, skeleton: &Skeleton) -> Result<(), Error> {
    if mask.grid() != skeleton.grid() {
        return Err(Error::GridMismatch { mask: mask.grid().shape(), skeleton: skeleton.grid().shape() });
    }
    if skeleton.voxels().is_empty() {
        return Err(Error::EmptySkeleton);
    }
    match skeleton.voxels().iter().find(|voxel| !mask.contains(voxel.map(i64::from))) {
        Some(&voxel) => Err(Error::OutsideMask { voxel }),
        None => Ok(()),
    }
}

/// The sphere of one skeleton voxel.
fn measure(
    mask: &Mask,
    field: &DistanceField,
    voxel: [u32; 3],
    tangent: Option<DVec3>,
    params: &Params,
) -> Sphere {
    let grid = mask.grid();
    let spacing = grid.spacing_mm();
    let last_mm = DVec3::from_array(grid.shape().map(|n| (n - 1) as f64)) * spacing;
    let voxel = voxel.map(i64::from);
    let (center, distance_mm) = match params.rule {
        Rule::Voxel => (field.position_mm(voxel), field.distance_mm(voxel)),
        Rule::NeighborhoodMax => {
            (center::on_ridge(field, voxel, tangent, params.climb_steps), field.neighborhood_max_mm(voxel))
        }
        Rule::Ridge => on_ridge_between_voxels(field, voxel, tangent, params.climb_steps, last_mm),
    };
    // Where the border cuts the organ lengthwise, its ridge may lie outside of what was scanned.
    let center = center.clamp(DVec3::ZERO, last_mm);
    let border_mm = distance_to_border(grid, center);
    // Without any background the border of the scan is all there is to measure.
    let known = |distance_mm: f64| if distance_mm.is_finite() { distance_mm } else { border_mm };
    let radius_mm = (known(distance_mm) + params.offset_voxels * spacing.min_element()).max(0.0);
    Sphere {
        center_mm: grid.world_from_voxel().transform_point3(center / spacing),
        radius_mm,
        distance_mm: known(field.distance_mm(voxel)),
        area_radius_mm: tangent
            .and_then(|tangent| section::area_radius_mm(mask, center, tangent, radius_mm))
            .unwrap_or(f64::NAN),
        is_cut: border_mm < radius_mm,
    }
}

/// Centre and radius by [`Rule::Ridge`], within the box from the first to the last voxel at `last_mm`.
fn on_ridge_between_voxels(
    field: &DistanceField,
    voxel: [i64; 3],
    tangent: Option<DVec3>,
    climb_steps: u32,
    last_mm: DVec3,
) -> (DVec3, f64) {
    let start = center::on_ridge(field, voxel, tangent, climb_steps).clamp(DVec3::ZERO, last_mm);
    let (mut center, mut distance_mm) = Boundary::around(field, start).highest_near(start, tangent, last_mm);
    if distance_mm < field.distance_mm(voxel) {
        // In branches of one or two voxels the weighted centroid can lie nearer to the wall than the voxel.
        let start = field.position_mm(voxel);
        (center, distance_mm) = Boundary::around(field, start).highest_near(start, tangent, last_mm);
    }
    match tangent {
        Some(tangent) if distance_mm.is_finite() => {
            (center, gap::radius_in_gap(center, tangent, distance_mm, field.spacing_mm()))
        }
        _ => (center, distance_mm),
    }
}

/// The distance from a point to the outer faces of the scan, in mm.
fn distance_to_border(grid: &Grid, point: DVec3) -> f64 {
    let spacing = grid.spacing_mm();
    let extent = DVec3::from_array(grid.shape().map(|n| n as f64)) * spacing;
    let from_low = point + 0.5 * spacing;
    from_low.min(extent - from_low).min_element()
}

fn report(skeleton: &Skeleton, spheres: &[Sphere]) -> Report {
    let mut report = Report::default();
    let n_cut = spheres.iter().filter(|sphere| sphere.is_cut).count();
    let world_from_voxel = skeleton.grid().world_from_voxel();
    let shift_mm: f64 = skeleton
        .voxels()
        .iter()
        .zip(spheres)
        .map(|(voxel, sphere)| {
            let start = world_from_voxel.transform_point3(DVec3::from_array(voxel.map(f64::from)));
            start.distance(sphere.center_mm)
        })
        .sum();
    let radii = || spheres.iter().map(|sphere| sphere.radius_mm);
    report.count_usize("spheres", spheres.len());
    report.count_usize("cut_spheres", n_cut);
    report.count_usize(
        "sections_without_direction",
        spheres.iter().filter(|sphere| sphere.area_radius_mm.is_nan()).count(),
    );
    report.count("radius_min_mm", radii().fold(f64::INFINITY, f64::min));
    report.count("radius_max_mm", radii().fold(0.0, f64::max));
    report.count("center_shift_mean_mm", shift_mm / spheres.len() as f64);
    if n_cut > 0 {
        report.warn(
            "W-RADIUS-CUT",
            format!(
                "{n_cut} of {} spheres touch the border of the scan: their radii are lower bounds",
                spheres.len()
            ),
        );
    }
    report
}
