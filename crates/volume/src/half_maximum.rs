//! The threshold half-way between a lumen's value and that of what surrounds it.
//!
//! **Input** a volume, a seed, how the region about it grows. **Output** [`HalfMaximum`].
//! **Notation** R(t) the region at threshold t; its core, the voxels with all six neighbours in R; its body, the core
//! with the core's neighbours, which leaves out specks of noise; its shell, the voxels 3 to 5 steps from the body.
//! i(t) the median of the core, o(t) the median of the shell.
//! **Steps** 1. from the seed's value on, find the first level at which R stands alone: so few of the shell's voxels
//! lie in the band that they cannot hang together. A patch of noise inside a lumen fails this, and so does a region
//! that has leaked. 2. t ← (i(t) + o(t)) / 2, until t stays; where it goes to and fro, the value nearest to the lumen's.
//! It never goes beyond the last level before a leak.
//! **Why half-way?** A voxel across the edge of a tube is half lumen there; and under noise as many voxels of the tube
//! are lost as others are won. Before a leak into tissue there is no calm: it begins with specks at every wall.
//! **Guarantees** the result depends neither on the axis order nor on the number of threads.
//! **Source** thresholds half-way between two means, iterated [Ridler1978].
//! **Differs from the source** the two are a region and what is about it, not all of a picture; and medians.
//! **Cost** O(region + words of a mask) for each of a few thresholds; memory of six masks.

use espalier_model::{Bits, Volume};
use rayon::prelude::*;

use crate::growth::{Growth, Knee, MIN_VOXELS, region_at};

/// Of the shell's voxels at most this share may lie in the band. From a share of 0.31 on, voxels at random places hang
/// together over faces [Grassberger1992]: then region and shell are one tissue.
const MAX_SHARE: f64 = 0.2;
/// Steps from the body that the blur of its edge reaches, and steps that the shell is deep.
const SKIP: usize = 2;
const DEPTH: usize = 3;
/// From one level that is tried as a start to the next.
const STRIDE: usize = 5;
/// The most rounds; the phantoms need 3 or 4.
const MAX_ROUNDS: usize = 16;
/// Values are counted by level, so many to either side of the seed's.
const REACH: i64 = 1 << 16;

/// A threshold half-way between two values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfMaximum {
    /// Half-way, in the volume's scaled units.
    pub threshold: f64,
    /// The level of the curve to grow to: that of the threshold, or the last before the leak if it leaks earlier.
    /// None if the seed's own value is beyond the threshold.
    pub level: Option<usize>,
    /// The median of the values inside the region.
    pub inside: f64,
    /// The median of those a few voxels outside of it.
    pub outside: f64,
}

/// The half maximum of the region about `seed`, if the region stands out from what surrounds it at any level before
/// the leak.
pub(crate) fn find(volume: &Volume, seed: [usize; 3], growth: &Growth) -> Option<HalfMaximum> {
    let last = match growth.knee {
        Knee::Leak { stable } => stable,
        Knee::None => growth.levels.len().saturating_sub(1),
        Knee::NeverCalm => return None,
    };
    let sides_at = |level: usize| Sides::of(volume, seed, growth, level);
    let first = growth.levels.partition_point(|level| level.n_voxels < MIN_VOXELS);
    let mut starts = (first..=last).step_by(STRIDE).map(|level| (level, sides_at(level)));
    let (start, mut sides) = starts.find(|(_, sides)| sides.stand_apart())?;
    let mut tried = vec![start];
    for _ in 0..MAX_ROUNDS {
        let next = sides.half_way().clamp(0, last as i64) as usize;
        if let Some(before) = tried.iter().position(|&level| level == next) {
            let nearest = tried[before..].iter().copied().min().unwrap_or(next);
            if nearest != tried[tried.len() - 1] {
                sides = sides_at(nearest);
            }
            break;
        }
        sides = sides_at(next);
        tried.push(next);
    }
    let half_way = sides.half_way();
    let level = usize::try_from(half_way).ok().map(|level| level.min(last));
    let [threshold, inside, outside] = [half_way, sides.inside, sides.outside].map(|at| growth.value(at));
    Some(HalfMaximum { threshold, level, inside, outside })
}

/// Medians inside and outside of a region, as levels.
struct Sides {
    inside: i64,
    outside: i64,
    /// The share of the voxels outside that lie in the band.
    share: f64,
}

impl Sides {
    fn of(volume: &Volume, seed: [usize; 3], growth: &Growth, level: usize) -> Self {
        let region = region_at(volume, seed, growth, level);
        let (core, shell) = core_and_shell(region);
        let inside = Counts::of(volume, growth, &core);
        let outside = Counts::of(volume, growth, &shell);
        Self { inside: inside.median(), outside: outside.median(), share: outside.share_up_to(level) }
    }

    fn stand_apart(&self) -> bool {
        self.share <= MAX_SHARE && self.inside < self.outside
    }

    fn half_way(&self) -> i64 {
        (self.inside + self.outside).div_euclid(2)
    }
}

/// The core of a region, the region itself where it has none, and the shell about its body.
fn core_and_shell(region: Bits) -> (Bits, Bits) {
    let mut core = complement(&region);
    core = complement(&widened(&core));
    let is_thin = core.words().iter().all(|&word| word == 0);
    let (core, body) = if is_thin {
        (region.clone(), region)
    } else {
        let body = widened(&core);
        (core, body)
    };
    let mut near = body;
    (0..SKIP).for_each(|_| near = widened(&near));
    let mut shell = near.clone();
    (0..DEPTH).for_each(|_| shell = widened(&shell));
    shell.words_mut().iter_mut().zip(near.words()).for_each(|(shell, near)| *shell &= !near);
    (core, shell)
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
struct Counts {
    of_level: Vec<u64>,
    n: u64,
}

impl Counts {
    fn of(volume: &Volume, growth: &Growth, voxels: &Bits) -> Self {
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

    fn median(&self) -> i64 {
        let mut n = 0;
        let place = self.of_level.iter().position(|&count| {
            n += count;
            2 * n >= self.n.max(1)
        });
        place.map_or(0, |place| place as i64 - REACH)
    }

    fn share_up_to(&self, level: usize) -> f64 {
        let end = (level as i64 + REACH + 1) as usize;
        let n: u64 = self.of_level[..end].iter().sum();
        n as f64 / self.n.max(1) as f64
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
