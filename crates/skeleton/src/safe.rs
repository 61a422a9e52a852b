//! Thinning that loses nothing: level by level of depth, with tips that hold.
//!
//! **Input** a lattice. **Output** the same lattice with the skeleton left; the number of sweeps.
//! **Notation** a voxel is *due* at a level if its depth is no larger. A *tooth* is an end voxel whose one neighbour
//! has more than two. A *corner* is a voxel whose neighbours all lie in one 2×2×2 block with it.
//! **Steps** For each level, sweep over the voxels that are due until nothing changes. A voxel goes if it is simple in
//! the full sense (Euler invariant, one component of neighbours) and
//! 1. is no end voxel, or is a tooth;
//! 2. is no corner made by the sub-iteration itself.
//!
//! Then the tips are moved to where they belong ([`crate::tips`]).
//!
//! **Guarantees** only simple voxels are deleted, one after the other, so components, tunnels and cavities stay, and
//! no component vanishes. A level peels all sides at the same speed, whatever their direction.
//! **Why** rule 1: thinning a ribbon in raster order frays its rim, and every thread would be kept as a branch. With
//! it, real airways have 43–47 ends for 39–48 of `lee94`, and without it 69–76; tubes have two ends each. Tips of true
//! branches are safe: their neighbour is part of a curve. Of 3641 tips of two phantom trees, `lee94` finds
//! 95.7 %, this rule 99.7 %.
//! **Why** rule 2: raster order runs along a ribbon two voxels wide and eats it up from its end, which is how the
//! published rule loses bars of even width. A corner is let go only by a later sub-iteration, so the end loses a voxel
//! while the ribbon becomes a curve. Without it, twigs two voxels wide lose their tips (98.6 %).
//! **Why not** the published order without levels? Six faces a sweep, it takes 1.4 voxels a sweep from an oblique end
//! and 1 from a flat side: tubes of width 9 lost 4 voxels more than their width.
//! **Why not** parity classes in the recheck? They leave combs: up to 2.4 times the ends of `lee94` on real airways.
//! **Why not** keep an end by the slope of the depth along it? Measured too: after rule 1 it changes almost nothing.
//! **Source** levels of distance: [Pudney1998].
//! **Cost** as [`crate::thinning`], and the depths; look-ups once more for every level.

use std::collections::BTreeMap;

use crate::depth::{Depths, UNITS_PER_SPACING};
use crate::euler::EulerTable;
use crate::lattice::Lattice;
use crate::open::{Answer, Open};
use crate::simple::{is_corner, is_simple, n_neighbors};
use crate::thinning::{Rule, sweep_until_stable};
use crate::tips;

/// The step from one depth level to the next: a third of the smallest spacing, the grain of the 3-4-5 weights.
const LEVEL_STEP: u16 = (UNITS_PER_SPACING / 3.0) as u16;

/// Thins in place; returns the number of sweeps.
pub(crate) fn thin(lattice: &mut Lattice) -> usize {
    let mut open = Open::border(lattice);
    let mut rule = Safe {
        euler: EulerTable::get(),
        depths: Depths::of(lattice),
        level: LEVEL_STEP,
        waiting: BTreeMap::new(),
    };
    let mut n_sweeps = 0;
    loop {
        n_sweeps += sweep_until_stable(lattice, &mut open, &mut rule);
        let Some((level, cells)) = rule.waiting.pop_first() else { break };
        rule.level = level;
        cells.into_iter().for_each(|cell| open.release(cell));
    }
    tips::settle(lattice, &rule.depths);
    n_sweeps
}

/// The rule at one level.
struct Safe {
    euler: &'static EulerTable,
    depths: Depths,
    level: u16,
    /// Border voxels that are deeper, by the level at which they are due.
    waiting: BTreeMap<u16, Vec<usize>>,
}

impl Rule for Safe {
    fn collects(&mut self, lattice: &Lattice, cell: usize) -> Answer {
        let depth = self.depths.at(cell);
        if depth > self.level {
            let level = depth.div_ceil(LEVEL_STEP).saturating_mul(LEVEL_STEP);
            self.waiting.entry(level).or_default().push(cell);
            return Answer::Waits;
        }
        let neighborhood = lattice.neighborhood(cell);
        if self.lets_go(lattice, cell, neighborhood) { Answer::Goes(neighborhood) } else { Answer::Stays }
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
