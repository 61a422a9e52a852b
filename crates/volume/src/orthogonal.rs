//! A volume with sheared voxel axes, resampled to orthogonal ones.
//!
//! **Input** voxels and the affine of a sheared grid (a CT with a tilted gantry). **Output** a volume on the
//! orthogonal grid with the nearest axes and the same spacing, large enough to hold all of the old one.
//! **Steps** 1. the nearest orthogonal axes: the polar factor of the unit axes; 2. the box of the old voxel
//! centres along them; 3. the value at each new voxel by the policy of [`interpolate`](crate::interpolate).
//! **Source** the polar factor by Newton's iteration, [Higham1986] equation 3.1.
//! **Cost** O(new voxels), in parallel over planes.

use espalier_model::nifti_out::stored_grid;
use espalier_model::{Grid, Report, Voxels};
use glam::{DAffine3, DMat3, DVec3};

use crate::ReadError;
use crate::interpolate::{Lookup, bytes_per_voxel, resample_voxels};
use crate::stored::Stored;

/// More than Newton's iteration needs from any axes that are not singular.
const MAX_ITERATIONS: usize = 60;

/// A sheared volume on the nearest orthogonal grid.
pub(crate) fn resample(
    voxels: &Voxels,
    stored: &Stored,
    max_bytes: u64,
    report: &mut Report,
) -> Result<(Grid, Voxels), ReadError> {
    let (shape, world_from_voxel) = (stored.shape, stored.world_from_voxel);
    let grid = orthogonal_grid(shape, world_from_voxel, max_bytes, bytes_per_voxel(voxels))?;
    let old_from_new = world_from_voxel.inverse() * grid.world_from_voxel();
    let lookup = Lookup { old_shape: shape, new_shape: grid.shape(), old_from_new, is_scan: false };
    let (resampled, how) = resample_voxels!(lookup, voxels, (stored.slope, stored.intercept));
    let [[ox, oy, oz], [nx, ny, nz]] = [shape, grid.shape()];
    report.warn(
        "W-VOLUME-SHEAR",
        format!("the voxel axes are sheared: {ox}x{oy}x{oz} voxels were resampled to {nx}x{ny}x{nz} orthogonal ones by \
                 {how}"),
    );
    Ok((grid, resampled))
}

fn orthogonal_grid(
    shape: [usize; 3],
    world_from_voxel: DAffine3,
    max_bytes: u64,
    voxel_bytes: u64,
) -> Result<Grid, ReadError> {
    let axes = world_from_voxel.matrix3;
    let spacing = DVec3::new(axes.x_axis.length(), axes.y_axis.length(), axes.z_axis.length());
    let unit_axes = axes * DMat3::from_diagonal(spacing.recip());
    let new_axes = nearest_orthogonal(unit_axes) * DMat3::from_diagonal(spacing);

    // The box of the old voxel centres, in new voxels.
    let new_from_world = new_axes.inverse();
    let far = DVec3::from_array(shape.map(|extent| extent as f64 - 1.0));
    let corners = (0..8_u32).map(|i| {
        let corner = DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)) * far;
        new_from_world * world_from_voxel.transform_point3(corner)
    });
    let (low, high) = corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), corner| {
        (low.min(corner), high.max(corner))
    });
    // Rounding must not add a plane.
    let extents = (high - low - 1e-6).ceil().max(DVec3::ZERO) + 1.0;
    let needed = extents.x * extents.y * extents.z * voxel_bytes as f64;
    if needed.is_nan() || needed > max_bytes as f64 {
        return Err(ReadError::TooLarge { needed: needed as u64, limit: max_bytes });
    }
    let new_shape = extents.to_array().map(|extent| extent as usize);
    let affine = DAffine3::from_mat3_translation(new_axes, new_axes * low);
    Grid::new(new_shape, affine)
        .and_then(|grid| stored_grid(&grid))
        .map_err(|problem| ReadError::Grid { form: "orthogonal grid", problem })
}

/// The orthogonal matrix nearest to `axes`, of the same handedness.
fn nearest_orthogonal(axes: DMat3) -> DMat3 {
    let mut current = axes;
    for _ in 0..MAX_ITERATIONS {
        let next = (current + current.inverse().transpose()) * 0.5;
        let change = next - current;
        current = next;
        if change.to_cols_array().iter().all(|v| v.abs() < 1e-15) {
            break;
        }
    }
    current
}
