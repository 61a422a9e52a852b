//! The working volume: the mask's foreground box, turned, padded, one byte a voxel.
//!
//! **Input** a mask and the orientation. **Output** cells of a box, x fastest, with one layer of background
//! around, and the way back to the mask's own voxels.
//! **Steps** 1. Bounding box. 2. Permute and flip its axes so that they point right, anterior, superior (or
//! leave them). 3. Copy.
//! **Guarantees** cropping keeps the order of the voxels, so no result depends on empty margins.
//! **Cost** O(box).

use espalier_model::Mask;

use crate::params::Orientation;
use crate::simple::CENTER;

/// The cell is foreground.
const FOREGROUND: u8 = 1;
/// The cell carries a mark of the algorithm that runs.
const MARK: u8 = 2;

/// A padded box of cells with the mask's foreground.
#[derive(Clone, Debug)]
pub(crate) struct Lattice {
    cells: Vec<u8>,
    /// Extents with the padding, x fastest.
    shape: [usize; 3],
    /// For each of the lattice's axes: the mask's axis, and whether both point the same way.
    stored_axes: [(usize, bool); 3],
    /// First and last voxel of the box in the mask.
    bounds: ([usize; 3], [usize; 3]),
    /// Distance between neighbours along the lattice's axes, in mm.
    spacing: [f64; 3],
}

impl Lattice {
    /// The lattice of a mask; `None` if it has no foreground.
    pub(crate) fn from_mask(mask: &Mask, orientation: Orientation) -> Option<Self> {
        let bounds = mask.bounding_box()?;
        let (low, high) = bounds;
        let mut stored_axes = [(0, true), (1, true), (2, true)];
        if orientation == Orientation::Ras {
            for (stored, (world, same_way)) in mask.grid().nearest_world_axes().into_iter().enumerate() {
                stored_axes[world] = (stored, same_way);
            }
        }
        let shape = stored_axes.map(|(stored, _)| high[stored] - low[stored] + 3);
        let spacing_mm = mask.grid().spacing_mm();
        let spacing = stored_axes.map(|(stored, _)| spacing_mm[stored]);
        let cells = vec![0; shape[0] * shape[1] * shape[2]];
        let mut lattice = Self { cells, shape, stored_axes, bounds, spacing };

        for voxel in mask.voxels() {
            let cell = lattice.cell_of(voxel);
            lattice.cells[cell] = FOREGROUND;
        }
        Some(lattice)
    }

    /// The distances in the flat cell list from a cell to its next along x, y, z.
    pub(crate) fn strides(&self) -> [isize; 3] {
        [1, self.shape[0] as isize, (self.shape[0] * self.shape[1]) as isize]
    }

    /// The number of cells, padding included.
    pub(crate) fn n_cells(&self) -> usize {
        self.cells.len()
    }

    /// The distance between neighbouring cells along x, y, z, in mm.
    pub(crate) fn spacing(&self) -> [f64; 3] {
        self.spacing
    }

    /// All foreground cells, in raster order.
    pub(crate) fn foreground(&self) -> Vec<usize> {
        (0..self.cells.len()).filter(|&cell| self.is_foreground(cell)).collect()
    }

    /// The foreground as voxels of the mask, in no particular order.
    pub(crate) fn stored_voxels(&self) -> Vec<[u32; 3]> {
        self.foreground().into_iter().map(|cell| self.stored_voxel(cell)).collect()
    }

    /// Whether a cell is foreground.
    pub(crate) fn is_foreground(&self, cell: usize) -> bool {
        self.cells[cell] & FOREGROUND != 0
    }

    /// Turns a cell into foreground, without a mark.
    pub(crate) fn add(&mut self, cell: usize) {
        self.cells[cell] = FOREGROUND;
    }

    /// Turns a foreground cell into background, without a mark.
    pub(crate) fn delete(&mut self, cell: usize) {
        self.cells[cell] = 0;
    }

    /// Whether a cell is marked.
    pub(crate) fn is_marked(&self, cell: usize) -> bool {
        self.cells[cell] & MARK != 0
    }

