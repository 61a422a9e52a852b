//! A volume of bits.
//!
//! **Notation** a *row* is the voxels of one (y, z) along x; row number `z · ny + y`. Bit x of a row is bit
//! `x % 64` of its word `x / 64`.
//! **Guarantees** each row begins a word, and the bits beyond nx in its last word are 0, so that words can be counted,
//! compared and shifted without a look at the end.

mod euler;

use std::ops::Range;

pub use euler::EULER_OF_BLOCK;

/// Bits in a word.
const WORD: usize = u64::BITS as usize;

/// One bit for each voxel of a box, x fastest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Bits {
    shape: [usize; 3],
    words_per_row: usize,
    words: Vec<u64>,
}

impl Bits {
    /// A box of zeros.
    #[must_use]
    pub fn new(shape: [usize; 3]) -> Self {
        let [nx, ny, nz] = shape;
        let words_per_row = nx.div_ceil(WORD);
        Self { shape, words_per_row, words: vec![0; words_per_row * ny * nz] }
    }

    /// Extents along x, y, z.
    #[must_use]
    pub fn shape(&self) -> [usize; 3] {
        self.shape
    }

    /// The number of rows: ny · nz.
    #[must_use]
    pub fn n_rows(&self) -> usize {
        self.shape[1] * self.shape[2]
    }

    /// Words in a row.
    #[must_use]
    pub fn words_per_row(&self) -> usize {
        self.words_per_row
    }

    /// All words, row after row.
    #[must_use]
    pub fn words(&self) -> &[u64] {
        &self.words
    }

    /// All words, to be written. The bits beyond nx must stay 0.
    #[must_use]
    pub fn words_mut(&mut self) -> &mut [u64] {
        &mut self.words
    }

    /// The words of a row.
    #[must_use]
    pub fn row(&self, row: usize) -> &[u64] {
        &self.words[row * self.words_per_row..][..self.words_per_row]
    }

    /// The words of a row, to be written. The bits beyond nx must stay 0.
    #[must_use]
    pub fn row_mut(&mut self, row: usize) -> &mut [u64] {
        &mut self.words[row * self.words_per_row..][..self.words_per_row]
    }

    /// The bit of a voxel inside the box.
    #[must_use]
    pub fn get(&self, voxel: [usize; 3]) -> bool {
        let (word, bit) = self.place(voxel);
        self.words[word] & bit != 0
    }

    /// The bit of a voxel; 0 outside the box.
    #[must_use]
    pub fn contains(&self, voxel: [i64; 3]) -> bool {
        let is_inside = (0..3).all(|axis| (0..self.shape[axis] as i64).contains(&voxel[axis]));
        is_inside && self.get(voxel.map(|coordinate| coordinate as usize))
    }

    /// Sets the bit of a voxel inside the box.
    pub fn set(&mut self, voxel: [usize; 3]) {
        let (word, bit) = self.place(voxel);
        self.words[word] |= bit;
    }

    /// Clears the bit of a voxel inside the box.
    pub fn clear(&mut self, voxel: [usize; 3]) {
        let (word, bit) = self.place(voxel);
        self.words[word] &= !bit;
    }

    /// Sets a run of a row.
    pub fn fill_run(&mut self, row: usize, run: Range<usize>) {
        for_each_word(run, |word, bits| self.words[row * self.words_per_row + word] |= bits);
    }

    /// Clears a run of a row.
    pub fn clear_run(&mut self, row: usize, run: Range<usize>) {
        for_each_word(run, |word, bits| self.words[row * self.words_per_row + word] &= !bits);
    }

    /// The maximal runs of ones in a row, from left to right.
    pub fn runs(&self, row: usize) -> impl Iterator<Item = Range<usize>> + '_ {
        let words = self.row(row);
        let mut x = 0;
        std::iter::from_fn(move || {
            let start = next_bit(words, x, 0)?;
            x = next_bit(words, start, u64::MAX).unwrap_or(self.shape[0]).min(self.shape[0]);
            Some(start..x)
        })
    }

    /// The voxels whose bit is set, in storage order.
    pub fn voxels(&self) -> impl Iterator<Item = [usize; 3]> + '_ {
        let ny = self.shape[1];
        (0..self.n_rows()).flat_map(move |row| {
            let place = move |(word, bits): (usize, u64)| ones(bits).map(move |bit| word * WORD + bit);
            let words = self.row(row).iter().copied().enumerate().filter(|&(_, bits)| bits != 0);
            words.flat_map(place).map(move |x| [x, row % ny, row / ny])
        })
    }

    /// The number of ones.
    #[must_use]
    pub fn count(&self) -> usize {
        self.words.iter().map(|word| word.count_ones() as usize).sum()
    }

    /// The smallest box that holds the ones, as first and last voxel (inclusive); `None` if there is none.
    #[must_use]
    pub fn bounding_box(&self) -> Option<([usize; 3], [usize; 3])> {
        let ny = self.shape[1];
        let mut bounds: Option<([usize; 3], [usize; 3])> = None;
        for row in 0..self.n_rows() {
            let words = self.row(row);
            let Some(first) = next_bit(words, 0, 0) else { continue };
            let last = last_bit(words).unwrap_or(first);
            let (y, z) = (row % ny, row / ny);
            let (low, high) = bounds.get_or_insert(([first, y, z], [last, y, z]));
            *low = [low[0].min(first), low[1].min(y), low[2].min(z)];
            *high = [high[0].max(last), high[1].max(y), high[2].max(z)];
        }
        bounds
    }

    /// The word of a voxel and its bit there.
    fn place(&self, [x, y, z]: [usize; 3]) -> (usize, u64) {
        debug_assert!(x < self.shape[0] && y < self.shape[1] && z < self.shape[2], "voxel outside its box");
        ((z * self.shape[1] + y) * self.words_per_row + x / WORD, 1 << (x % WORD))
    }
}

