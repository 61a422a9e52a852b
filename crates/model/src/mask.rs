//! A binary volume: the organ.

use crate::{Bits, Grid};

/// A binary volume: 1 is foreground.
///
/// **Guarantees** the bits have the grid's shape.
#[derive(Clone, Debug, PartialEq)]
pub struct Mask {
    grid: Grid,
    bits: Bits,
}

impl Mask {
    /// A mask of bits on a grid.
    ///
    /// # Panics
    /// If the shapes differ: a mistake of the caller's code.
    #[must_use]
    pub fn new(grid: Grid, bits: Bits) -> Self {
        assert_eq!(bits.shape(), grid.shape(), "mask does not match its grid");
        Self { grid, bits }
    }

    /// A mask from one `bool` a voxel, x fastest.
    ///
    /// # Panics
    /// If their number is not the grid's: a mistake of the caller's code.
    #[must_use]
    pub fn from_voxels(grid: Grid, voxels: &[bool]) -> Self {
        assert_eq!(voxels.len(), grid.n_voxels(), "mask does not match its grid");
        let mut bits = Bits::new(grid.shape());
        for (row, values) in voxels.chunks_exact(grid.shape()[0]).enumerate() {
            for (word, values) in bits.row_mut(row).iter_mut().zip(values.chunks(u64::BITS as usize)) {
                *word = values.iter().rev().fold(0, |word, &value| word << 1 | u64::from(value));
            }
        }
        Self { grid, bits }
    }

    /// The mask of the voxels (x, y, z) that `is_inside` says are foreground.
    #[must_use]
    pub fn from_fn(grid: Grid, is_inside: impl Fn([usize; 3]) -> bool) -> Self {
        let [nx, ny, _] = grid.shape();
        let mut bits = Bits::new(grid.shape());
        for row in 0..bits.n_rows() {
            for x in (0..nx).filter(|&x| is_inside([x, row % ny, row / ny])) {
                bits.set([x, row % ny, row / ny]);
            }
        }
        Self { grid, bits }
    }

    /// A mask without foreground.
    #[must_use]
    pub fn empty(grid: Grid) -> Self {
        let bits = Bits::new(grid.shape());
        Self { grid, bits }
    }

    /// The grid.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The bits.
    #[must_use]
    pub fn bits(&self) -> &Bits {
        &self.bits
    }

    /// The bits, to be written.
    #[must_use]
    pub fn bits_mut(&mut self) -> &mut Bits {
        &mut self.bits
    }

    /// The bits, taken out.
    #[must_use]
    pub fn into_bits(self) -> Bits {
        self.bits
    }

    /// One `bool` a voxel, x fastest: eight times the memory of the bits.
    #[must_use]
    pub fn to_voxels(&self) -> Vec<bool> {
        let nx = self.grid.shape()[0];
        let row = |row: usize| {
            let words = self.bits.row(row);
            (0..nx).map(move |x| words[x / 64] >> (x % 64) & 1 != 0)
        };
        (0..self.bits.n_rows()).flat_map(row).collect()
    }

    /// Whether a voxel is foreground; outside the grid there is none.
    #[must_use]
    pub fn contains(&self, voxel: [i64; 3]) -> bool {
        self.bits.contains(voxel)
    }

    /// The foreground voxels, in storage order.
    pub fn voxels(&self) -> impl Iterator<Item = [usize; 3]> + '_ {
        self.bits.voxels()
    }

    /// The number of foreground voxels.
    #[must_use]
    pub fn n_foreground(&self) -> usize {
        self.bits.count()
    }

    /// The smallest box that holds the foreground, as first and last voxel (inclusive); `None` if there is none.
    #[must_use]
    pub fn bounding_box(&self) -> Option<([usize; 3], [usize; 3])> {
        self.bits.bounding_box()
    }
}
