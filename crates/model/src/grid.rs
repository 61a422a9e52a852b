//! The voxel grid of a volume and its place in the world.

use std::cmp::Ordering;

use glam::{DAffine3, DVec3};
use thiserror::Error;

use crate::diagnose::{Class, Diagnose};

/// A voxel grid: how many voxels along x, y, z, and where they lie in RAS+ mm.
///
/// **Guarantees** every extent is at least 1; the number of voxels fits a `usize`; the affine is finite, not
/// singular, and its columns are orthogonal to a cosine of 1e-3.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    shape: [usize; 3],
    world_from_voxel: DAffine3,
}

/// What coordinates of LPS, the space of DICOM, ITK and VTK, are multiplied by to be RAS, and the other way round.
pub const RAS_FROM_LPS: DVec3 = DVec3::new(-1.0, -1.0, 1.0);

/// Why a grid cannot be.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum GridError {
    /// An extent is zero, or their product overflows.
    #[error("a grid of {}x{}x{} voxels cannot be held", .shape[0], .shape[1], .shape[2])]
    Shape {
        /// The extents asked for.
        shape: [usize; 3],
    },
    /// A number in the affine is not finite.
    #[error("the affine holds a number that is not finite")]
    NotFinite,
    /// The affine maps the grid onto a plane or less.
    #[error("the affine is singular: spacing {:.3e} x {:.3e} x {:.3e} mm", .spacing_mm.x, .spacing_mm.y, .spacing_mm.z)]
    Singular {
        /// The lengths of the affine's columns.
        spacing_mm: DVec3,
    },
    /// The axes are not orthogonal.
    #[error("the voxel axes are sheared: two of them meet at a cosine of {cosine:.4}")]
    Sheared {
        /// The largest cosine between two axes.
        cosine: f64,
    },
}

impl Diagnose for GridError {
    fn code(&self) -> &'static str {
        match self {
            Self::Shape { .. } => "E-GRID-SHAPE",
            Self::NotFinite => "E-GRID-NOT-FINITE",
            Self::Singular { .. } => "E-GRID-SINGULAR",
            Self::Sheared { .. } => "E-GRID-SHEARED",
        }
    }

    fn class(&self) -> Class {
        Class::Input
    }
}

/// The largest cosine between two voxel axes that still counts as orthogonal.
pub(crate) const MAX_SHEAR: f64 = 1e-3;

/// Sums of three cosines that differ by less are the same: far above rounding, far below what turns a scan.
const SAME_ALIGNMENT: f64 = 1e-9;

impl Grid {
    /// A grid of `shape` (x, y, z) voxels whose centres `world_from_voxel` maps to RAS+ mm.
    ///
    /// # Errors
    /// [`GridError`] if one of the guarantees does not hold.
    pub fn new(shape: [usize; 3], world_from_voxel: DAffine3) -> Result<Self, GridError> {
        let n_voxels = shape.iter().try_fold(1_usize, |product, &extent| product.checked_mul(extent));
        if n_voxels.is_none_or(|n| n == 0 || n > isize::MAX as usize / 8) {
            return Err(GridError::Shape { shape });
        }
        if !world_from_voxel.is_finite() {
            return Err(GridError::NotFinite);
        }
        let axes = world_from_voxel.matrix3;
        let spacing_mm = DVec3::new(axes.x_axis.length(), axes.y_axis.length(), axes.z_axis.length());
        let volume = axes.determinant().abs();
        let box_volume = spacing_mm.x * spacing_mm.y * spacing_mm.z;
        if spacing_mm.min_element() <= 1e-9 || !box_volume.is_finite() || volume < 1e-6 * box_volume {
            return Err(GridError::Singular { spacing_mm });
        }
        let cosine = |a: DVec3, b: DVec3| (a.dot(b) / (a.length() * b.length())).abs();
        let shear = cosine(axes.x_axis, axes.y_axis)
            .max(cosine(axes.y_axis, axes.z_axis))
            .max(cosine(axes.z_axis, axes.x_axis));
        if shear > MAX_SHEAR {
            return Err(GridError::Sheared { cosine: shear });
        }
        Ok(Self { shape, world_from_voxel })
    }

    /// A grid with its axes along R, A, S and voxel (0, 0, 0) centred at `origin_mm`.
    ///
    /// # Errors
    /// As [`Grid::new`].
    pub fn axis_aligned(shape: [usize; 3], spacing_mm: DVec3, origin_mm: DVec3) -> Result<Self, GridError> {
        Self::new(shape, DAffine3::from_mat3_translation(glam::DMat3::from_diagonal(spacing_mm), origin_mm))
    }

    /// Voxels along x, y, z.
    #[must_use]
    pub fn shape(&self) -> [usize; 3] {
        self.shape
    }

    /// The number of voxels.
    #[must_use]
    pub fn n_voxels(&self) -> usize {
        self.shape[0] * self.shape[1] * self.shape[2]
    }

    /// The distance between neighbouring voxel centres along x, y, z, in mm.
    #[must_use]
    pub fn spacing_mm(&self) -> DVec3 {
        let axes = self.world_from_voxel.matrix3;
        DVec3::new(axes.x_axis.length(), axes.y_axis.length(), axes.z_axis.length())
    }

    /// The volume of one voxel in mm³.
    #[must_use]
    pub fn voxel_volume_mm3(&self) -> f64 {
        self.world_from_voxel.matrix3.determinant().abs()
    }

