//! A mask, blurred and cut, where that can change it.
//!
//! **Input** the bits of a mask. **Output** the voxels at which a Gaussian blur of it is at least the cut.
//! **Steps** 1. the voxels with both foreground and background about them: no other can change; 2. for each of these the
//! sum over five rows of five planes, five bits at a time by a table.
//! **Guarantees** whole numbers, so that the result is the same everywhere; it does not depend on the number of threads.
//! **Cost** 25 look-ups for each voxel next to the surface.

use espalier_model::Bits;
use rayon::prelude::*;

/// The Gaussian of σ = 0.7 at 0, 1 and 2 voxels, in units in which all five add up to [`KERNEL_SUM`]:
/// exp(−k²/0.98) over their sum, in 65536ths.
const KERNEL: [u64; 3] = [37378, 13473, 606];
const KERNEL_SUM: u64 = KERNEL[0] + 2 * (KERNEL[1] + KERNEL[2]);
/// The cut, as a share: below a half, so that thin branches keep their width.
const CUT_PERCENT: u64 = 45;
/// The weights of five voxels in a row, by the bits that are set.
const ROW_WEIGHTS: [u64; 32] = {
    let mut table = [0; 32];
    let mut bits = 0;
    while bits < 32 {
        let mut place: usize = 0;
        while place < 5 {
            if bits >> place & 1 == 1 {
                table[bits] += KERNEL[place.abs_diff(2)];
            }
            place += 1;
        }
        bits += 1;
    }
    table
};

/// The mask, blurred and cut.
pub(super) fn blur(mask: &Bits) -> Bits {
    let [_, ny, nz] = mask.shape();
    let near = near_surface(mask);
    let mut smooth = mask.clone();
    let words_per_slice = mask.words_per_row() * ny;
    smooth.words_mut().par_chunks_mut(words_per_slice).enumerate().for_each(|(z, slice)| {
        for y in 0..ny {
            let row = near.row(z * ny + y);
            for (word, &bits) in row.iter().enumerate().filter(|(_, bits)| **bits != 0) {
                let mut left = bits;
                while left != 0 {
                    let bit = left.trailing_zeros();
                    left &= left - 1;
                    let is_set = blurred(mask, [word * 64 + bit as usize, y, z], nz) >= cut_level();
                    let place = &mut slice[y * row.len() + word];
                    *place = *place & !(1 << bit) | u64::from(is_set) << bit;
                }
            }
        }
    });
    smooth
}

const fn cut_level() -> u64 {
    KERNEL_SUM * KERNEL_SUM * KERNEL_SUM / 100 * CUT_PERCENT
}

/// The sum of the mask about a voxel, weighted by the kernel along each axis.
fn blurred(mask: &Bits, [x, y, z]: [usize; 3], nz: usize) -> u64 {
    let ny = mask.shape()[1];
    let mut total = 0;
    for (dz, weight_z) in (0..5).map(|dz: usize| (dz, KERNEL[dz.abs_diff(2)])) {
        let Some(z) = (z + dz).checked_sub(2).filter(|&z| z < nz) else { continue };
        let mut of_slice = 0;
        for (dy, weight_y) in (0..5).map(|dy: usize| (dy, KERNEL[dy.abs_diff(2)])) {
            let Some(y) = (y + dy).checked_sub(2).filter(|&y| y < ny) else { continue };
            of_slice += weight_y * ROW_WEIGHTS[five_bits(mask.row(z * ny + y), x)];
        }
        total += weight_z * of_slice;
    }
    total
}

/// The bits x − 2 … x + 2 of a row.
fn five_bits(row: &[u64], x: usize) -> usize {
    let (word, bit) = (x / 64, x % 64);
    let here = row[word];
    let bits = if bit >= 2 {
        let after = if bit > 61 { row.get(word + 1).map_or(0, |next| next << (66 - bit)) } else { 0 };
        here >> (bit - 2) | after
    } else {
        let before = if word > 0 { row[word - 1] >> (62 + bit) } else { 0 };
        here << (2 - bit) | before
    };
    (bits & 31) as usize
}