    /// Marks a cell.
    pub(crate) fn mark(&mut self, cell: usize) {
        self.cells[cell] |= MARK;
    }

    /// Takes a cell's mark away.
    pub(crate) fn unmark(&mut self, cell: usize) {
        self.cells[cell] &= !MARK;
    }

    /// Whether one of the six face neighbours of a foreground cell is background.
    pub(crate) fn is_border(&self, cell: usize) -> bool {
        self.strides().iter().any(|&stride| {
            !self.is_foreground(cell.wrapping_add_signed(stride))
                || !self.is_foreground(cell.wrapping_add_signed(-stride))
        })
    }

    /// The 3×3×3 neighbourhood of a foreground cell: bit 9·(dz+1) + 3·(dy+1) + (dx+1).
    pub(crate) fn neighborhood(&self, cell: usize) -> u32 {
        let [_, row, slab] = self.strides().map(isize::unsigned_abs);
        let mut bits = 0;
        // The padding makes every neighbour of a foreground cell a cell.
        let first = cell - slab - row - 1;
        for (line, start) in (0..9).map(|line| (line, first + line / 3 * slab + line % 3 * row)) {
            let cells = &self.cells[start..start + 3];
            let three = cells[0] & FOREGROUND | (cells[1] & FOREGROUND) << 1 | (cells[2] & FOREGROUND) << 2;
            bits |= u32::from(three) << (3 * line);
        }
        bits
    }

    /// The foreground neighbours of a cell among the 26, in raster order.
    pub(crate) fn neighbors(&self, cell: usize) -> impl Iterator<Item = usize> + use<> {
        let mut bits = self.neighborhood(cell) & !CENTER;
        let strides = self.strides();
        std::iter::from_fn(move || {
            let bit = (bits != 0).then(|| bits.trailing_zeros())?;
            bits &= bits - 1;
            Some(cell.wrapping_add_signed(offset(bit, strides)))
        })
    }

    /// All 26 cells around a foreground cell, in raster order.
    pub(crate) fn surroundings(&self, cell: usize) -> impl Iterator<Item = usize> + use<> {
        let strides = self.strides();
        (0..27)
            .filter(|bit| 1 << bit != CENTER)
            .map(move |bit| cell.wrapping_add_signed(offset(bit, strides)))
    }

    /// The parity class of a cell, 0..8: two cells of one class are never 26-neighbours.
    pub(crate) fn parity(&self, cell: usize) -> usize {
        let [x, y, z] = self.coordinates(cell);
        (z & 1) << 2 | (y & 1) << 1 | x & 1
    }

    /// The coordinates x, y, z of a cell, padding included.
    pub(crate) fn coordinates(&self, cell: usize) -> [usize; 3] {
        [cell % self.shape[0], cell / self.shape[0] % self.shape[1], cell / (self.shape[0] * self.shape[1])]
    }

    fn cell_of(&self, stored: [usize; 3]) -> usize {
        let (low, high) = self.bounds;
        let [x, y, z] = self.stored_axes.map(|(axis, same_way)| {
            1 + if same_way { stored[axis] - low[axis] } else { high[axis] - stored[axis] }
        });
        (z * self.shape[1] + y) * self.shape[0] + x
    }

    fn stored_voxel(&self, cell: usize) -> [u32; 3] {
        let (low, high) = self.bounds;
        let mut stored = [0; 3];
        for (coordinate, (axis, same_way)) in self.coordinates(cell).into_iter().zip(self.stored_axes) {
            let value = if same_way { low[axis] + coordinate - 1 } else { high[axis] + 1 - coordinate };
            stored[axis] = value as u32;
        }
        stored
    }
}

/// The way in the flat cell list to the neighbour at a bit of the neighbourhood.
fn offset(bit: u32, strides: [isize; 3]) -> isize {
    let digits = [bit % 3, bit / 3 % 3, bit / 9];
    (0..3).map(|axis| (digits[axis] as isize - 1) * strides[axis]).sum()
}