    /// Maps voxel coordinates to RAS+ mm.
    #[must_use]
    pub fn world_from_voxel(&self) -> DAffine3 {
        self.world_from_voxel
    }

    /// Maps RAS+ mm to voxel coordinates.
    #[must_use]
    pub fn voxel_from_world(&self) -> DAffine3 {
        self.world_from_voxel.inverse()
    }

    /// The flat index of a voxel: x fastest, z slowest.
    #[must_use]
    pub fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.shape[1] + y) * self.shape[0] + x
    }

    /// The voxel at a flat index.
    #[must_use]
    pub fn voxel(&self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.shape;
        [index % nx, index / nx % ny, index / (nx * ny)]
    }

    /// The voxel whose cell holds the voxel coordinates `point`, if it is inside the grid.
    #[must_use]
    pub fn voxel_at(&self, point_voxel: DVec3) -> Option<[usize; 3]> {
        let nearest = (point_voxel + 0.5).floor();
        let inside =
            |value: f64, extent: usize| (value >= 0.0 && value < extent as f64).then_some(value as usize);
        Some([
            inside(nearest.x, self.shape[0])?,
            inside(nearest.y, self.shape[1])?,
            inside(nearest.z, self.shape[2])?,
        ])
    }

    /// For each voxel axis, the world axis (0 = R, 1 = A, 2 = S) it is nearest to, and whether it points along
    /// it (`true`) or against it. A permutation of the three axes.
    ///
    /// Axes half-way between two of the world's go to either, but to the same one in whatever order they are stored.
    #[must_use]
    pub fn nearest_world_axes(&self) -> [(usize, bool); 3] {
        let columns = self.world_from_voxel.matrix3.to_cols_array_2d();
        const PERMUTATIONS: [[usize; 3]; 6] =
            [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
        let spacing = self.spacing_mm().to_array();
        let ways = PERMUTATIONS.map(|permutation| {
            let nearest = [0, 1, 2].map(|axis| (permutation[axis], columns[axis][permutation[axis]] > 0.0));
            // The cosines and the axes turned this way, by world axis.
            let (mut cosines, mut turned) = ([0.0; 3], [[0.0; 3]; 3]);
            for (axis, (world, is_along)) in nearest.into_iter().enumerate() {
                cosines[world] = (columns[axis][world] / spacing[axis]).abs();
                turned[world] = columns[axis].map(|value| if is_along { value } else { -value });
            }
            (cosines[0] + cosines[1] + cosines[2], turned, nearest)
        });
        let most = ways.iter().map(|way| way.0).fold(0.0, f64::max);
        let best = ways.iter().filter(|way| way.0 >= most - SAME_ALIGNMENT);
        let chosen = best.max_by(|a, b| a.1.partial_cmp(&b.1).unwrap_or(Ordering::Equal));
        chosen.map_or([(0, true), (1, true), (2, true)], |way| way.2)
    }

    /// The orientation as three letters, such as `LPS`: where x, y and z point.
    #[must_use]
    pub fn orientation(&self) -> String {
        self.nearest_world_axes()
            .iter()
            .map(|&(axis, along)| [['L', 'R'], ['P', 'A'], ['I', 'S']][axis][usize::from(along)])
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orientation_letters() {
        let grid = |x: DVec3, y: DVec3, z: DVec3| {
            Grid::new([2, 3, 4], DAffine3::from_cols(x, y, z, DVec3::ZERO)).expect("legal")
        };
        assert_eq!(grid(DVec3::X, DVec3::Y, DVec3::Z).orientation(), "RAS");
        assert_eq!(grid(-DVec3::X, -DVec3::Y, DVec3::Z).orientation(), "LPS");
        assert_eq!(grid(-DVec3::Z, DVec3::X, DVec3::Y * 2.5).orientation(), "IRA");
    }

    #[test]
    fn index_and_voxel_are_inverse() {
        let grid = Grid::axis_aligned([3, 4, 5], DVec3::ONE, DVec3::ZERO).expect("legal");
        for index in 0..grid.n_voxels() {
            assert_eq!(grid.index(grid.voxel(index)), index);
        }
        assert_eq!(grid.voxel_at(DVec3::new(2.4, -0.4, 4.0)), Some([2, 0, 4]));
        assert_eq!(grid.voxel_at(DVec3::new(2.6, 0.0, 0.0)), None);
    }

    #[test]
    fn refuses_what_it_must() {
        let affine = |x, y, z| DAffine3::from_cols(x, y, z, DVec3::ZERO);
        assert!(matches!(Grid::new([0, 1, 1], DAffine3::IDENTITY), Err(GridError::Shape { .. })));
        assert!(matches!(Grid::new([usize::MAX, 2, 1], DAffine3::IDENTITY), Err(GridError::Shape { .. })));
        assert!(matches!(
            Grid::new([1, 1, 1], affine(DVec3::X, DVec3::X, DVec3::Z)),
            Err(GridError::Singular { .. })
        ));
        assert!(matches!(
            Grid::new([1, 1, 1], affine(DVec3::X, DVec3::new(0.1, 1.0, 0.0), DVec3::Z)),
            Err(GridError::Sheared { .. })
        ));
        assert!(matches!(
            Grid::new([1, 1, 1], affine(DVec3::X * f64::NAN, DVec3::Y, DVec3::Z)),
            Err(GridError::NotFinite)
        ));
    }
}
