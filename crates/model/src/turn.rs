//! Masks and skeletons with their axes turned to right, anterior, superior.
//!
//! **Input** a mask or a skeleton on any grid. **Output** the same voxels in the same places of the world, x to the
//! right, y to anterior, z to superior, as near as the grid's axes allow.
//! **Steps** 1. Permute the axes, and reverse those that point the other way. 2. The new first voxel's centre is the
//! origin; it is rounded to the lattice of [`STEPS_PER_SPACING`].
//! **Guarantees** a volume stored in any of its 48 axis orders gives the same bits and the same numbers, all digits,
//! so nothing that is made from them depends on the order. What is in this order already stays as it is.
//! **Why rounded?** A file holds its origin in single precision, so that of a volume of 0.7 mm voxels comes out
//! 0.00002 mm off when it is computed from the opposite corner; the last digits of every result would show it.
//! **Cost** O(words of the mask); O(foreground) where x becomes another axis.

use glam::{DAffine3, DVec3};

use crate::{Bits, Grid, GridError, Mask, Skeleton};

/// Origins lie on a lattice of this many steps to the power of two at or below the smallest spacing, which shifts a
/// volume by less than a hundredth of a voxel. Some 200 times the errors of single precision, so that one volume in
/// a few hundred falls between two steps.
const STEPS_PER_SPACING: f64 = 128.0;
/// The share of a step from which on the next one is taken: a third, since origins are rarely so many thirds of a
/// power of two, and often halves.
const NEXT_STEP: f64 = 1.0 / 3.0;
/// A spacing that is less than a power of two by this share is that power: in single precision it may well be.
const SAME_SPACING: f64 = 1e-6;

impl Mask {
    /// The mask with x, y and z towards R, A and S.
    ///
    /// # Errors
    /// [`GridError`] where the new origin is beyond the largest number.
    pub fn in_ras_order(self) -> Result<Self, GridError> {
        let turn = Turn::of(self.grid())?;
        let is_turned = turn.axes != AS_STORED;
        let bits = if is_turned { turn.bits(self.bits()) } else { self.into_bits() };
        Ok(Self::new(turn.grid, bits))
    }
}

impl Skeleton {
    /// The skeleton with x, y and z towards R, A and S.
    ///
    /// # Errors
    /// [`GridError`] where the new origin is beyond the largest number.
    pub fn in_ras_order(self) -> Result<Self, GridError> {
        let turn = Turn::of(self.grid())?;
        let turned = |voxel: &[u32; 3]| turn.voxel(voxel.map(|c| c as usize)).map(|c| c as u32);
        let voxels = self.voxels().iter().map(turned).collect();
        Ok(Self::new(turn.grid, voxels))
    }
}

/// The axes of a grid that need no turn.
const AS_STORED: [(usize, bool); 3] = [(0, true), (1, true), (2, true)];

/// From stored axes to R, A, S.
struct Turn {
    /// For each new axis: the stored one, and whether both point the same way.
    axes: [(usize, bool); 3],
    /// The stored extents.
    shape: [usize; 3],
    /// The new grid.
    grid: Grid,
}

impl Turn {
    fn of(grid: &Grid) -> Result<Self, GridError> {
        let mut axes = AS_STORED;
        for (stored, (world, same_way)) in grid.nearest_world_axes().into_iter().enumerate() {
            axes[world] = (stored, same_way);
        }
        let (shape, affine) = (grid.shape(), grid.world_from_voxel());
        let mut origin = affine.translation;
        let columns = axes.map(|(stored, same_way)| {
            let column = affine.matrix3.col(stored);
            if !same_way {
                origin += column * (shape[stored] - 1) as f64;
            }
            // Adding 0 makes −0 a plain 0.
            (if same_way { column } else { -column }) + 0.0
        });
        let origin = on_lattice(origin, grid.spacing_mm().min_element());
        let [x, y, z] = columns;
        let turned = Grid::new(axes.map(|(stored, _)| shape[stored]), DAffine3::from_cols(x, y, z, origin))?;
        Ok(Self { axes, shape, grid: turned })
    }

    /// Where a stored voxel lies.
    fn voxel(&self, stored: [usize; 3]) -> [usize; 3] {
        self.axes
            .map(|(axis, same_way)| if same_way { stored[axis] } else { self.shape[axis] - 1 - stored[axis] })
    }

