//! The mask's cross-section: its area and its centroid.
//!
//! **Input** a mask, a point inside, the direction of the branch, the distance r to the background there, at least
//! [`MIN_SPACINGS`] of the largest spacing. **Output** the radius of the circle with the section's area, in mm, and the
//! section's centroid, in grid mm.
//! **Steps** 1. Lay a square grid over the plane across the branch, 8 to 24 steps to the radius,
//! and two more like it a voxel before and behind, where those lie in the scan.
//! 2. Flood from the point over the places that are
//! in the mask on most of the planes, in steps along the grid. 3. Area = places · step², the mean of the planes.
//! **Guarantees** none where the flood reaches [`LIMIT_RADII`] · r from the point along an axis of the grid: there
//! the plane runs along another branch, or the mask is no tube.
//! **Cost** O((LIMIT_RADII · samples)²).

use std::f64::consts::PI;

use espalier_geom::space::plane_axes;
use glam::DVec3;

use crate::nearest::Background;

/// Grid steps in a radius: at least 8; at most 24, which bounds the work; between, two to a voxel, since coarser ones beat
/// against the voxels (a trachea along the grid came out 2 % too thin with 8).
const SAMPLES: [f64; 2] = [8.0, 24.0];
const SAMPLES_PER_VOXEL: f64 = 2.0;
/// How far a section may reach, in inscribed radii.
const LIMIT_RADII: i64 = 3;

/// The least radius taken for the extent of the grid: a section of one or two voxels is as wide as its voxels.
const MIN_SPACINGS: f64 = 0.75;

/// The planes to both sides of the section, in voxels along the branch.
const PLANE_STEP: f64 = 1.0;

/// A cross-section.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Section {
    /// The radius of the circle of its area, in mm.
    pub(crate) area_radius_mm: f64,
    /// Its centroid, in grid mm.
    pub(crate) centroid: DVec3,
}

/// The section through `point` (grid mm) across `tangent`.
pub(crate) fn through(
    background: Background<'_>,
    point: DVec3,
    tangent: DVec3,
    radius_mm: f64,
) -> Option<Section> {
    let spacing = background.spacing_mm();
    let extent_mm = radius_mm.max(MIN_SPACINGS * spacing.max_element());
    let n_samples =
        (SAMPLES_PER_VOXEL * extent_mm / spacing.min_element()).ceil().clamp(SAMPLES[0], SAMPLES[1]);
    let step_mm = extent_mm / n_samples;
    let limit = LIMIT_RADII * n_samples as i64;
    let width = 2 * limit + 1;
    let (right, up) = plane_axes(tangent, DVec3::Z);

    // In voxels, with the half that rounding down needs.
    let along_voxel = tangent * (PLANE_STEP * (tangent.abs() * spacing).max_element()) / spacing;
    let (right_voxel, up_voxel) = (right * step_mm / spacing, up * step_mm / spacing);
    let planes: Vec<DVec3> = [-1.0, 0.0, 1.0]
        .into_iter()
        .map(|step| point / spacing + along_voxel * step)
        .filter(|&origin| background.is_in_scan(origin))
        .map(|origin| origin + 0.5)
        .collect();
    let n_planes = planes.len() as i64;
    let n_inside_at = |u: i64, v: i64| {
        let aside = right_voxel * u as f64 + up_voxel * v as f64;
        let is_inside =
            |plane: &&DVec3| background.is_foreground((**plane + aside).floor().to_array().map(|c| c as i64));
        planes.iter().filter(is_inside).count() as i64
    };

    let mut is_seen = vec![false; (width * width) as usize];
    let mut stack = vec![(0, 0)];
    is_seen[(limit * width + limit) as usize] = true;
    let (mut n_inside, mut sum_u, mut sum_v) = (0_i64, 0_i64, 0_i64);
    while let Some((u, v)) = stack.pop() {
        let n = n_inside_at(u, v);
        (n_inside, sum_u, sum_v) = (n_inside + n, sum_u + n * u, sum_v + n * v);
        if 2 * n <= n_planes {
            continue;
        }
        if u.abs() == limit || v.abs() == limit {
            return None;
        }
        for (u, v) in [(u - 1, v), (u + 1, v), (u, v - 1), (u, v + 1)] {
            let seen = &mut is_seen[((v + limit) * width + u + limit) as usize];
            if !*seen {
                *seen = true;
                stack.push((u, v));
            }
        }
    }
    (n_inside > 0).then(|| {
        let n = n_inside as f64;
        Section {
            area_radius_mm: (n / (n_planes as f64 * PI)).sqrt() * step_mm,
            centroid: point + (right * sum_u as f64 + up * sum_v as f64) * (step_mm / n),
        }
    })
}
