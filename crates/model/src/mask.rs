//! A binary volume: the organ.

use ndarray::{Array3, ArrayView3};

use crate::Grid;

/// A binary volume: `true` is foreground.
///
/// **Guarantees** the array has the grid's shape (nz, ny, nx), in standard layout, x fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct Mask {
    grid: Grid,
    voxels: Array3<bool>,
}

impl Mask {
    /// A mask from a flat vector, x fastest.
    ///
    /// # Panics
    /// If the vector's length is not the grid's number of voxels: a mistake of the caller's code.
    #[must_use]
    pub fn new(grid: Grid, voxels: Vec<bool>) -> Self {
        let [nx, ny, nz] = grid.shape();
        assert_eq!(voxels.len(), grid.n_voxels(), "mask does not match its grid");
        // The length was just checked, so the shape fits.
        let voxels = Array3::from_shape_vec((nz, ny, nx), voxels).unwrap_or_default();
        Self { grid, voxels }
    }

    /// A mask without foreground.
    #[must_use]
    pub fn empty(grid: Grid) -> Self {
        let n_voxels = grid.n_voxels();
        Self::new(grid, vec![false; n_voxels])
    }

    /// The grid.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The voxels as an array of shape (nz, ny, nx).
    #[must_use]
    pub fn view(&self) -> ArrayView3<'_, bool> {
        self.voxels.view()
    }

    /// The voxels as a flat slice, x fastest.
    #[must_use]
    pub fn as_slice(&self) -> &[bool] {
        self.voxels.as_slice().unwrap_or_default()
    }

    /// The voxels as a flat mutable slice, x fastest.
    #[must_use]
    pub fn as_mut_slice(&mut self) -> &mut [bool] {
        self.voxels.as_slice_mut().unwrap_or_default()
    }

    /// Whether a voxel is foreground; outside the grid there is none.
    #[must_use]
    pub fn contains(&self, [x, y, z]: [i64; 3]) -> bool {
        let [nx, ny, nz] = self.grid.shape().map(|extent| extent as i64);
        (0..nx).contains(&x)
            && (0..ny).contains(&y)
            && (0..nz).contains(&z)
            && self.voxels[[z as usize, y as usize, x as usize]]
    }

    /// The number of foreground voxels.
    #[must_use]
    pub fn n_foreground(&self) -> usize {
        self.as_slice().iter().filter(|&&v| v).count()
    }

    /// The smallest box that holds the foreground, as first and last voxel (inclusive); `None` if there is none.
    #[must_use]
    pub fn bounding_box(&self) -> Option<([usize; 3], [usize; 3])> {
        let [nx, ny, _] = self.grid.shape();
        let mut bounds: Option<([usize; 3], [usize; 3])> = None;
        for (row_idx, row) in self.as_slice().chunks_exact(nx).enumerate() {
            let Some(first) = row.iter().position(|&v| v) else { continue };
            let last = row.iter().rposition(|&v| v).unwrap_or(first);
            let (y, z) = (row_idx % ny, row_idx / ny);
            let (low, high) = bounds.get_or_insert(([first, y, z], [last, y, z]));
            *low = [low[0].min(first), low[1].min(y), low[2].min(z)];
            *high = [high[0].max(last), high[1].max(y), high[2].max(z)];
        }
        bounds
    }
}
