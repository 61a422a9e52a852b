//! The working volume: the mask's foreground box, padded, one bit a voxel.
//!
//! **Input** a mask. **Output** cells of a box, x fastest, with one layer of background
//! around, and the way back to the mask's own voxels.
//! **Notation** a *cell* is a voxel of the padded box by the number of its bit in the list of words; rows begin a
//! word, so the steps to the next row and slab are multiples of 64.
//! **Steps** 1. Bounding box. 2. Copy, run by run.
//! **Guarantees** cropping keeps the order of the voxels, so no result depends on empty margins.
//! **Cost** O(words of the mask + foreground).

use espalier_model::{Bits, Mask};

use crate::simple::CENTER;

/// Bits in a word.
pub(crate) const WORD: usize = u64::BITS as usize;

/// A padded box of cells with the mask's foreground.
#[derive(Clone, Debug)]
pub(crate) struct Lattice {
    bits: Bits,
    /// First voxel of the box in the mask.
    low: [usize; 3],
    /// Distance between neighbours along the lattice's axes, in mm.
    spacing: [f64; 3],
}

impl Lattice {
    /// The lattice of a mask; `None` if it has no foreground.
    pub(crate) fn from_mask(mask: &Mask) -> Option<Self> {
        let (low, high) = mask.bounding_box()?;
        let shape = [0, 1, 2].map(|axis| high[axis] - low[axis] + 3);
        let mut bits = Bits::new(shape);
        let ny = mask.grid().shape()[1];
        for (z, y) in (low[2]..=high[2]).flat_map(|z| (low[1]..=high[1]).map(move |y| (z, y))) {
            let row = (z + 1 - low[2]) * shape[1] + y + 1 - low[1];
            for run in mask.bits().runs(z * ny + y) {
                bits.fill_run(row, run.start + 1 - low[0]..run.end + 1 - low[0]);
            }
        }
        Some(Self { bits, low, spacing: mask.grid().spacing_mm().to_array() })
    }

    /// Extents with the padding, x fastest.
    pub(crate) fn shape(&self) -> [usize; 3] {
        self.bits.shape()
    }

    /// The bits of the padded box.
    pub(crate) fn bits(&self) -> &Bits {
        &self.bits
    }

    /// The steps in the list of words from a row to the next and from a slab to the next.
    pub(crate) fn word_strides(&self) -> [usize; 2] {
        [self.bits.words_per_row(), self.bits.words_per_row() * self.shape()[1]]
    }

    /// The steps from a cell to its next along x, y, z.
    pub(crate) fn strides(&self) -> [isize; 3] {
        let [row, slab] = self.word_strides();
        [1, (row * WORD) as isize, (slab * WORD) as isize]
    }

    /// The distance between neighbouring cells along x, y, z, in mm.
    pub(crate) fn spacing(&self) -> [f64; 3] {
        self.spacing
    }

