//! The gap between the last voxels inside and the first outside.
//!
//! **Input** a point p on the ridge, the direction t there, the distance D from p to the nearest background centre.
//! **Output** the gap's width in mm. **Notation** ρ the distance of a voxel centre from the axis through p along t.
//! **Steps** 1. Among the voxels in the slab about p across t, as thick as the grid is along t, find the largest
//! ρ < D; all of these are foreground, so the wall lies between it and D.
//! **Guarantees** at most the largest spacing. On dense sections the gap is near 0; where the axis runs along the grid, a
//! section has few different ρ, and D alone overshoots by up to half a voxel (radius 3 between voxels: the nearest
//! background lies at 3.54).
//! **Cost** O((D/s)²).

use glam::DVec3;

/// The gap of a tube through `point` along `tangent` whose nearest background centre is `distance_mm` away.
pub(crate) fn gap_mm(point: DVec3, tangent: DVec3, distance_mm: f64, spacing: DVec3) -> f64 {
    let half_slab = 0.5 * (tangent * spacing).length();
    let low = ((point - distance_mm) / spacing).ceil().to_array().map(|c| c as i64);
    let high = ((point + distance_mm) / spacing).floor().to_array().map(|c| c as i64);
    // Along the axis that the slab cuts most squarely, only a few voxels of a line lie in it.
    let along = largest_axis(tangent / spacing);
    let [first, second] = [(along + 1) % 3, (along + 2) % 3];
    // The gap is at most the largest spacing, so what lies deeper need not be looked at.
    let least = (distance_mm - spacing.max_element()).max(0.0);
    let mut inner_squared = least * least;
    for a in low[first]..=high[first] {
        for b in low[second]..=high[second] {
            let mut voxel = DVec3::ZERO;
            voxel[first] = a as f64;
            voxel[second] = b as f64;
            let base = voxel * spacing - point;
            let slope = tangent[along] * spacing[along];
            let [u, v] = [-half_slab, half_slab].map(|edge| (edge - base.dot(tangent)) / slope);
            for c in u.min(v).ceil() as i64..=u.max(v).floor() as i64 {
                let mut offset = base;
                offset[along] += c as f64 * spacing[along];
                let rho_squared = (offset - tangent * tangent.dot(offset)).length_squared();
                if rho_squared < distance_mm * distance_mm {
                    inner_squared = inner_squared.max(rho_squared);
                }
            }
        }
    }
    (distance_mm - inner_squared.sqrt()).min(spacing.max_element())
}

fn largest_axis(v: DVec3) -> usize {
    (0..3).rev().max_by(|&a, &b| v[a].abs().total_cmp(&v[b].abs())).unwrap_or(0)
}
