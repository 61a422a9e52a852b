//! Whether a point lies in the mask, and how far a ray stays in it.

use espalier_model::{Grid, Mask};
use glam::DVec3;

/// Steps of a ray, in smallest spacings.
const RAY_STEP: f64 = 0.125;

/// Whether the voxel whose cell holds a point (RAS+ mm) is foreground.
pub(crate) fn is_inside(mask: &Mask, point_mm: DVec3) -> bool {
    let point_voxel = mask.grid().voxel_from_world().transform_point3(point_mm);
    mask.grid().voxel_at(point_voxel).is_some_and(|voxel| mask.contains(voxel.map(|v| v as i64)))
}

/// A point, or if it lies outside of the scan, the nearest along its axes inside.
pub(crate) fn in_scan(grid: &Grid, point_mm: DVec3) -> DVec3 {
    let voxel = grid.voxel_from_world().transform_point3(point_mm);
    let last = DVec3::from_array(grid.shape().map(|n| n as f64 - 0.5));
    let clamped = voxel.clamp(DVec3::splat(-0.5), last);
    if clamped == voxel { point_mm } else { grid.world_from_voxel().transform_point3(clamped) }
}

/// How far a ray from `origin_mm` stays in the mask, at most `limit_mm`; `None` if it starts outside.
pub(crate) fn free_length_mm(mask: &Mask, origin_mm: DVec3, direction: DVec3, limit_mm: f64) -> Option<f64> {
    let step_mm = RAY_STEP * mask.grid().spacing_mm().min_element();
    let mut inside_mm = None;
    let mut n_steps = 0.0;
    while is_inside(mask, origin_mm + direction * (step_mm * n_steps)) {
        inside_mm = Some(step_mm * n_steps);
        if step_mm * n_steps >= limit_mm {
            return Some(limit_mm);
        }
        n_steps += 1.0;
    }
    inside_mm
}

/// Whether a ray that stays in the mask for `free_mm` leaves the scan there.
pub(crate) fn leaves_scan(mask: &Mask, origin_mm: DVec3, direction: DVec3, free_mm: f64) -> bool {
    let step_mm = RAY_STEP * mask.grid().spacing_mm().min_element();
    let next_mm = origin_mm + direction * (free_mm + step_mm);
    mask.grid().voxel_at(mask.grid().voxel_from_world().transform_point3(next_mm)).is_none()
}
