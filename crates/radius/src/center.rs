//! From a skeleton voxel up to the ridge of the distance field.
//!
//! **Input** the field, a voxel, the skeleton's direction there. **Output** a point in grid mm.
//! **Notation** D the distance field, t the direction.
//! **Steps** 1. Climb: at most a few times, step to the 26-neighbour with the largest D, if it is larger, among
//! steps that go more across t than along it. 2. Centroid of the 27 voxels there, weighted by D⁸. 3. Take the part
//! along t away, so that neighbouring voxels of a curve never run into one another.
//! **Guarantees** the point's voxel, or else the climbed voxel, is foreground.
//! **Cost** 27 look-ups a step.

use glam::DVec3;

use crate::distance::{DistanceField, neighborhood};

/// Cosine to the direction above which a step goes along the branch.
const MAX_ALONG: f64 = 0.5;

/// The point of the ridge that belongs to `voxel`, in grid mm.
pub(crate) fn on_ridge(
    field: &DistanceField,
    voxel: [i64; 3],
    tangent: Option<DVec3>,
    climb_steps: u32,
) -> DVec3 {
    let tangent = tangent.unwrap_or(DVec3::ZERO);
    let start = field.position_mm(voxel);
    let mut summit = voxel;
    for _ in 0..climb_steps {
        let Some(higher) = higher_neighbor(field, summit, tangent) else { break };
        summit = higher;
    }
    let shift = weighted_centroid(field, summit) - start;
    let point = start + shift - tangent * tangent.dot(shift);
    // In a mask bent within one voxel, what is left of the shift may point out of it.
    if field.distance_mm(nearest_voxel(field, point)) > 0.0 { point } else { start }
}

/// The voxel whose cell holds a point.
pub(crate) fn nearest_voxel(field: &DistanceField, point: DVec3) -> [i64; 3] {
    (point / field.spacing_mm() + 0.5).floor().to_array().map(|c| c as i64)
}

fn higher_neighbor(field: &DistanceField, [x, y, z]: [i64; 3], tangent: DVec3) -> Option<[i64; 3]> {
    let mut best = None;
    let mut best_distance = field.distance_mm([x, y, z]);
    for offset in neighborhood() {
        let step = field.position_mm(offset);
        let voxel = [x + offset[0], y + offset[1], z + offset[2]];
        let distance = field.distance_mm(voxel);
        if distance > best_distance && step.dot(tangent).abs() <= MAX_ALONG * step.length() {
            (best, best_distance) = (Some(voxel), distance);
        }
    }
    best
}

fn weighted_centroid(field: &DistanceField, summit: [i64; 3]) -> DVec3 {
    let origin = field.position_mm(summit);
    let largest = field.neighborhood_max_mm(summit);
    if !(largest > 0.0 && largest.is_finite()) {
        return origin;
    }
    let (mut sum, mut total) = (DVec3::ZERO, 0.0);
    for offset in neighborhood() {
        let voxel = [summit[0] + offset[0], summit[1] + offset[1], summit[2] + offset[2]];
        let squared = field.distance_mm(voxel) / largest * (field.distance_mm(voxel) / largest);
        let weight = squared * squared * squared * squared;
        sum += field.position_mm(offset) * weight;
        total += weight;
    }
    origin + sum / total
}
