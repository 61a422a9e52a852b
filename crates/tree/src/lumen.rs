//! Whether two places lie in one lumen, with no wall and no waist between them.
//!
//! **Input** a mask and two spheres in it. **Output** whether the lumen between them is as wide as at the narrower of them.
//! **Notation** ρ the smaller radius times [`WIDE`], at least half the diagonal of a voxel: then every voxel on the way counts.
//! **Steps** Every voxel whose centre is nearer than ρ to the straight way between the centres must be foreground; what lies
//! beyond the scan is not known and counts for nothing.
//! **Why so wide?** Two round tubes of one radius that touch or overlap have a notch on either side, and between them the
//! body is as wide as that leaves: with [`WIDE`] of 0.9 tubes whose axes are 0.9 radii apart, or more, are two.
//! In a flat lumen the depth between two lines is that of the lines, or more.
//! **Cost** O(voxels of the box about the way).

use espalier_geom::space::nearest_parameter;
use espalier_model::Mask;
use glam::DVec3;

use crate::graph::Sample;

/// How wide the lumen between two places is at least, in the smaller of their radii.
const WIDE: f64 = 0.9;

/// Whether the lumen between two places is wide all the way.
pub(crate) fn is_one(mask: &Mask, a: Sample, b: Sample) -> bool {
    let grid = mask.grid();
    let voxel_from_world = grid.voxel_from_world();
    // Axes are orthogonal, but may be turned: all in mm along them.
    let spacing = grid.spacing_mm();
    let reach_mm = (WIDE * a.radius_mm.min(b.radius_mm)).max(0.5 * spacing.length());
    let [from, to] = [a, b].map(|s| voxel_from_world.transform_point3(s.position_mm) * spacing);
    let last = DVec3::from_array(grid.shape().map(|extent| extent as f64 - 1.0));
    let low = ((from.min(to) - reach_mm) / spacing).ceil().max(DVec3::ZERO);
    let high = ((from.max(to) + reach_mm) / spacing).floor().min(last);
    let range = |axis: usize| low[axis] as i64..=high[axis] as i64;
    if !low.cmple(high).all() {
        return true;
    }
    let mut near = range(2).flat_map(|z| range(1).flat_map(move |y| range(0).map(move |x| [x, y, z])));
    near.all(|voxel| {
        let point = DVec3::from_array(voxel.map(|coordinate| coordinate as f64)) * spacing;
        let share = nearest_parameter(point, from, to);
        mask.contains(voxel) || point.distance(from.lerp(to, share)) >= reach_mm
    })
}
