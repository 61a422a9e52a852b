//! The work list of thinning: which voxels may have become deletable.
//!
//! **Notation** a voxel is *open* if its neighbourhood changed since the predicate last refused it. The predicate
//! depends on the 26 neighbours alone, so it need not be asked of any other voxel. A word is *active* if it may hold
//! an open voxel.
//! **Guarantees** every open border voxel is in the list; voxels beside these may be.
//! **Cost** one bit a voxel of the box; per sub-iteration O(active words).

use crate::lattice::{Lattice, WORD, ones};

/// The voxels at work.
pub(crate) struct Open {
    /// One bit a cell.
    bits: Vec<u64>,
    /// One bit a word of `bits`.
    active: Vec<u64>,
}

/// One of the six ways out of a voxel, as the step in words; the steps along x are within a word.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Direction {
    Left,
    Right,
    Words(isize),
}

impl Open {
    /// All border voxels are open.
    pub(crate) fn border(lattice: &Lattice) -> Self {
        let n_words = lattice.bits().words().len();
        let mut open = Self { bits: vec![0; n_words], active: vec![0; n_words.div_ceil(WORD)] };
        let [row, slab] = lattice.word_strides().map(|stride| stride as isize);
        for (word, &foreground) in lattice.bits().words().iter().enumerate() {
            if foreground == 0 {
                continue;
            }
            let mut inner = foreground;
            for direction in [
                Direction::Left,
                Direction::Right,
                Direction::Words(row),
                Direction::Words(-row),
                Direction::Words(slab),
                Direction::Words(-slab),
            ] {
                inner &= shifted(lattice, word, direction);
            }
            open.open(word, foreground & !inner);
        }
        open
    }

    /// Opens bits of a word.
    pub(crate) fn open(&mut self, word: usize, bits: u64) {
        if bits & !self.bits[word] != 0 {
            self.bits[word] |= bits;
            self.active[word / WORD] |= 1 << (word % WORD);
        }
    }

    /// Opens the foreground about a cell.
    pub(crate) fn open_around(&mut self, lattice: &Lattice, cell: usize) {
        let words = lattice.bits().words();
        let [row, slab] = lattice.word_strides();
        let (first, bit) = ((cell - 1) / WORD - slab - row, (cell - 1) % WORD);
        for line in 0..9 {
            let word = first + line / 3 * slab + line % 3 * row;
            self.open(word, 7 << bit & words[word]);
            if bit > WORD - 3 {
                self.open(word + 1, 7 >> (WORD - bit) & words[word + 1]);
            }
        }
    }

    /// Goes through the open voxels that are border for `direction`, in raster order, and keeps those open that
    /// `qualifies` says yes to; `collected` gets them as words and bits.
    pub(crate) fn collect(
        &mut self,
        lattice: &Lattice,
        direction: Direction,
        mut qualifies: impl FnMut(usize) -> bool,
        collected: &mut Vec<(usize, u64)>,
    ) {
        collected.clear();
        for block in 0..self.active.len() {
            for bit in ones(self.active[block]) {
                let word = block * WORD + bit;
                self.bits[word] &= lattice.bits().words()[word];
                if self.bits[word] == 0 {
                    self.active[block] &= !(1 << bit);
                    continue;
                }
                let candidates = self.bits[word] & !shifted(lattice, word, direction);
                let found = ones(candidates)
                    .filter(|bit| qualifies(word * WORD + bit))
                    .fold(0, |found, bit| found | 1 << bit);
                self.bits[word] &= !(candidates & !found);
                if found != 0 {
                    collected.push((word, found));
                }
            }
        }
    }
}

/// The neighbours in `direction` of the cells of a word.
fn shifted(lattice: &Lattice, word: usize, direction: Direction) -> u64 {
    let words = lattice.bits().words();
    match direction {
        // Rows begin and end with padding, so nothing is carried from one to the next.
        Direction::Left => words[word] << 1 | word.checked_sub(1).map_or(0, |last| words[last] >> (WORD - 1)),
        Direction::Right => words[word] >> 1 | words.get(word + 1).map_or(0, |next| next << (WORD - 1)),
        Direction::Words(step) => words[word.wrapping_add_signed(step)],
    }
}