/// The places of the ones in a word, from the lowest.
fn ones(mut bits: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (bits != 0).then(|| bits.trailing_zeros() as usize)?;
        bits &= bits - 1;
        Some(bit)
    })
}

/// The first place at or after `from` whose bit, after an exclusive or with `flip`, is 1.
fn next_bit(words: &[u64], from: usize, flip: u64) -> Option<usize> {
    let first = from / WORD;
    let start = (words.get(first)? ^ flip) & (u64::MAX << (from % WORD));
    let later = words[first + 1..].iter().map(|word| word ^ flip);
    let (word, bits) = (first..).zip(std::iter::once(start).chain(later)).find(|&(_, bits)| bits != 0)?;
    Some(word * WORD + bits.trailing_zeros() as usize)
}

/// The last place whose bit is 1.
fn last_bit(words: &[u64]) -> Option<usize> {
    let word = words.iter().rposition(|&bits| bits != 0)?;
    Some(word * WORD + WORD - 1 - words[word].leading_zeros() as usize)
}

/// Calls `apply` with each word that a run touches, and the run's bits in it.
fn for_each_word(run: Range<usize>, mut apply: impl FnMut(usize, u64)) {
    if run.is_empty() {
        return;
    }
    let (first, last) = (run.start / WORD, (run.end - 1) / WORD);
    for word in first..=last {
        let low = if word == first { u64::MAX << (run.start % WORD) } else { u64::MAX };
        let high = if word == last { u64::MAX >> (WORD - 1 - (run.end - 1) % WORD) } else { u64::MAX };
        apply(word, low & high);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs of ones by a plain scan.
    fn plain_runs(row: &[bool]) -> Vec<Range<usize>> {
        let mut runs: Vec<Range<usize>> = Vec::new();
        for x in (0..row.len()).filter(|&x| row[x]) {
            match runs.last_mut().filter(|run| run.end == x) {
                Some(run) => run.end += 1,
                None => runs.push(x..x + 1),
            }
        }
        runs
    }

    #[test]
    fn runs_boxes_and_counts_equal_a_plain_scan() {
        for nx in [1, 2, 63, 64, 65, 127, 128, 129, 200] {
            for pattern in 0..6_usize {
                let is_set = |x: usize| match pattern {
                    0 => false,
                    1 => true,
                    2 => x.is_multiple_of(2),
                    3 => (60..70).contains(&x),
                    4 => x + 1 == nx,
                    _ => x * x % 7 < 3,
                };
                let row: Vec<bool> = (0..nx).map(is_set).collect();
                let mut bits = Bits::new([nx, 2, 2]);
                plain_runs(&row).into_iter().for_each(|run| bits.fill_run(3, run));
                assert_eq!(bits.runs(3).collect::<Vec<_>>(), plain_runs(&row), "{nx} {pattern}");
                assert_eq!(bits.count(), row.iter().filter(|&&v| v).count());
                let voxels: Vec<[usize; 3]> = (0..nx).filter(|&x| row[x]).map(|x| [x, 1, 1]).collect();
                assert_eq!(bits.voxels().collect::<Vec<_>>(), voxels);
                assert_eq!(bits.bounding_box(), voxels.first().copied().zip(voxels.last().copied()));
                plain_runs(&row).into_iter().for_each(|run| bits.clear_run(3, run));
                assert_eq!(bits, Bits::new([nx, 2, 2]));
            }
        }
    }

    #[test]
    fn single_bits() {
        let mut bits = Bits::new([70, 3, 2]);
        bits.set([69, 2, 1]);
        assert!(bits.get([69, 2, 1]) && bits.contains([69, 2, 1]));
        assert!(!bits.contains([70, 2, 1]) && !bits.contains([-1, 0, 0]) && !bits.contains([5, 3, 0]));
        bits.clear([69, 2, 1]);
        assert_eq!(bits.count(), 0);
    }
}
