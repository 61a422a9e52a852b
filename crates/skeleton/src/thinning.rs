//! Thinning to a curve skeleton by six directional sub-iterations a sweep.
//!
//! **Input** a lattice. **Output** the same lattice with the skeleton left; the number of sweeps.
//! **Notation** d the direction of a sub-iteration; a voxel is *border* for d if v + d is background.
//! **Steps** Sweep until nothing is deleted; in each sweep, for each of the six d:
//! 1. Collect, with the volume frozen and in raster order, the border voxels that the rule lets go.
//! 2. Recheck them with the volume live, in the same order, and delete those that it still lets go.
//!
//! The rules: [`Lee94`] as published, over all voxels at once; [`crate::safe`], level by level of depth.
//!
//! **Guarantees** a fixed order, so one result.
//! **Source** [Lee94] section 5; direction order as in scikit-image and ITK.
//! **Differs from the source** in speed alone: [`crate::open`] names the voxels to look at, and a voxel about which
//! nothing changed since it was collected need not be asked again.
//! **Cost** O(foreground) predicates; O(active words) look-ups a sub-iteration.

use crate::euler::EulerTable;
use crate::lattice::Lattice;
use crate::open::{Direction, Open};
use crate::params::Thinning;
use crate::safe;
use crate::simple::{is_endpoint, is_simple};

/// Thins in place; returns the number of sweeps.
pub(crate) fn thin(lattice: &mut Lattice, thinning: Thinning) -> usize {
    match thinning {
        Thinning::Lee94 => {
            let mut open = Open::border(lattice);
            sweep_until_stable(lattice, &mut open, &Lee94 { euler: EulerTable::get() })
        }
        Thinning::Safe => safe::thin(lattice),
    }
}

/// What may be deleted.
pub(crate) trait Rule {
    /// Whether the frozen volume lets a voxel go.
    fn collects(&self, lattice: &Lattice, cell: usize, neighborhood: u32) -> bool;

    /// Whether the live volume lets a collected voxel go, whose neighbourhood was `frozen` and is `live`.
    fn deletes(&self, lattice: &Lattice, cell: usize, frozen: u32, live: u32) -> bool;
}

/// The published rule.
struct Lee94 {
    euler: &'static EulerTable,
}

impl Rule for Lee94 {
    fn collects(&self, _: &Lattice, _: usize, neighborhood: u32) -> bool {
        !is_endpoint(neighborhood) && self.euler.is_invariant(neighborhood) && is_simple(neighborhood)
    }

    /// The recheck asks for simplicity alone, as published.
    fn deletes(&self, _: &Lattice, _: usize, frozen: u32, live: u32) -> bool {
        live == frozen || is_simple(live)
    }
}

/// Repeats the six sub-iterations until none of them deletes a voxel; returns the number of sweeps.
pub(crate) fn sweep_until_stable(lattice: &mut Lattice, open: &mut Open, rule: &impl Rule) -> usize {
    let mut collected = Vec::new();
    let mut n_sweeps = 0;
    loop {
        n_sweeps += 1;
        let mut n_deleted = 0;
        for direction in Direction::all(lattice) {
            collect(lattice, open, direction, rule, &mut collected);
            n_deleted += recheck(lattice, open, rule, &collected);
        }
        if n_deleted == 0 {
            return n_sweeps;
        }
    }
}

/// The border voxels that the frozen volume lets go, with their neighbourhoods, in raster order.
fn collect(
    lattice: &Lattice,
    open: &mut Open,
    direction: Direction,
    rule: &impl Rule,
    collected: &mut Vec<(usize, u32)>,
) {
    collected.clear();
    open.ask(lattice, direction, |cell| {
        let neighborhood = lattice.neighborhood(cell);
        let is_collected = rule.collects(lattice, cell, neighborhood);
        if is_collected {
            collected.push((cell, neighborhood));
        }
        is_collected
    });
}

/// Deletes what the live volume lets go; returns the number.
fn recheck(lattice: &mut Lattice, open: &mut Open, rule: &impl Rule, collected: &[(usize, u32)]) -> usize {
    let mut n_deleted = 0;
    for &(cell, frozen) in collected {
        if rule.deletes(lattice, cell, frozen, lattice.neighborhood(cell)) {
            lattice.delete(cell);
            open.add_around(lattice, cell);
            n_deleted += 1;
        }
    }
    n_deleted
}
