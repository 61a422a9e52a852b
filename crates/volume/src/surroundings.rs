//! What a region holds inside, and what surrounds it.
//!
//! **Input** the bits of a region. **Output** its core, the voxels with all six neighbours in it; its body, the core with
//! the core's neighbours, which leaves out specks of noise; its shell, the voxels 3 to 5 steps outside; and how many
//! voxels of such a set need each level of a growth curve.
//! **Guarantees** the result depends neither on the axis order nor on the number of threads.
//! **Cost** O(words) for each of a dozen steps, O(voxels of the set); memory of four masks.

use espalier_model::{Bits, Volume};
use rayon::prelude::*;

use crate::growth::Growth;

/// Steps from the body that the blur of its edge reaches, and steps that the shell is deep.
const SKIP: usize = 2;
const DEPTH: usize = 3;
/// Values are counted by level, so many to either side of the seed's.
const REACH: i64 = 1 << 16;

/// The core of a region, the region itself where it has none, and the shell about its body.
pub(crate) fn core_and_shell(region: Bits) -> (Bits, Bits) {
    let mut core = complement(&region);
    core = complement(&widened(&core));
    let is_thin = core.words().iter().all(|&word| word == 0);
    let (core, body) = if is_thin {
        (region.clone(), region)
    } else {
        let body = widened(&core);
        (core, body)
    };
    (core, shell_about(body))
}

/// The voxels that are so few steps from a region, and not nearer.
pub(crate) fn shell_about(region: Bits) -> Bits {
    let near = nearby(region);
    let mut shell = near.clone();
    (0..DEPTH).for_each(|_| shell = widened(&shell));
    shell.words_mut().iter_mut().zip(near.words()).for_each(|(shell, near)| *shell &= !near);
    shell
}

/// The voxels of a region and those that the blur of its edge reaches.
pub(crate) fn nearby(region: Bits) -> Bits {
    let mut near = region;
    (0..SKIP).for_each(|_| near = widened(&near));
    near
}

fn complement(bits: &Bits) -> Bits {
    let mut other = Bits::new(bits.shape());
    let nx = bits.shape()[0];
    for row in 0..bits.n_rows() {
        other.fill_run(row, 0..nx);
    }
    other.words_mut().iter_mut().zip(bits.words()).for_each(|(other, bits)| *other &= !bits);
    other
}

/// The voxels of `bits` and their neighbours over faces.
fn widened(bits: &Bits) -> Bits {
    let [nx, ny, _] = bits.shape();
    let (n_rows, n_words) = (bits.n_rows(), bits.words_per_row());
    let mut wide = Bits::new(bits.shape());
    if n_words == 0 {
        return wide;
    }
    let tail = u64::MAX >> (n_words * 64 - nx);
    wide.words_mut().par_chunks_mut(n_words).enumerate().for_each(|(row, wide)| {
        let (y, z) = (row % ny, row / ny);
        let about = [(y > 0, row.wrapping_sub(1)), (y + 1 < ny, row + 1), (z > 0, row.wrapping_sub(ny))];
        let about = about.into_iter().chain([(row + ny < n_rows, row + ny)]);
        let line = bits.row(row);
        for (i, word) in wide.iter_mut().enumerate() {
            let before = if i > 0 { line[i - 1] >> 63 } else { 0 };
            let after = if i + 1 < n_words { line[i + 1] << 63 } else { 0 };
            *word = line[i] | line[i] << 1 | before | line[i] >> 1 | after;
        }
        for (_, other) in about.filter(|&(is_there, _)| is_there) {
            wide.iter_mut().zip(bits.row(other)).for_each(|(word, other)| *word |= other);
        }
        wide[n_words - 1] &= tail;
    });
    wide
}

/// How many voxels need each level.
pub(crate) struct Counts {
    of_level: Vec<u64>,
    n: u64,
}

impl Counts {
    pub(crate) fn of(volume: &Volume, growth: &Growth, voxels: &Bits) -> Self {
        let mut counts = Self { of_level: vec![0; 2 * REACH as usize + 1], n: 0 };
        let grid = volume.grid();
        for value in voxels.voxels().map(|voxel| volume.value(grid.index(voxel))) {
            if let Some(level) = growth.level_of(value) {
                counts.of_level[(level.clamp(-REACH, REACH) + REACH) as usize] += 1;
                counts.n += 1;
            }
        }
        counts
    }

    pub(crate) fn median(&self) -> i64 {
        let mut n = 0;
        let place = self.of_level.iter().position(|&count| {
            n += count;
            2 * n >= self.n.max(1)
        });
        place.map_or(0, |place| place as i64 - REACH)
    }

    /// How many need this level or a lower one.
    pub(crate) fn up_to(&self, level: i64) -> u64 {
        let end = (level.clamp(-REACH, REACH) + REACH + 1) as usize;
        self.of_level[..end].iter().sum()
    }

    pub(crate) fn n(&self) -> u64 {
        self.n
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flood::random_bits;

    #[test]
    fn widened_as_voxel_by_voxel() {
        const ABOUT: [[i64; 3]; 7] =
            [[0, 0, 0], [-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]];
        for case in 0..200 {
            let bits = random_bits(case);
            let wide = widened(&bits);
            let [nx, ny, nz] = bits.shape();
            for index in 0..nx * ny * nz {
                let voxel = [index % nx, index / nx % ny, index / (nx * ny)];
                let at = |d: [i64; 3]| bits.contains([0, 1, 2].map(|axis| voxel[axis] as i64 + d[axis]));
                assert_eq!(wide.get(voxel), ABOUT.into_iter().any(at), "case {case} {voxel:?}");
            }
            assert_eq!(complement(&complement(&bits)), bits);
            assert_eq!(complement(&bits).count(), nx * ny * nz - bits.count(), "case {case}");
        }
    }
}
