//! Which way the skeleton runs.
//!
//! **Input** a skeleton and the distance at each of its voxels. **Output** a unit vector in grid mm at each voxel, or none where
//! branches meet or the skeleton has no direction.
//! **Steps** 1. Gather the skeleton voxels that are connected to the voxel within a window of its own distance,
//! at least [`MIN_WINDOW`] of the largest spacing. 2. Their principal axis about their mean is the direction, if it
//! holds [`MIN_SHARE`] of the variance.
//! **Cost** O(voxels · window) time.

use espalier_model::Skeleton;
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// The window in units of the largest spacing: shorter ones see the staircase of the voxels, not the branch.
const MIN_WINDOW: f64 = 3.0;
/// The window in units of the local distance: the direction of a thick branch changes slowly.
const WINDOW_PER_DISTANCE: f64 = 1.0;
/// The longest window in units of the largest spacing: it bounds the work in bodies that are no branches.
const MAX_WINDOW: f64 = 12.0;
/// Share of the variance that a direction must hold: at a right-angled crossing the larger of two is a half.
const MIN_SHARE: f64 = 0.65;
/// Squarings of the covariance: 2⁶ power iterations, so that a share of 0.65 leaves nothing of the rest.
const N_SQUARINGS: usize = 6;

/// The 26-neighbours of each skeleton voxel, by their indices.
pub(crate) fn neighbors(skeleton: &Skeleton) -> Vec<Vec<usize>> {
    let voxels = skeleton.voxels();
    voxels.par_iter().map(|&voxel| neighbors_of(voxels, voxel)).collect()
}

/// The direction at each skeleton voxel.
pub(crate) fn along(
    skeleton: &Skeleton,
    neighbors: &[Vec<usize>],
    distances_mm: &[f64],
) -> Vec<Option<DVec3>> {
    let voxels = skeleton.voxels();
    let spacing = skeleton.grid().spacing_mm();
    let positions: Vec<DVec3> =
        voxels.iter().map(|voxel| DVec3::from_array(voxel.map(f64::from)) * spacing).collect();
    (0..voxels.len())
        .into_par_iter()
        .map(|start| {
            let distance = distances_mm[start].min(1e9);
            let unit = spacing.max_element();
            let window = (WINDOW_PER_DISTANCE * distance).clamp(MIN_WINDOW * unit, MAX_WINDOW * unit);
            let points = connected_within(start, window, neighbors, &positions);
            principal_axis(&points)
        })
        .collect()
}

/// The indices of the 26-neighbours of a voxel in the sorted voxel list.
fn neighbors_of(voxels: &[[u32; 3]], voxel: [u32; 3]) -> Vec<usize> {
    let [x, y, z] = voxel;
    let mut neighbors = Vec::new();
    for i in 0..9 {
        // Of a row, at most three voxels in turn. The wrapped coordinates of a row outside the grid match none.
        let row = (z.wrapping_add(i / 3).wrapping_sub(1), y.wrapping_add(i % 3).wrapping_sub(1));
        let start = (row.0, row.1, x.saturating_sub(1));
        let first = voxels.partition_point(|&[x, y, z]| (z, y, x) < start);
        let is_near = |near: &&[u32; 3]| (near[2], near[1]) == row && near[0] <= x + 1;
        let n_near = voxels[first..].iter().take_while(is_near).count();
        neighbors.extend((first..first + n_near).filter(|&idx| voxels[idx] != voxel));
    }
    neighbors
}

/// The positions of the voxels that a walk from `start` reaches without leaving a ball about it.
fn connected_within(start: usize, window: f64, neighbors: &[Vec<usize>], positions: &[DVec3]) -> Vec<DVec3> {
    let mut reached = vec![start];
    let mut next = 0;
    while let Some(&current) = reached.get(next) {
        next += 1;
        for &neighbor in &neighbors[current] {
            let is_near = positions[neighbor].distance_squared(positions[start]) <= window * window;
            if is_near && !reached.contains(&neighbor) {
                reached.push(neighbor);
            }
        }
    }
    reached.into_iter().map(|idx| positions[idx]).collect()
}

/// The unit direction of the largest variance, if it is clear.
fn principal_axis(points: &[DVec3]) -> Option<DVec3> {
    let mean = points.iter().sum::<DVec3>() / points.len() as f64;
    let mut covariance = DMat3::ZERO;
    for &point in points {
        let d = point - mean;
        covariance += DMat3::from_cols(d * d.x, d * d.y, d * d.z);
    }
    let trace = |m: &DMat3| m.x_axis.x + m.y_axis.y + m.z_axis.z;
    let total = trace(&covariance);
    if total <= 0.0 {
        return None;
    }
    let mut power = covariance * (1.0 / total);
    for _ in 0..N_SQUARINGS {
        power = power * power;
        power *= 1.0 / trace(&power);
    }
    let columns = [power.x_axis, power.y_axis, power.z_axis];
    let axis = columns.into_iter().max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))?;
    let axis = axis.try_normalize()?;
    (axis.dot(covariance * axis) >= MIN_SHARE * total).then_some(axis)
}
