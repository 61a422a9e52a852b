//! Whether a point lies in the mask, and how far a ray stays in it.

use espalier_model::Mask;
use glam::DVec3;

/// Steps of a ray, in smallest spacings.
const RAY_STEP: f64 = 0.125;

/// Whether the voxel whose cell holds a point (RAS+ mm) is foreground.
pub(crate) fn is_inside(mask: &Mask, point_mm: DVec3) -> bool {
    let point_voxel = mask.grid().voxel_from_world().transform_point3(point_mm);
    mask.grid().voxel_at(point_voxel).is_some_and(|voxel| mask.contains(voxel.map(|v| v as i64)))
}

/// How far a ray from `origin_mm` stays in the mask, at most `limit_mm`; 0 if it starts outside.
pub(crate) fn free_length_mm(mask: &Mask, origin_mm: DVec3, direction: DVec3, limit_mm: f64) -> f64 {
    let step_mm = RAY_STEP * mask.grid().spacing_mm().min_element();
    let mut inside_mm = 0.0;
    let mut n_steps = 0.0;
    while is_inside(mask, origin_mm + direction * (step_mm * n_steps)) {
        inside_mm = step_mm * n_steps;
        if inside_mm >= limit_mm {
            return limit_mm;
        }
        n_steps += 1.0;
    }
    inside_mm
}
