//! Area of the mask's cross-section.
//!
//! **Input** a mask, a centre, the direction of the branch, the inscribed radius r, at least
//! [`MIN_SPACINGS`] of the largest spacing. **Output** the radius of the
//! circle with the section's area, in mm.
//! **Steps** 1. Lay a square grid over the plane across the branch, [`SAMPLES_PER_RADIUS`] steps to the radius.
//! 2. Flood from the centre over the points in the mask, in steps along the grid. 3. Area = points · step².
//! **Guarantees** none where the flood reaches [`LIMIT_RADII`] · r from the centre along an axis of the grid: there
//! the plane runs along another branch, or the mask is no tube.
//! **Cost** O((LIMIT_RADII · SAMPLES_PER_RADIUS)²).

use std::f64::consts::PI;

use espalier_geom::space::plane_axes;
use espalier_model::Mask;
use glam::DVec3;

/// Grid steps in an inscribed radius: an error of the area's radius near 1 %.
const SAMPLES_PER_RADIUS: i64 = 8;
/// How far a section may reach, in inscribed radii.
const LIMIT_RADII: i64 = 3;

/// The least radius taken for the extent of the grid: a section of one or two voxels is as wide as its voxels.
const MIN_SPACINGS: f64 = 0.75;

/// The radius of the circle with the area of the section through `center` (grid mm) across `tangent`.
pub(crate) fn area_radius_mm(mask: &Mask, center: DVec3, tangent: DVec3, radius_mm: f64) -> Option<f64> {
    let limit = LIMIT_RADII * SAMPLES_PER_RADIUS;
    let width = 2 * limit + 1;
    let spacing = mask.grid().spacing_mm();
    let step_mm = radius_mm.max(MIN_SPACINGS * spacing.max_element()) / SAMPLES_PER_RADIUS as f64;
    let (right, up) = plane_axes(tangent, DVec3::Z);
    let is_inside = |u: i64, v: i64| {
        let point = center + (right * u as f64 + up * v as f64) * step_mm;
        mask.contains((point / spacing + 0.5).floor().to_array().map(|c| c as i64))
    };

    let mut is_seen = vec![false; (width * width) as usize];
    let mut stack = vec![(0, 0)];
    is_seen[(limit * width + limit) as usize] = true;
    let mut n_inside = 0_u32;
    while let Some((u, v)) = stack.pop() {
        if !is_inside(u, v) {
            continue;
        }
        if u.abs() == limit || v.abs() == limit {
            return None;
        }
        n_inside += 1;
        for (u, v) in [(u - 1, v), (u + 1, v), (u, v - 1), (u, v + 1)] {
            let seen = &mut is_seen[((v + limit) * width + u + limit) as usize];
            if !*seen {
                *seen = true;
                stack.push((u, v));
            }
        }
    }
    (n_inside > 0).then(|| (f64::from(n_inside) / PI).sqrt() * step_mm)
}
