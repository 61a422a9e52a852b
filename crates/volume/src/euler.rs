//! The Euler number of a mask, and its tunnels.
//!
//! **Input** [`Bits`], seen as a union of closed cubes: a 26-connected foreground. **Output** χ, which is
//! vertices − edges + faces − cubes, and as well components − tunnels + cavities.
//! **Notation** (y, z) a line along x at which the rows (y−1, z−1), (y, z−1), (y−1, z), (y, z) meet; r(A) the number
//! of runs of ones in the word string A.
//! **Steps** Along such a line lie r + n vertices and n edges, where n counts the ones of the four rows together
//! and r their runs: they add r to χ. So do, with the other sign, the edges and faces of the plane between two rows,
//! and those across a single row. The sum over all lines is r(a|b|c|d) − r(c|d) − r(b|d) + r(d).
//! **Guarantees** exact; the same at any number of threads.
//! **Cost** a few operations a word.

use espalier_model::Bits;
use rayon::prelude::*;

/// The Euler number of a 26-connected foreground: components − tunnels + cavities.
///
/// ```
/// use espalier_model::Bits;
/// let mut ring = Bits::new([3, 3, 1]);
/// (0..3).for_each(|row| ring.fill_run(row, 0..3));
/// assert_eq!(espalier_volume::euler_number(&ring), 1);
/// ring.clear([1, 1, 0]);
/// assert_eq!(espalier_volume::euler_number(&ring), 0); // one component, one tunnel
/// ```
#[must_use]
pub fn euler_number(bits: &Bits) -> i64 {
    let nz = bits.shape()[2];
    (0..=nz).into_par_iter().map(|z| euler_of_plane(bits, z)).sum()
}

/// The part of the lines between the slices z − 1 and z.
fn euler_of_plane(bits: &Bits, z: usize) -> i64 {
    let [_, ny, nz] = bits.shape();
    let none = vec![0; bits.words_per_row()];
    // Beyond the border there is no foreground; 0 − 1 wraps to beyond it.
    let row = |y: usize, z: usize| if y < ny && z < nz { bits.row(z * ny + y) } else { &none[..] };
    let below = z.wrapping_sub(1);
    let line = |y: usize| {
        let before = y.wrapping_sub(1);
        euler_of_line([row(before, below), row(y, below), row(before, z), row(y, z)])
    };
    (0..=ny).map(line).sum()
}

fn euler_of_line([a, b, c, d]: [&[u64]; 4]) -> i64 {
    let mut carries = [0; 4];
    let mut total = 0;
    for word in 0..d.len() {
        let (a, b, c, d) = (a[word], b[word], c[word], d[word]);
        if a | b | c | d == 0 {
            carries = [0; 4];
            continue;
        }
        let strings = [a | b | c | d, c | d, b | d, d];
        let n_starts = [0, 1, 2, 3].map(|i| {
            let starts = strings[i] & !(strings[i] << 1 | carries[i]);
            carries[i] = strings[i] >> 63;
            i64::from(starts.count_ones())
        });
        total += n_starts[0] - n_starts[1] - n_starts[2] + n_starts[3];
    }
    total
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flood::random_bits;

    /// Cells counted one by one.
    fn plain(bits: &Bits) -> i64 {
        let [nx, ny, nz] = bits.shape().map(|extent| extent as i64);
        let mut total = 0;
        // A cell of the doubled lattice: an odd coordinate lies within a voxel, an even one between two.
        for (z, y, x) in
            (0..=2 * nz).flat_map(|z| (0..=2 * ny).flat_map(move |y| (0..=2 * nx).map(move |x| (z, y, x))))
        {
            let reach = |v: i64| if v % 2 == 1 { v / 2..=v / 2 } else { v / 2 - 1..=v / 2 };
            let mut voxels =
                reach(z).flat_map(|k| reach(y).flat_map(move |j| reach(x).map(move |i| [i, j, k])));
            if voxels.any(|voxel| bits.contains(voxel)) {
                total += if (x % 2 + y % 2 + z % 2) % 2 == 0 { 1 } else { -1 };
            }
        }
        total
    }

    #[test]
    fn equals_counting_cells() {
        for case in 0..200 {
            let bits = random_bits(case);
            assert_eq!(euler_number(&bits), plain(&bits), "case {case}");
        }
    }

    #[test]
    fn known_shapes() {
        let of = |is_set: &dyn Fn([usize; 3]) -> bool| {
            let mut bits = Bits::new([70, 5, 5]);
            for voxel in (0..70 * 25).map(|i| [i % 70, i / 70 % 5, i / 350]).filter(|&voxel| is_set(voxel)) {
                bits.set(voxel);
            }
            euler_number(&bits)
        };
        let in_box = |v: [usize; 3]| (61..66).contains(&v[0]) && v[1] > 0 && v[1] < 4;
        assert_eq!(of(&|_| false), 0);
        assert_eq!(of(&|_| true), 1);
        assert_eq!(of(&in_box), 1);
        // A hole through the box is a tunnel, a closed one a cavity, two voxels apart two components.
        assert_eq!(of(&|v| in_box(v) && (v[0], v[1]) != (63, 2)), 0);
        assert_eq!(of(&|v| in_box(v) && v != [63, 2, 2]), 2);
        assert_eq!(of(&|v| v == [0, 0, 0] || v == [64, 4, 4]), 2);
        assert_eq!(of(&|v| v == [63, 0, 0] || v == [64, 1, 1]), 1);
    }
}
