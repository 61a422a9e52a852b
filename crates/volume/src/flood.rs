//! The plain form of what runs do fast, for tests: flood fill voxel by voxel.

use espalier_geom::random::{Purpose, Stream};
use espalier_model::Bits;

use crate::runs::Connectivity;

/// For each voxel the number of its component of `value`, in storage order; `usize::MAX` for the others.
pub(crate) fn flood(bits: &Bits, value: bool, connectivity: Connectivity) -> Vec<usize> {
    let [nx, ny, nz] = bits.shape();
    let voxel = |index: usize| [index % nx, index / nx % ny, index / (nx * ny)];
    let mut component = vec![usize::MAX; nx * ny * nz];
    let mut n_components = 0;
    for start in 0..component.len() {
        if bits.get(voxel(start)) != value || component[start] != usize::MAX {
            continue;
        }
        component[start] = n_components;
        let mut stack = vec![start];
        while let Some(index) = stack.pop() {
            for step in 0..27_i64 {
                let d = [step % 3 - 1, step / 3 % 3 - 1, step / 9 - 1];
                if connectivity == Connectivity::Faces && d.iter().filter(|&&v| v != 0).count() != 1 {
                    continue;
                }
                let [x, y, z] =
                    [0, 1, 2].map(|axis| voxel(index)[axis].wrapping_add_signed(d[axis] as isize));
                if x < nx && y < ny && z < nz {
                    let other = (z * ny + y) * nx + x;
                    if bits.get([x, y, z]) == value && component[other] == usize::MAX {
                        component[other] = n_components;
                        stack.push(other);
                    }
                }
            }
        }
        n_components += 1;
    }
    component
}

/// A small random volume; every fourth is longer than a word.
pub(crate) fn random_bits(case: u64) -> Bits {
    let mut stream = Stream::new(case, Purpose::Test, 0, 0);
    let nx = if case.is_multiple_of(4) { 60 + stream.below(80) } else { 1 + stream.below(9) };
    let shape = [nx, 1 + stream.below(7), 1 + stream.below(6)].map(|v| v as usize);
    let density = stream.uniform(0.05, 0.95);
    let mut bits = Bits::new(shape);
    for row in 0..bits.n_rows() {
        for x in 0..shape[0] {
            if stream.unit() < density {
                bits.fill_run(row, x..x + 1);
            }
        }
    }
    bits
}
