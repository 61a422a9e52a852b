//! What the 26 neighbours of a voxel say about it.
//!
//! **Input** a neighbourhood: 27 bits, bit 9·(dz+1) + 3·(dy+1) + (dx+1); the centre is bit 13.
//! **Output** end point? one component of neighbours?
//! **Steps** 1. Start from the lowest neighbour. 2. Grow by one voxel in all 26 directions at once, by shifts,
//! inside the neighbours, until it stops. 3. One component exactly if all neighbours were reached.
//! **Guarantees** a voxel with Euler change 0 and one component of neighbours is simple in the full sense: it
//! meets the rest in a set with b₀ = 1 and b₀ − b₁ + b₂ = 1, and b₂ = 1 only where all 26 neighbours are there
//! and b₁ = 0. Removing it alters no component, tunnel or cavity.
//! **Source** [Lee94] section 4; flood by shifts in place of its octree labels, with the same answer.
//! **Cost** at most 13 growing steps of a few instructions.

/// The bit of the voxel itself.
pub(crate) const CENTER: u32 = 1 << 13;

const X_LOW: u32 = 0o111_111_111;
const X_HIGH: u32 = X_LOW << 2;
const Y_LOW: u32 = 0o007_007_007;
const Y_HIGH: u32 = Y_LOW << 6;
const Z_LOW: u32 = 0o777;
const Z_HIGH: u32 = Z_LOW << 18;

/// The number of foreground neighbours.
pub(crate) fn n_neighbors(neighborhood: u32) -> u32 {
    (neighborhood & !CENTER).count_ones()
}

/// Whether the voxel is the end of a curve: it has exactly one neighbour.
pub(crate) fn is_endpoint(neighborhood: u32) -> bool {
    n_neighbors(neighborhood) == 1
}

/// Whether all neighbours lie in one 2×2×2 block with the voxel.
pub(crate) fn is_corner(neighborhood: u32) -> bool {
    [(X_LOW, X_HIGH), (Y_LOW, Y_HIGH), (Z_LOW, Z_HIGH)]
        .iter()
        .all(|(low, high)| neighborhood & low == 0 || neighborhood & high == 0)
}

/// Whether the neighbours form at most one 26-connected component.
pub(crate) fn is_simple(neighborhood: u32) -> bool {
    let neighbors = neighborhood & !CENTER;
    let mut reached = neighbors & neighbors.wrapping_neg();
    while reached != neighbors {
        let grown = grow(reached) & neighbors;
        if grown == reached {
            return false;
        }
        reached = grown;
    }
    true
}

/// A set of bits and all their 26 neighbours inside the 3×3×3 block.
fn grow(bits: u32) -> u32 {
    let along_x = bits | (bits & !X_HIGH) << 1 | (bits & !X_LOW) >> 1;
    let along_y = along_x | (along_x & !Y_HIGH) << 3 | (along_x & !Y_LOW) >> 3;
    // Bits beyond the 27th stand for no voxel; the caller masks them.
    along_y | along_y << 9 | along_y >> 9
}

#[cfg(test)]
mod tests {
    use espalier_geom::random::{Purpose, Stream};

    use super::*;

    fn components_by_search(neighbors: u32) -> usize {
        let voxel = |bit: i32| [bit % 3, bit / 3 % 3, bit / 9];
        let touch = |a: i32, b: i32| (0..3).all(|axis| (voxel(a)[axis] - voxel(b)[axis]).abs() <= 1);
        let mut left: Vec<i32> = (0..27).filter(|bit| neighbors >> bit & 1 == 1).collect();
        let mut n_components = 0;
        while let Some(seed) = left.pop() {
            n_components += 1;
            let mut stack = vec![seed];
            while let Some(current) = stack.pop() {
                let (near, far) = left.iter().partition(|&&other| touch(current, other));
                left = far;
                stack.extend::<Vec<i32>>(near);
            }
        }
        n_components
    }

    #[test]
    fn a_corner_has_its_neighbors_on_one_side_of_each_axis() {
        let bit = |d: [i32; 3]| 1_u32 << (13 + d[0] + 3 * d[1] + 9 * d[2]);
        assert!(is_corner(CENTER) && is_corner(bit([1, 0, 0]) | bit([1, -1, 1]) | bit([0, -1, 0])));
        for axis in 0..3 {
            let (mut low, mut high) = ([0; 3], [1; 3]);
            (low[axis], high[axis]) = (-1, 1);
            assert!(!is_corner(bit(low) | bit(high)), "axis {axis}");
        }
    }

    #[test]
    fn one_component_means_what_a_search_says() {
        let mut stream = Stream::new(2, Purpose::Test, 0, 0);
        assert!(is_simple(0) && is_simple(CENTER));
        for _ in 0..5000 {
            let mut bits = stream.next_u32() & stream.next_u32() & 0x07FF_FFFF;
            if stream.below(2) == 0 {
                bits &= stream.next_u32();
            }
            assert_eq!(is_simple(bits), components_by_search(bits & !CENTER) <= 1, "{bits:#x}");
        }
    }
}