    fn bits(&self, stored: &Bits) -> Bits {
        let mut turned = Bits::new(self.grid.shape());
        let [ny, new_ny] = [self.shape[1], self.grid.shape()[1]];
        let x_stays_x = self.axes[0].0 == 0;
        for row in 0..stored.n_rows() {
            let (y, z) = (row % ny, row / ny);
            for run in stored.runs(row) {
                if x_stays_x {
                    let ends = [run.start, run.end - 1].map(|x| self.voxel([x, y, z]));
                    let [_, new_y, new_z] = ends[0];
                    let first = ends[0][0].min(ends[1][0]);
                    turned.fill_run(new_z * new_ny + new_y, first..first + run.len());
                } else {
                    run.for_each(|x| turned.set(self.voxel([x, y, z])));
                }
            }
        }
        turned
    }
}

/// The point of the lattice for this spacing that stands for `origin`.
fn on_lattice(origin: DVec3, spacing_mm: f64) -> DVec3 {
    let step = power_of_two_below(spacing_mm * (1.0 + SAME_SPACING)) / STEPS_PER_SPACING;
    // Exact: a whole number times a power of two.
    (origin / step + (1.0 - NEXT_STEP)).floor() * step + 0.0
}

/// The largest power of two that is not above a positive normal number: what its exponent alone says.
fn power_of_two_below(value: f64) -> f64 {
    f64::from_bits(value.to_bits() & f64::INFINITY.to_bits())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_of_two() {
        for (value, expected) in [(0.7, 0.5), (1.0, 1.0), (5.0, 4.0), (0.03, 1.0 / 64.0)] {
            assert_eq!(power_of_two_below(value), expected);
        }
    }

    /// The voxels' places in the world stay, and a second turn changes nothing.
    #[test]
    fn a_turn_moves_no_voxel_in_the_world() {
        let (s, c) = (0.5, 0.866_025_4);
        let affines = [
            DAffine3::from_cols(DVec3::Z, DVec3::NEG_X, DVec3::Y * 2.5, DVec3::new(29.0, 3.0, -7.0)),
            DAffine3::from_cols(
                DVec3::new(-s, -c, 0.0) * 0.7,
                DVec3::new(0.0, 0.0, -1.2),
                DVec3::new(c, -s, 0.0) * 0.7,
                DVec3::new(12.3, -45.6, 78.9),
            ),
            DAffine3::from_cols(DVec3::NEG_X, DVec3::NEG_Y, DVec3::Z, DVec3::ZERO),
        ];
        for affine in affines {
            let grid = Grid::new([70, 4, 5], affine).expect("a grid");
            let mask = Mask::from_fn(grid, |[x, y, z]| (x * 5 + y * 3 + z * 7) % 4 == 0);
            let turned = mask.clone().in_ras_order().expect("a mask");
            assert_eq!(turned.grid().orientation(), "RAS");
            assert_eq!(turned.n_foreground(), mask.n_foreground());
            let turned_from_stored = turned.grid().voxel_from_world() * affine;
            for voxel in mask.voxels() {
                let point = turned_from_stored.transform_point3(DVec3::from_array(voxel.map(|c| c as f64)));
                let nearest = point.round();
                assert!((point - nearest).length() < 0.01, "{voxel:?} came to {point}");
                assert!(turned.contains(nearest.to_array().map(|c| c as i64)), "{voxel:?}");
            }
            let skeleton =
                Skeleton::new(mask.grid().clone(), mask.voxels().map(|v| v.map(|c| c as u32)).collect());
            let skeleton = skeleton.in_ras_order().expect("a skeleton");
            let expected: Vec<_> = turned.voxels().map(|v| v.map(|c| c as u32)).collect();
            assert_eq!((skeleton.grid(), skeleton.voxels()), (turned.grid(), expected.as_slice()));
            assert_eq!(turned.clone().in_ras_order().expect("a mask"), turned);
        }
    }

    /// Axes half-way between two of the world's.
    #[test]
    fn ties_fall_the_same_way_in_any_order() {
        let h = f64::from(0.5_f32.sqrt());
        let (x, y) = (DVec3::new(h, h, 0.0), DVec3::new(-h, h, 0.0));
        let turned = |a: DVec3, b: DVec3| {
            let grid = Grid::new([3, 3, 3], DAffine3::from_cols(a, b, DVec3::Z, -a - b)).expect("a grid");
            Mask::empty(grid).in_ras_order().expect("a mask").grid().clone()
        };
        let expected = turned(x, y);
        for (a, b) in [(y, x), (-x, y), (x, -y), (-y, x), (-y, -x), (-x, -y), (y, -x)] {
            assert_eq!(turned(a, b), expected, "{a} {b}");
        }
    }

    #[test]
    fn what_leaves_the_numbers_is_an_error() {
        let grid = Grid::new(
            [3, 1, 1],
            DAffine3::from_cols(DVec3::NEG_X * 1e300, DVec3::Y, DVec3::Z, DVec3::NEG_X * 1.79e308),
        );
        assert!(grid.and_then(|grid| Mask::empty(grid).in_ras_order()).is_err());
    }
}