/// The voxels with both foreground and background among themselves and their 26 neighbours.
fn near_surface(mask: &Bits) -> Bits {
    let [_, ny, nz] = mask.shape();
    let mut near = Bits::new(mask.shape());
    let words_per_row = mask.words_per_row();
    let is_used: Vec<bool> =
        (0..mask.n_rows()).map(|row| mask.row(row).iter().any(|&word| word != 0)).collect();
    near.words_mut().par_chunks_mut(words_per_row * ny).enumerate().for_each(|(z, slice)| {
        let (mut any, mut all) = (vec![0; words_per_row], vec![0; words_per_row]);
        for (y, out) in slice.chunks_mut(words_per_row).enumerate() {
            let mut about = neighbour_rows([y, z]).filter(|&(y, z)| y < ny && z < nz);
            if !about.any(|(y, z)| is_used[z * ny + y]) {
                continue;
            }
            any.fill(0);
            all.fill(u64::MAX);
            for (y, z) in neighbour_rows([y, z]) {
                let is_inside = y < ny && z < nz;
                for word in 0..words_per_row {
                    let bits = if is_inside { mask.row(z * ny + y)[word] } else { 0 };
                    any[word] |= bits;
                    all[word] &= bits;
                }
            }
            for (word, out) in out.iter_mut().enumerate() {
                *out = spread(&any, word) & !shrunk(&all, word);
            }
        }
        clear_beyond(slice, words_per_row, mask.shape()[0]);
    });
    near
}

/// A row and the eight about it; beyond the first row the numbers wrap to beyond the last.
fn neighbour_rows([y, z]: [usize; 2]) -> impl Iterator<Item = (usize, usize)> {
    let about = |v: usize| [v.wrapping_sub(1), v, v + 1];
    about(z).into_iter().flat_map(move |z| about(y).map(|y| (y, z)))
}

/// A word of a row, with each bit set that has a set neighbour.
fn spread(row: &[u64], word: usize) -> u64 {
    let before = if word > 0 { row[word - 1] >> 63 } else { 0 };
    let after = row.get(word + 1).map_or(0, |next| next << 63);
    row[word] | row[word] << 1 | row[word] >> 1 | before | after
}

/// A word of a row, with each bit kept that has both neighbours.
fn shrunk(row: &[u64], word: usize) -> u64 {
    let before = if word > 0 { row[word - 1] >> 63 } else { 0 };
    let after = row.get(word + 1).map_or(0, |next| next << 63);
    row[word] & (row[word] << 1 | before) & (row[word] >> 1 | after)
}

/// Clears the bits beyond nx in the last word of each row.
fn clear_beyond(words: &mut [u64], words_per_row: usize, nx: usize) {
    if !nx.is_multiple_of(64) {
        words.iter_mut().skip(words_per_row - 1).step_by(words_per_row).for_each(|word| {
            *word &= (1 << (nx % 64)) - 1;
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flood::random_bits;

    #[test]
    fn the_blur_equals_a_plain_sum() {
        for case in 0..60 {
            let bits = random_bits(case);
            let smooth = blur(&bits);
            let [nx, ny, nz] = bits.shape();
            for voxel in (0..nx * ny * nz).map(|i| [i % nx, i / nx % ny, i / (nx * ny)]) {
                let mut sum = 0;
                for step in 0..125_i64 {
                    let d = [step % 5 - 2, step / 5 % 5 - 2, step / 25 - 2];
                    let at = [0, 1, 2].map(|axis| voxel[axis] as i64 + d[axis]);
                    let weight: u64 = d.iter().map(|v| KERNEL[v.unsigned_abs() as usize]).product();
                    sum += if bits.contains(at) { weight } else { 0 };
                }
                assert_eq!(smooth.get(voxel), sum >= cut_level(), "case {case} {voxel:?}");
            }
        }
    }
}
