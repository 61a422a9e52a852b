//! Radii: a mask and its curve skeleton in, the inscribed sphere at each skeleton voxel out.
//!
//! | step | file | what |
//! |--:|---|---|
//! | 1 | `nearest` | exact anisotropic distance of any place to the background, from the mask's bits |
//! | 2 | `tangent` | which way the skeleton runs at each of its voxels |
//! | 3 | `ridge` | from the voxel to the axis of the branch, and the radius there |
//! | 4 | `section` | area and centroid of the mask's cross-section |
//! | 5 | `boundary` | where the section is not round: the ridge of the distance between voxels |
//! | 6 | `gap` | the wall lies between the last voxels inside and the first outside |
//! | – | `distance` | the distance of every foreground voxel, for those who ask for the whole field |
//!
//! **Spaces** inside this crate points are *grid mm*: voxel coordinates times spacing. Spheres come out in RAS+ mm.

mod boundary;
mod distance;
mod error;
mod gap;
mod nearest;
mod params;
mod ridge;
mod section;
mod tangent;

use espalier_model::{InscribedSpheres, Mask, Report, Skeleton, Sphere};
use glam::DVec3;
use rayon::prelude::*;

pub use distance::{DistanceField, distance_field, distance_field_within};
pub use error::Error;
pub use params::{Params, Rule};

use nearest::Background;
use ridge::OnAxis;

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
    let distances_mm = distances_mm(mask, skeleton)?;
    let tangents = tangent::tangents(skeleton, &distances_mm);
    let spheres: Vec<Sphere> = (0..skeleton.voxels().len())
        .into_par_iter()
        .map(|i| measure(mask, skeleton.voxels()[i], (distances_mm[i], tangents[i]), params))
        .collect();
    let report = report(skeleton, &spheres);
    Ok(Measured { spheres: InscribedSpheres(spheres), report })
}

/// The exact distance from each voxel of `skeleton` to the nearest background centre of `mask`, in mm; infinite in a
/// mask without background.
///
/// # Errors
/// As [`inscribed_spheres`].
pub fn distances_mm(mask: &Mask, skeleton: &Skeleton) -> Result<Vec<f64>, Error> {
    check(mask, skeleton)?;
    let background = Background::of(mask);
    let distance_mm = |voxel: &[u32; 3]| background.distance_mm(voxel.map(i64::from));
    Ok(skeleton.voxels().par_iter().map(distance_mm).collect())
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

/// The sphere of one skeleton voxel, whose own distance and direction are known.
fn measure(
    mask: &Mask,
    voxel: [u32; 3],
    (distance_mm, tangent): (f64, Option<DVec3>),
    params: &Params,
) -> Sphere {
    let background = Background::of(mask);
    let voxel = voxel.map(i64::from);
    let OnAxis { center, radius_mm, section } = match params.rule {
        Rule::Voxel => {
            let center = background.position_mm(voxel);
            let section = tangent
                .and_then(|tangent| section::through(background, (voxel, center), tangent, distance_mm));
            OnAxis { center, radius_mm: distance_mm, section }
        }
        Rule::NeighborhoodMax => OnAxis {
            radius_mm: background.neighborhood_max_mm(voxel),
            ..ridge::on_axis(background, voxel, (distance_mm, tangent), params.climb_steps)
        },
        Rule::Ridge => ridge::on_axis(background, voxel, (distance_mm, tangent), params.climb_steps),
    };
    let border_mm = background.border_mm(center);
    // Without any background the border of the scan is all there is to measure.
    let known = |distance_mm: f64| if distance_mm.is_finite() { distance_mm } else { border_mm };
    let offset_mm = params.offset_voxels * background.spacing_mm().min_element();
    let radius_mm = (known(radius_mm) + offset_mm).max(0.0);
    Sphere {
        center_mm: mask.grid().world_from_voxel().transform_point3(center / background.spacing_mm()),
        radius_mm,
        distance_mm: known(distance_mm),
        area_radius_mm: section.map_or(f64::NAN, |section| section.area_radius_mm),
        is_cut: border_mm < radius_mm,
    }
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
