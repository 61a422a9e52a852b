//! The work list of thinning: which voxels may have become deletable.
//!
//! **Notation** a voxel is *open* if its neighbourhood changed since the predicate last refused it. The predicate
//! depends on the voxels near by alone, so it need not be asked of any other voxel. A word is *active* if it may hold
//! an open voxel. A voxel is *held* if it must not be asked about before it is released.
//! **Guarantees** every open border voxel is in the list; voxels beside these may be.
//! **Cost** two bits a voxel of the box; per sub-iteration O(active words).

use crate::lattice::{Lattice, WORD, ones};

/// One of the six ways out of a voxel: along x within a word, else as a step in words.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Direction {
    Left,
    Right,
    Words(isize),
}

impl Direction {
    /// All six, in the published order: −y, +y, +x, −x, +z, −z.
    pub(crate) fn all(lattice: &Lattice) -> [Self; 6] {
        let [row, slab] = lattice.word_strides().map(|stride| stride as isize);
        [Self::Words(-row), Self::Words(row), Self::Right, Self::Left, Self::Words(slab), Self::Words(-slab)]
    }

    /// The axis that it goes along.
    pub(crate) fn axis(self, lattice: &Lattice) -> usize {
        match self {
            Self::Left | Self::Right => 0,
            Self::Words(step) => 1 + usize::from(step.unsigned_abs() != lattice.word_strides()[0]),
        }
    }

    /// The neighbours on this side of the cells of a word.
    pub(crate) fn neighbors(self, words: &[u64], word: usize) -> u64 {
        match self {
            // Rows begin and end with padding, so nothing is carried from one to the next.
            Self::Left => words[word] << 1 | word.checked_sub(1).map_or(0, |last| words[last] >> (WORD - 1)),
            Self::Right => words[word] >> 1 | words.get(word + 1).map_or(0, |next| next << (WORD - 1)),
            Self::Words(step) => words[word.wrapping_add_signed(step)],
        }
    }
}

/// The voxels at work.
pub(crate) struct Open {
    /// One bit a cell.
    bits: Vec<u64>,
    /// One bit a word of `bits`.
    active: Vec<u64>,
    /// One bit a cell.
    held: Vec<u64>,
    directions: [Direction; 6],
}

impl Open {
    /// No voxel is open; all are held.
    pub(crate) fn held(lattice: &Lattice) -> Self {
        let words = lattice.bits().words();
        Self {
            bits: vec![0; words.len()],
            active: vec![0; words.len().div_ceil(WORD)],
            held: words.to_vec(),
            directions: Direction::all(lattice),
        }
    }

    /// All border voxels are open; none is held.
    pub(crate) fn border(lattice: &Lattice) -> Self {
        let mut open = Self::held(lattice);
        for (word, &bits) in lattice.bits().words().iter().enumerate().filter(|&(_, &bits)| bits != 0) {
            open.release(lattice, word, bits);
        }
        open
    }

    /// The cells of a word that have background on one of their six sides.
    fn border_of(&self, words: &[u64], word: usize) -> u64 {
        !self.directions.iter().fold(u64::MAX, |inner, side| inner & side.neighbors(words, word))
    }

    /// Opens bits of a word.
    fn add(&mut self, word: usize, bits: u64) {
        if bits & !self.bits[word] != 0 {
            self.bits[word] |= bits;
            self.active[word / WORD] |= 1 << (word % WORD);
        }
    }

    /// Opens the foreground about a cell.
    pub(crate) fn add_around(&mut self, lattice: &Lattice, cell: usize) {
        let words = lattice.bits().words();
        let [row, slab] = lattice.word_strides();
        let (first, bit) = ((cell - 1) / WORD - slab - row, (cell - 1) % WORD);
        for line in 0..9 {
            let word = first + line / 3 * slab + line % 3 * row;
            self.add(word, 7 << bit & words[word]);
            if bit > WORD - 3 {
                self.add(word + 1, 7 >> (WORD - bit) & words[word + 1]);
            }
        }
    }

    /// Holds bits of a word no longer, and opens those that are border.
    pub(crate) fn release(&mut self, lattice: &Lattice, word: usize, bits: u64) {
        let words = lattice.bits().words();
        self.held[word] &= !bits;
        self.add(word, bits & words[word] & self.border_of(words, word));
    }

    /// Asks `qualifies` about each open voxel with background in `direction`, in raster order; one that is refused
    /// is open no longer.
    pub(crate) fn ask(
        &mut self,
        lattice: &Lattice,
        direction: Direction,
        mut qualifies: impl FnMut(usize) -> bool,
    ) {
        let words = lattice.bits().words();
        for block in 0..self.active.len() {
            for bit in ones(self.active[block]) {
                let word = block * WORD + bit;
                let mut open = self.bits[word] & words[word] & !self.held[word];
                let candidates = open & !direction.neighbors(words, word);
                if candidates == 0 {
                    // What lies inside opens again when a side is laid bare.
                    open &= self.border_of(words, word);
                }
                for bit in ones(candidates) {
                    open &= !(u64::from(!qualifies(word * WORD + bit)) << bit);
                }
                self.bits[word] = open;
                if open == 0 {
                    self.active[block] &= !(1 << bit);
                }
            }
        }
    }
}
