//! Pits of a wall, filled.
//!
//! **Input** the bits of a mask, and which of its axes is coarse. **Output** its pits: background voxels with foreground on
//! four or more of their six sides; voxels beside a smooth convex wall have three at most. On thick slices also those with
//! foreground on three or more of the four sides within the slice, where such a voxel has two at most.
//! **Why** in a branch one slice thick a voxel that is missing is a hole, and no blur over three slices closes it: with 15 %
//! of the surface flipped on slices of 2.5 mm, most tunnels are such holes.
//! **Cost** a few operations a word.

use espalier_model::Bits;

/// An axis of this multiple of the smallest spacing is coarse: a branch may be one voxel thick along it.
const COARSE: f64 = 2.0;

/// The one axis along which a branch may be a single voxel thick, if there is just one.
pub(super) fn coarse_axis(spacing: [f64; 3]) -> Option<usize> {
    let smallest = spacing.into_iter().fold(f64::INFINITY, f64::min);
    let mut coarse = (0..3).filter(|&axis| spacing[axis] >= COARSE * smallest);
    coarse.next().filter(|_| coarse.next().is_none())
}

/// Sets in `smooth` the pits of `mask`.
pub(super) fn fill(mask: &Bits, coarse_axis: Option<usize>, smooth: &mut Bits) {
    let [_, ny, nz] = mask.shape();
    let none = vec![0; mask.words_per_row()];
    // Beyond the border there is no foreground; 0 − 1 wraps to beyond it.
    let row_at = |y: usize, z: usize| if y < ny && z < nz { mask.row(z * ny + y) } else { &none[..] };
    for row in 0..mask.n_rows() {
        let (y, z) = (row % ny, row / ny);
        let about =
            [row_at(y.wrapping_sub(1), z), row_at(y + 1, z), row_at(y, z.wrapping_sub(1)), row_at(y, z + 1)];
        let own = mask.row(row);
        for word in 0..own.len() {
            let before = if word > 0 { own[word - 1] >> 63 } else { 0 };
            let after = own.get(word + 1).map_or(0, |next| next << 63);
            let [a, b, c, d] = about.map(|row| row[word]);
            let sides = [own[word] << 1 | before, own[word] >> 1 | after, a, b, c, d];
            let in_slice = coarse_axis.map_or(0, |axis| {
                let fine = |i: usize| sides[(2 * axis + 2 + i) % 6];
                three_of([0, 1, 2, 3].map(fine))
            });
            smooth.row_mut(row)[word] |= !own[word] & (four_of(sides) | in_slice);
        }
    }
}

/// Where four or more of six words have a bit.
fn four_of([a, b, c, d, e, f]: [u64; 6]) -> u64 {
    let sum = |a: u64, b: u64, c: u64| (a ^ b ^ c, a & b | b & c | c & a);
    let ((low, twos), (other, more_twos)) = (sum(a, b, c), sum(d, e, f));
    sum(twos, more_twos, low & other).1
}

/// Where three or more of four words have a bit.
fn three_of([a, b, c, d]: [u64; 4]) -> u64 {
    a & b & (c | d) | (a | b) & c & d
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flood::random_bits;

    #[test]
    fn pits_are_those_that_are_counted() {
        for case in 0..60 {
            let bits = random_bits(case);
            let coarse_axis = [None, Some(0), Some(1), Some(2)][case as usize % 4];
            let mut filled = bits.clone();
            fill(&bits, coarse_axis, &mut filled);
            let [nx, ny, nz] = bits.shape();
            for voxel in (0..nx * ny * nz).map(|i| [i % nx, i / nx % ny, i / (nx * ny)]) {
                let side = |axis: usize, step: i64| {
                    let mut at = voxel.map(|v| v as i64);
                    at[axis] += step;
                    usize::from(bits.contains(at))
                };
                let n_along = [0, 1, 2].map(|axis| side(axis, -1) + side(axis, 1));
                let n_sides: usize = n_along.iter().sum();
                let is_pit = n_sides >= 4 || coarse_axis.is_some_and(|axis| n_sides - n_along[axis] >= 3);
                assert_eq!(filled.get(voxel), bits.get(voxel) || is_pit, "case {case} {voxel:?}");
            }
        }
    }
}
