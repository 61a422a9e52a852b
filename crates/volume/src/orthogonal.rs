//! A volume with sheared voxel axes, resampled to orthogonal ones.
//!
//! **Input** voxels and the affine of a sheared grid (a CT with a tilted gantry). **Output** a volume on the
//! orthogonal grid with the nearest axes and the same spacing, large enough to hold all of the old one.
//! **Steps** 1. the nearest orthogonal axes: the polar factor of the unit axes; 2. the box of the old voxel
//! centres along them; 3. the value at each new voxel: the nearest old one for integers, which may be labels,
//! trilinear for floats; outside the old volume its smallest value, which is air in a CT and background in a mask.
//! **Source** the polar factor by Newton's iteration, [Higham1986] equation 3.1.
//! **Cost** O(new voxels), in parallel over planes.

use espalier_model::nifti_out::stored_grid;
use espalier_model::{Grid, Report, Voxels};
use glam::{DAffine3, DMat3, DVec3};
use ndarray::Array3;
use rayon::prelude::*;

use crate::ReadError;

/// More than Newton's iteration needs from any axes that are not singular.
const MAX_ITERATIONS: usize = 60;

/// A sheared volume on the nearest orthogonal grid.
pub(crate) fn resample(
    voxels: &Voxels,
    shape: [usize; 3],
    world_from_voxel: DAffine3,
    max_bytes: u64,
    report: &mut Report,
) -> Result<(Grid, Voxels), ReadError> {
    let grid = orthogonal_grid(shape, world_from_voxel, max_bytes, bytes_per_voxel(voxels))?;
    let old_from_new = world_from_voxel.inverse() * grid.world_from_voxel();
    let lookup = Lookup { old_shape: shape, new_shape: grid.shape(), old_from_new };
    let resampled = match voxels {
        Voxels::U8(array) => Voxels::U8(lookup.nearest(array)),
        Voxels::I16(array) => Voxels::I16(lookup.nearest(array)),
        Voxels::U16(array) => Voxels::U16(lookup.nearest(array)),
        Voxels::I32(array) => Voxels::I32(lookup.nearest(array)),
        Voxels::U32(array) => Voxels::U32(lookup.nearest(array)),
        Voxels::F32(array) => Voxels::F32(lookup.trilinear(array)),
        Voxels::F64(array) => Voxels::F64(lookup.trilinear(array)),
    };
    let [[ox, oy, oz], [nx, ny, nz]] = [shape, grid.shape()];
    report.warn(
        "W-VOLUME-SHEAR",
        format!("the voxel axes are sheared: {ox}x{oy}x{oz} voxels were resampled to {nx}x{ny}x{nz} orthogonal ones"),
    );
    Ok((grid, resampled))
}

fn bytes_per_voxel(voxels: &Voxels) -> u64 {
    match voxels {
        Voxels::U8(_) => 1,
        Voxels::I16(_) | Voxels::U16(_) => 2,
        Voxels::I32(_) | Voxels::U32(_) | Voxels::F32(_) => 4,
        Voxels::F64(_) => 8,
    }
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

/// Where each new voxel finds its value.
struct Lookup {
    old_shape: [usize; 3],
    new_shape: [usize; 3],
    old_from_new: DAffine3,
}

impl Lookup {
    fn nearest<T: Copy + Ord + Default + Send + Sync>(&self, old: &Array3<T>) -> Array3<T> {
        let fill = old.iter().copied().min().unwrap_or_default();
        self.map(|point| {
            let rounded = (point + 0.5).floor();
            self.inside(rounded).map_or(fill, |[x, y, z]| old[[z, y, x]])
        })
    }

    fn trilinear<T: Copy + Into<f64> + FromF64 + Default + Send + Sync>(&self, old: &Array3<T>) -> Array3<T> {
        let finite = old.iter().map(|&v| v.into()).filter(|v| v.is_finite());
        let fill = finite.fold(f64::INFINITY, f64::min);
        let fill = if fill.is_finite() { fill } else { 0.0 };
        self.map(|point| {
            if self.inside((point + 0.5).floor()).is_none() {
                return T::from_f64(fill);
            }
            let base = point.floor();
            let weight = point - base;
            let mut sum = 0.0;
            for corner in 0..8_u32 {
                let step =
                    DVec3::new(f64::from(corner & 1), f64::from(corner >> 1 & 1), f64::from(corner >> 2));
                let share = (DVec3::ONE - step - weight * (DVec3::ONE - 2.0 * step)).to_array();
                let product = share[0] * share[1] * share[2];
                // A neighbour without weight must not turn the sum into NaN.
                if product > 0.0 {
                    let [x, y, z] = self.clamped(base + step);
                    sum += product * old[[z, y, x]].into();
                }
            }
            T::from_f64(sum)
        })
    }

    #[expect(clippy::expect_used, reason = "the number of values is the product of the extents")]
    fn map<T: Send + Clone>(&self, value: impl Fn(DVec3) -> T + Sync) -> Array3<T> {
        let [nx, ny, nz] = self.new_shape;
        let plane = |z: usize| {
            let value = &value;
            (0..ny).flat_map(move |y| {
                (0..nx).map(move |x| {
                    value(self.old_from_new.transform_point3(DVec3::new(x as f64, y as f64, z as f64)))
                })
            })
        };
        let values: Vec<T> = (0..nz).into_par_iter().flat_map_iter(plane).collect();
        Array3::from_shape_vec((nz, ny, nx), values).expect("one value for each voxel")
    }

    fn inside(&self, voxel: DVec3) -> Option<[usize; 3]> {
        let far = DVec3::from_array(self.old_shape.map(|extent| extent as f64 - 1.0));
        let is_inside = voxel.cmpge(DVec3::ZERO).all() && voxel.cmple(far).all();
        is_inside.then(|| voxel.to_array().map(|v| v as usize))
    }

    fn clamped(&self, voxel: DVec3) -> [usize; 3] {
        let far = DVec3::from_array(self.old_shape.map(|extent| extent as f64 - 1.0));
        voxel.clamp(DVec3::ZERO, far).to_array().map(|v| v as usize)
    }
}

trait FromF64 {
    fn from_f64(value: f64) -> Self;
}

impl FromF64 for f32 {
    fn from_f64(value: f64) -> Self {
        value as Self
    }
}

impl FromF64 for f64 {
    fn from_f64(value: f64) -> Self {
        value
    }
}
