//! Thinning that loses nothing: level by level of depth, with tips that hold.
//!
//! **Input** a lattice. **Output** the same lattice with the skeleton left; the number of sweeps.
//! **Notation** a voxel is *due* at a level if its depth is no larger. A *tooth* is an end voxel whose one neighbour
//! has more than two. A *corner* is a voxel whose neighbours all lie in one 2×2×2 block with it.
//! **Steps** Bumps of a rough wall go ([`crate::rough`]). For each level, sweep over the voxels that are due until nothing changes; deeper ones are held. A voxel
//! goes if it is simple in the full sense (Euler invariant, one component of neighbours) and
//! 1. is no end voxel, or is a tooth;
//! 2. is no corner made by the sub-iteration itself.
//!
//! Then the tips are moved to where they belong ([`crate::tips`]), and branches that are missing come back
//! ([`crate::restore`]).
//!
//! **Guarantees** only simple voxels are deleted, one after the other, so components, tunnels and cavities stay, and
//! no component vanishes. A level peels all sides at the same speed, whatever their direction.
//! **Why** rule 1: thinning a ribbon in raster order frays its rim, and every thread would be kept as a branch, on real
//! airways more of them than there are branches. True tips are safe: their neighbour is part of a curve.
//! **Why** rule 2: raster order runs along a ribbon two voxels wide and eats it up from its end, which is how the
//! published rule loses bars of even width. A corner goes only in a later sub-iteration, so the end loses a voxel or
//! two while the ribbon becomes a curve.
//! **Why not** the published order without levels? Six faces a sweep, it takes more voxels a sweep from an oblique end
//! than from a flat side: wide tubes lose more than their width.
//! **Why not** parity classes in the recheck? They leave combs: ends that no branch has.
//! **Why not** keep an end by the slope of the depth along it? After rule 1 it changes almost nothing.
//! **Source** levels of distance: [Pudney1998].
//! **Cost** as [`crate::thinning`], and the depths; look-ups once more for every level.

use crate::depth::{Depths, UNITS_PER_SPACING};
use crate::euler::EulerTable;
use crate::lattice::Lattice;
use crate::open::Open;
use crate::restore;
use crate::rough;
use crate::simple::{is_corner, is_simple, n_neighbors};
use crate::thinning::{Rule, sweep_until_stable};
use crate::tips;

/// The step from one depth level to the next: a third of the smallest spacing, the grain of the 3-4-5 weights.
const LEVEL_STEP: u16 = (UNITS_PER_SPACING / 3.0) as u16;

/// Thins in place; returns the number of sweeps.
pub(crate) fn thin(lattice: &mut Lattice) -> usize {
    let depths = match rough::smooth(lattice) {
        Some(filled) => Depths::of(&filled).within(lattice),
        None => Depths::of(lattice),
    };
    let mut open = Open::held(lattice);
    let rule = Safe { euler: EulerTable::get() };
    let mut n_sweeps = 0;
    for level in depths.levels(LEVEL_STEP).into_iter().filter(|level| !level.is_empty()) {
        level.into_iter().for_each(|(word, bits)| open.release(lattice, word, bits));
        n_sweeps += sweep_until_stable(lattice, &mut open, &rule);
    }
    tips::settle(lattice, &depths);
    if restore::lost_branches(lattice, &depths) > 0 {
        // Where a branch begins, cells of the curve that it left may no longer be needed.
        n_sweeps += sweep_until_stable(lattice, &mut Open::border(lattice), &rule);
    }
    n_sweeps
}

/// The rule for the voxels that are due.
struct Safe {
    euler: &'static EulerTable,
}

impl Rule for Safe {
    fn collects(&self, lattice: &Lattice, cell: usize, neighborhood: u32) -> bool {
        self.lets_go(lattice, cell, neighborhood)
    }

    fn deletes(&self, lattice: &Lattice, cell: usize, frozen: u32, live: u32) -> bool {
        let has_lost = live != frozen;
        !(has_lost && is_corner(live)) && self.lets_go(lattice, cell, live)
    }
}

impl Safe {
    /// Whether a voxel is simple and no end of a curve.
    fn lets_go(&self, lattice: &Lattice, cell: usize, neighborhood: u32) -> bool {
        match n_neighbors(neighborhood) {
            0 => false,
            // Such a voxel is simple.
            1 => is_tooth(lattice, cell),
            _ => self.euler.is_invariant(neighborhood) && is_simple(neighborhood),
        }
    }
}

/// Whether the one neighbour of an end voxel has more than two.
fn is_tooth(lattice: &Lattice, end: usize) -> bool {
    lattice.neighbors(end).any(|base| n_neighbors(lattice.neighborhood(base)) > 2)
}
