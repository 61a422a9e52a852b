//! The voxels of a curve skeleton.

use crate::Grid;

/// The voxels of a curve skeleton, as a list.
///
/// **Guarantees** voxels (x, y, z) lie in the grid, in storage order (z, then y, then x), each once.
#[derive(Clone, Debug, PartialEq)]
pub struct Skeleton {
    grid: Grid,
    voxels: Vec<[u32; 3]>,
}

impl Skeleton {
    /// A skeleton from voxels in any order; duplicates are merged.
    ///
    /// # Panics
    /// If a voxel lies outside the grid: a mistake of the caller's code.
    #[must_use]
    pub fn new(grid: Grid, mut voxels: Vec<[u32; 3]>) -> Self {
        let shape = grid.shape();
        assert!(
            voxels.iter().all(|v| (0..3).all(|axis| (v[axis] as usize) < shape[axis])),
            "skeleton voxel outside its grid"
        );
        voxels.sort_unstable_by_key(|&[x, y, z]| [z, y, x]);
        voxels.dedup();
        Self { grid, voxels }
    }

    /// The grid of the mask it was thinned from.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The voxels (x, y, z).
    #[must_use]
    pub fn voxels(&self) -> &[[u32; 3]] {
        &self.voxels
    }
}
