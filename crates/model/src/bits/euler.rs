//! The Euler number of bits, counted.
//!
//! **Input** [`Bits`], seen as a union of closed cubes: a 26-connected foreground. **Output** χ, which is
//! vertices − edges + faces − cubes, and as well components − tunnels + cavities.
//! **Notation** (y, z) a line along x at which the rows (y−1, z−1), (y, z−1), (y−1, z), (y, z) meet; r(A) the number
//! of runs of ones in the word string A.
//! **Steps** Along such a line lie r + n vertices and n edges, where n counts the ones of the four rows together
//! and r their runs: they add r to χ. So do, with the other sign, the edges and faces of the plane between two rows,
//! and those across a single row. The sum over all lines is r(a|b|c|d) − r(c|d) − r(b|d) + r(d).
//! **Guarantees** exact.
//! **Cost** a few operations a word.

use super::Bits;

/// 8 χ of each of the 256 sets of a 2×2×2 block of voxels about a vertex; voxel (x, y, z) of the block is bit
/// 4z + 2y + x. The vertex owns itself, half of each of its 6 edges, a quarter of each of its 12 faces and an eighth
/// of each of its 8 voxels, so that χ is the sum over all vertices.
pub const EULER_OF_BLOCK: [i8; 256] = {
    let mut table = [0; 256];
    let mut block = 0;
    while block < 256 {
        table[block] = euler_of_block(block as u8);
        block += 1;
    }
    table
};

/// The voxels of a block on the upper side of x, y, z.
const UPPER_HALF: [u8; 3] = [0b1010_1010, 0b1100_1100, 0b1111_0000];

const fn euler_of_block(block: u8) -> i8 {
    let mut twice_halves = 0;
    let mut axis = 0;
    while axis < 3 {
        // The two edges from the vertex along this axis; four voxels share each.
        twice_halves -= 4 * (block & UPPER_HALF[axis] != 0) as i8;
        twice_halves -= 4 * (block & !UPPER_HALF[axis] != 0) as i8;
        // The four faces across this axis; the two voxels on their sides share each.
        let pairs = (block | block >> (1 << axis)) & !UPPER_HALF[axis];
        twice_halves += 2 * pairs.count_ones() as i8;
        axis += 1;
    }
    8 * (block != 0) as i8 + twice_halves - block.count_ones() as i8
}

impl Bits {
    /// The Euler number of the 26-connected foreground: components − tunnels + cavities.
    ///
    /// ```
    /// use espalier_model::Bits;
    /// let mut ring = Bits::new([3, 3, 1]);
    /// (0..3).for_each(|row| ring.fill_run(row, 0..3));
    /// assert_eq!(ring.euler_number(), 1);
    /// ring.clear([1, 1, 0]);
    /// assert_eq!(ring.euler_number(), 0); // one component, one tunnel
    /// ```
    #[must_use]
    pub fn euler_number(&self) -> i64 {
        (0..=self.shape[2]).map(|z| self.euler_between(z)).sum()
    }

    /// What lies between the slices z − 1 and z adds to the Euler number; z from 0 to their number, both included. For
    /// those who share the work out.
    #[must_use]
    pub fn euler_between(&self, z: usize) -> i64 {
        let [_, ny, nz] = self.shape;
        let none = vec![0; self.words_per_row];
        // Beyond the border there is no foreground; 0 − 1 wraps to beyond it.
        let row = |y: usize, z: usize| if y < ny && z < nz { self.row(z * ny + y) } else { &none[..] };
        let below = z.wrapping_sub(1);
        let line = |y: usize| {
            let before = y.wrapping_sub(1);
            euler_of_line([row(before, below), row(y, below), row(before, z), row(y, z)])
        };
        (0..=ny).map(line).sum()
    }
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
    use espalier_geom::random::{Purpose, Stream};

    use super::*;

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
    fn equals_counting_cells_and_the_sum_over_vertices() {
        let mut stream = Stream::new(17, Purpose::Test, 0, 0);
        for case in 0..120_u32 {
            let shape = [1 + stream.below(70), 1 + stream.below(6), 1 + stream.below(6)].map(|n| n as usize);
            let mut bits = Bits::new(shape);
            for index in 0..shape[0] * shape[1] * shape[2] {
                if stream.below(100) < 10 + case % 80 {
                    bits.set([index % shape[0], index / shape[0] % shape[1], index / (shape[0] * shape[1])]);
                }
            }
            assert_eq!(bits.euler_number(), plain(&bits), "case {case}");
            let [nx, ny, nz] = shape.map(|extent| extent as i64);
            let vertices =
                (0..=nz).flat_map(|z| (0..=ny).flat_map(move |y| (0..=nx).map(move |x| [x, y, z])));
            let block = |[x, y, z]: [i64; 3]| {
                let of = |i: i64| bits.contains([x - 1 + i % 2, y - 1 + i / 2 % 2, z - 1 + i / 4]);
                (0..8).fold(0, |block, i| block | usize::from(of(i)) << i)
            };
            let eight: i64 = vertices.map(|vertex| i64::from(EULER_OF_BLOCK[block(vertex)])).sum();
            assert_eq!(eight, 8 * bits.euler_number(), "case {case}");
        }
    }

    #[test]
    fn known_shapes() {
        let of = |is_set: &dyn Fn([usize; 3]) -> bool| {
            let mut bits = Bits::new([70, 5, 5]);
            for voxel in (0..70 * 25).map(|i| [i % 70, i / 70 % 5, i / 350]).filter(|&voxel| is_set(voxel)) {
                bits.set(voxel);
            }
            bits.euler_number()
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
