//! Whether removing a voxel leaves the Euler number as it is.
//!
//! **Input** a neighbourhood: 27 bits, bit 9·(dz+1) + 3·(dy+1) + (dx+1). **Output** 8 × the change.
//! **Notation** χ the Euler number of the union of closed voxel cubes (26-connected foreground); S the
//! foreground voxels of the 2×2×2 block about a common vertex.
//! **Steps** 1. A vertex owns itself, half of each of its 6 edges, a quarter of each of its 12 faces and an
//! eighth of each of its 8 voxels, so that χ is the sum over all vertices of
//! χ₈(S)/8 = \[S ≠ ∅\] − edges/2 + faces/4 − |S|/8, where only edges and faces touched by S count.
//! 2. Removing the centre changes the 8 vertices of its cube: δ = Σ χ₈(with it) − χ₈(without it).
//! **Source** [Lee94] section 3: the values δ are its Table 2, generated here from the formula.
//! **Cost** eight table look-ups; two by [`EulerTable`], the four blocks on one side of the centre at a time.

use std::sync::LazyLock;

use espalier_model::EULER_OF_BLOCK;

use crate::simple::CENTER;

/// 8 × the amount by which the Euler number falls when the centre of `neighborhood` is removed.
pub(crate) fn euler_change(neighborhood: u32) -> i32 {
    let with_center = neighborhood | CENTER;
    let without_center = neighborhood & !CENTER;
    let mut change = 0;
    // The lowest corner of each of the eight blocks that hold the centre: bits 9z + 3y + x, each 0 or 1.
    for corner in [0, 1, 3, 4, 9, 10, 12, 13] {
        change += i32::from(EULER_OF_BLOCK[block_at(with_center, corner)]);
        change -= i32::from(EULER_OF_BLOCK[block_at(without_center, corner)]);
    }
    change
}

/// The change of the four blocks on one side of the centre, by the 9 bits of that side and the 8 beside the centre.
pub(crate) struct EulerTable {
    changes: Vec<i8>,
}

impl EulerTable {
    /// Works the table out: 131,072 entries, under a millisecond.
    fn new() -> Self {
        // With the other side empty, its four blocks see the middle alone; half of that change is theirs.
        let of_half = |half: u32| {
            let middle = middle_from_8(half & 0xFF);
            let change = euler_change(half >> 8 << 18 | middle << 9);
            (change - euler_change(middle << 9) / 2) as i8
        };
        Self { changes: (0..1 << 17).map(of_half).collect() }
    }

    /// The table, made at the first call.
    pub(crate) fn get() -> &'static Self {
        static TABLE: LazyLock<EulerTable> = LazyLock::new(EulerTable::new);
        &TABLE
    }

    /// Whether the Euler number stays as it is when the centre of `neighborhood` is removed.
    #[inline]
    pub(crate) fn is_invariant(&self, neighborhood: u32) -> bool {
        // The centre is left out of the middle nine bits.
        let middle = neighborhood >> 9 & 0xF | neighborhood >> 10 & 0xF0;
        let [below, above] = [neighborhood & 0x1FF, neighborhood >> 18 & 0x1FF];
        self.changes[(below << 8 | middle) as usize] == -self.changes[(above << 8 | middle) as usize]
    }
}

/// The nine bits about the centre, without it, from the eight.
fn middle_from_8(bits: u32) -> u32 {
    bits & 0xF | (bits & 0xF0) << 1
}

/// The eight bits of the 2×2×2 block whose lowest voxel is bit `corner` of the neighbourhood.
fn block_at(neighborhood: u32, corner: u32) -> usize {
    let bits = neighborhood >> corner;
    (bits & 0b11 | bits >> 1 & 0b1100 | bits >> 5 & 0b11_0000 | bits >> 6 & 0b1100_0000) as usize
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use espalier_geom::random::{Purpose, Stream};

    use super::*;

    /// χ = vertices − edges + faces − voxels, cells counted one by one. A cell of the cubical complex is its
    /// centre in half voxels: odd coordinates are where it is flat.
    fn euler_by_counting(voxels: impl Iterator<Item = [i32; 3]>) -> i32 {
        let mut cells = BTreeSet::new();
        for [x, y, z] in voxels {
            for offset in 0..27 {
                let d = [offset % 3 - 1, offset / 3 % 3 - 1, offset / 9 - 1];
                cells.insert([2 * x + d[0], 2 * y + d[1], 2 * z + d[2]]);
            }
        }
        let dimension = |cell: &[i32; 3]| 3 - cell.iter().filter(|c| c.rem_euclid(2) == 1).count();
        cells.iter().map(|cell| if dimension(cell) % 2 == 0 { 1 } else { -1 }).sum()
    }

    fn voxels_of(neighborhood: u32) -> impl Iterator<Item = [i32; 3]> {
        (0..27).filter(move |bit| neighborhood >> bit & 1 == 1).map(|bit| [bit % 3, bit / 3 % 3, bit / 9])
    }

    #[test]
    fn change_is_that_of_the_counted_complex() {
        let mut stream = Stream::new(1, Purpose::Test, 0, 0);
        for _ in 0..3000 {
            let density = stream.next_u32();
            let neighborhood =
                (stream.next_u32() & stream.next_u32() | density & stream.next_u32()) & 0x07FF_FFFF;
            let with_center = euler_by_counting(voxels_of(neighborhood | CENTER));
            let without_center = euler_by_counting(voxels_of(neighborhood & !CENTER));
            let change = with_center - without_center;
            assert_eq!(euler_change(neighborhood), 8 * change, "{neighborhood:#x}");
            assert_eq!(EulerTable::get().is_invariant(neighborhood), change == 0, "{neighborhood:#x}");
        }
    }

    #[test]
    fn every_block_has_the_share_of_its_common_vertex() {
        // Inclusion–exclusion over the complex of one block: its 27 vertices see the block clipped to them.
        for block in 0_u8..=255 {
            let voxel = |bit: u8| [i32::from(bit & 1), i32::from(bit >> 1 & 1), i32::from(bit >> 2)];
            let mut sum = 0;
            for vertex in 0..27_i32 {
                let corner = [vertex % 3, vertex / 3 % 3, vertex / 9];
                let mut seen = 0_u8;
                for bit in (0..8).filter(|bit| block >> bit & 1 == 1) {
                    let v = voxel(bit);
                    let side: Option<u8> = (0..3).try_fold(0, |side, axis| match corner[axis] - v[axis] {
                        0 => Some(side | 1 << axis),
                        1 => Some(side),
                        _ => None,
                    });
                    seen |= side.map_or(0, |side| 1 << side);
                }
                sum += i32::from(EULER_OF_BLOCK[usize::from(seen)]);
            }
            let voxels = (0..8).filter(|bit| block >> bit & 1 == 1).map(voxel);
            assert_eq!(sum, 8 * euler_by_counting(voxels), "{block:#010b}");
        }
    }
}