    /// All foreground cells, in raster order.
    pub(crate) fn foreground(&self) -> impl Iterator<Item = usize> + '_ {
        let words = self.bits.words().iter().enumerate().filter(|&(_, &bits)| bits != 0);
        words.flat_map(|(word, &bits)| ones(bits).map(move |bit| word * WORD + bit))
    }

    /// The foreground as voxels of the mask.
    pub(crate) fn mask_voxels(&self) -> Vec<[u32; 3]> {
        let of_mask = |voxel: [usize; 3]| [0, 1, 2].map(|axis| (voxel[axis] + self.low[axis] - 1) as u32);
        self.bits.voxels().map(of_mask).collect()
    }

    /// Whether a cell is foreground.
    pub(crate) fn is_foreground(&self, cell: usize) -> bool {
        self.bits.words()[cell / WORD] >> (cell % WORD) & 1 != 0
    }

    /// Turns a cell into foreground.
    pub(crate) fn add(&mut self, cell: usize) {
        self.bits.words_mut()[cell / WORD] |= 1 << (cell % WORD);
    }

    /// Turns a cell into background.
    pub(crate) fn delete(&mut self, cell: usize) {
        self.bits.words_mut()[cell / WORD] &= !(1 << (cell % WORD));
    }

    /// The 3×3×3 neighbourhood of a cell inside the padding: bit 9·(dz+1) + 3·(dy+1) + (dx+1).
    #[inline]
    pub(crate) fn neighborhood(&self, cell: usize) -> u32 {
        let words = self.bits.words();
        let [row, slab] = self.word_strides();
        // The padding makes every neighbour a cell, and all nine lines of three begin at the same bit.
        let (first, bit) = ((cell - 1) / WORD - slab - row, (cell - 1) % WORD);
        let is_split = bit > WORD - 3;
        let mut bits = 0;
        for line in 0..9 {
            let word = first + line / 3 * slab + line % 3 * row;
            let mut three = words[word] >> bit;
            if is_split {
                three |= words[word + 1] << (WORD - bit);
            }
            bits |= (three as u32 & 7) << (3 * line);
        }
        bits
    }

    /// The foreground neighbours of a cell among the 26, in raster order.
    pub(crate) fn neighbors(&self, cell: usize) -> impl Iterator<Item = usize> + use<> {
        let strides = self.strides();
        let bits = u64::from(self.neighborhood(cell) & !CENTER);
        ones(bits).map(move |bit| cell.wrapping_add_signed(offset(bit, strides)))
    }

    /// All 26 cells around a foreground cell, in raster order.
    pub(crate) fn surroundings(&self, cell: usize) -> impl Iterator<Item = usize> + use<> {
        let strides = self.strides();
        (0..27)
            .filter(|bit| 1 << bit != CENTER)
            .map(move |bit| cell.wrapping_add_signed(offset(bit, strides)))
    }

    /// The coordinates x, y, z of a cell, padding included.
    pub(crate) fn coordinates(&self, cell: usize) -> [usize; 3] {
        let [row_words, slab_words] = self.word_strides();
        let word = cell / WORD;
        [word % row_words * WORD + cell % WORD, word / row_words % self.shape()[1], word / slab_words]
    }
}

/// The places of the ones in a word, from the lowest.
pub(crate) fn ones(mut bits: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (bits != 0).then(|| bits.trailing_zeros() as usize)?;
        bits &= bits - 1;
        Some(bit)
    })
}

/// The way from a cell to the neighbour at a bit of the neighbourhood.
fn offset(bit: usize, strides: [isize; 3]) -> isize {
    let digits = [bit % 3, bit / 3 % 3, bit / 9];
    (0..3).map(|axis| (digits[axis] as isize - 1) * strides[axis]).sum()
}

#[cfg(test)]
mod tests {
    use espalier_geom::random::{Purpose, Stream};
    use espalier_model::Grid;
    use glam::DVec3;

    use super::*;

    #[test]
    fn neighborhoods_are_the_voxels_about_a_cell_across_words_too() {
        let mut stream = Stream::new(3, Purpose::Test, 0, 0);
        let grid = Grid::axis_aligned([140, 5, 4], DVec3::ONE, DVec3::ZERO).expect("grid");
        let noise: Vec<bool> = (0..grid.n_voxels()).map(|_| stream.below(2) == 0).collect();
        let mask = Mask::from_voxels(grid, &noise);
        let lattice = Lattice::from_mask(&mask).expect("not empty");
        let (low, _) = mask.bounding_box().expect("not empty");
        for cell in lattice.foreground() {
            let voxel = lattice.coordinates(cell);
            let expected = (0..27).fold(0, |bits, bit| {
                let d = [bit % 3, bit / 3 % 3, bit / 9];
                let at = [0, 1, 2].map(|axis| (voxel[axis] + d[axis] + low[axis]) as i64 - 2);
                bits | u32::from(mask.contains(at)) << bit
            });
            assert_eq!(lattice.neighborhood(cell), expected, "{voxel:?}");
            let neighbors: Vec<usize> = lattice.neighbors(cell).collect();
            let around = lattice.surroundings(cell).filter(|&other| lattice.is_foreground(other));
            assert_eq!(neighbors, around.collect::<Vec<_>>(), "{voxel:?}");
        }
    }
}
