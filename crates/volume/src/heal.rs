//! Tunnels that are no part of the organ, closed.
//!
//! **Input** the bits of a mask. **Output** the same with small changes, each of which closes a tunnel, and a ledger
//! entry for each.
//! **Notation** M the mask; S what a Gaussian blur of M and a threshold leave, and the pits of M; a patch is a
//! 26-connected piece of the voxels at which they differ; χ the Euler number, components − tunnels + cavities.
//! **Steps** 1. blur M by a Gaussian of σ = 0.7 voxel and cut at 0.45, at the voxels next to the surface: no other
//! can change. 2. Where the cut takes away more than a voxel's depth, or a piece that is all that joins two others,
//! it stands for a thin branch: put it back. 3. Fill pits. 4. Of the patches take those that raise χ; at one voxel from
//! each other they cannot meet in a 2×2×2 block, so their effects add up. 5. Leave out any that touch two components,
//! and take back any that cut one in two.
//! **Why not S itself?** Ends of thin branches vanish in it. A patch that changes no tunnel is left out, so they stay, and
//! as many tunnels close.
//! **Guarantees** no component is cut, and none joined with another; a mask without tunnels stays as it is; the result
//! does not depend on the number of threads.
//! **Differs from the source** the blur and its threshold are usual; taking only the patches that matter is ours.
//! **Cost** 25 look-ups for each voxel next to the surface; memory of four masks and the runs of two.

mod blur;
mod pits;

use espalier_model::{Bits, EULER_OF_BLOCK, Grid, LedgerEntry, LedgerKind};
use glam::DVec3;
use rayon::prelude::*;

use crate::runs::{Components, Connectivity, Run, Runs};
use blur::blur;

/// The most patches that the ledger lists one by one.
const MAX_LISTED: usize = 2000;

/// What was done to a mask.
#[derive(Default)]
pub(crate) struct Healed {
    pub(crate) n_patches: usize,
    pub(crate) n_filled: usize,
    pub(crate) n_cleared: usize,
    pub(crate) entries: Vec<LedgerEntry>,
}

impl Healed {
    /// Adds what was done afterwards.
    pub(crate) fn add(&mut self, later: Self) {
        self.n_patches += later.n_patches;
        self.n_filled += later.n_filled;
        self.n_cleared += later.n_cleared;
        self.entries.extend(later.entries);
    }
}

/// Closes tunnels of a mask.
pub(crate) fn heal(mask: &mut Bits, grid: &Grid) -> Healed {
    let mut smooth = blur(mask);
    keep_branches(mask, &mut smooth);
    pits::fill(mask, pits::coarse_axis(grid.spacing_mm().to_array()), &mut smooth);
    let patches = Patches::between(mask, &smooth);
    let mut is_taken = patches.raise_euler_number(mask);
    patches.leave_apart(mask, &mut is_taken);
    patches.apply(mask, &is_taken);
    let cut = patches.that_part(mask, &is_taken);
    patches.apply(mask, &cut);
    is_taken.iter_mut().zip(&cut).for_each(|(taken, &cut)| *taken &= !cut);
    patches.record(mask, grid, &is_taken)
}

/// Puts back into `smooth` what it has lost of thin branches.
fn keep_branches(mask: &Bits, smooth: &mut Bits) {
    let mut lost = mask.clone();
    lost.words_mut().iter_mut().zip(smooth.words()).for_each(|(lost, kept)| *lost &= !kept);
    let lost = Runs::cut(&lost);
    let pieces = lost.components(Connectivity::All);
    let kept = Runs::cut(smooth);
    let bodies = kept.components(Connectivity::All);
    let mut is_branch = pieces_that_join(&lost, &pieces, &kept, &bodies, true);
    for row in 0..lost.n_rows() {
        for run in lost.of_row(row) {
            is_branch[pieces.of_run[run]] |= is_deep(smooth, row, lost.all()[run]);
        }
    }
    for row in 0..lost.n_rows() {
        for run in lost.of_row(row).filter(|&run| is_branch[pieces.of_run[run]]) {
            smooth.fill_run(row, lost.all()[run].range());
        }
    }
}

/// Whether a voxel of a run is not even a neighbour of what is left.
fn is_deep(smooth: &Bits, row: usize, run: Run) -> bool {
    let ny = smooth.shape()[1];
    let (y, z) = ((row % ny) as i64, (row / ny) as i64);
    run.range().any(|x| {
        let mut about = (0..27).map(|i| [x as i64 + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1]);
        !about.any(|voxel| smooth.contains(voxel))
    })
}

/// For each piece, whether it touches more than one body; with `or_none`, also whether it touches none.
fn pieces_that_join(
    runs: &Runs,
    pieces: &Components,
    other: &Runs,
    bodies: &Components,
    or_none: bool,
) -> Vec<bool> {
    const NONE: usize = usize::MAX;
    const SEVERAL: usize = usize::MAX - 1;
    let mut touched = vec![NONE; pieces.n_components];
    for row in 0..runs.n_rows() {
        for run_idx in runs.of_row(row) {
            let run = runs.all()[run_idx];
            let touched = &mut touched[pieces.of_run[run_idx]];
            for body in runs.rows_about(row).flat_map(|row| other.touching(row, run)) {
                let body = bodies.of_run[body];
                *touched = if *touched == NONE || *touched == body { body } else { SEVERAL };
            }
        }
    }
    touched.iter().map(|&touched| touched == SEVERAL || or_none && touched == NONE).collect()
}

/// The pieces of what two masks differ in.
struct Patches {
    runs: Runs,
    pieces: Components,
}

impl Patches {
    fn between(mask: &Bits, smooth: &Bits) -> Self {
        let mut differs = mask.clone();
        differs.words_mut().iter_mut().zip(smooth.words()).for_each(|(bits, other)| *bits ^= other);
        let runs = Runs::cut(&differs);
        let pieces = runs.components(Connectivity::All);
        Self { runs, pieces }
    }

    /// The patches that raise the mask's Euler number.
    fn raise_euler_number(&self, mask: &Bits) -> Vec<bool> {
        let ny = mask.shape()[1];
        let mut vertices: Vec<(usize, [i64; 3])> = Vec::new();
        for row in 0..self.runs.n_rows() {
            let (y, z) = ((row % ny) as i64, (row / ny) as i64);
            for run in self.runs.of_row(row) {
                let piece = self.pieces.of_run[run];
                let range = self.runs.all()[run].range();
                let along = range.start as i64..=range.end as i64;
                let ends = [[y, z], [y + 1, z], [y, z + 1], [y + 1, z + 1]];
                vertices.extend(along.flat_map(|x| ends.map(|[y, z]| (piece, [x, y, z]))));
            }
        }
        vertices.par_sort_unstable();
        vertices.dedup();
        let mut rise = vec![0_i64; self.pieces.n_components];
        let differs = self.to_bits(mask.shape());
        for (piece, vertex) in vertices {
            let (before, flipped) = (block(mask, vertex), block(&differs, vertex));
            rise[piece] += i64::from(EULER_OF_BLOCK[before ^ flipped] - EULER_OF_BLOCK[before]);
        }
        rise.iter().map(|&rise| rise > 0).collect()
    }

    /// Of the patches that are taken, leaves out those that touch more than one component of the mask.
    fn leave_apart(&self, mask: &Bits, is_taken: &mut [bool]) {
        let before = Runs::cut(mask);
        let bodies = before.components(Connectivity::All);
        if bodies.n_components > 1 {
            let joins = pieces_that_join(&self.runs, &self.pieces, &before, &bodies, false);
            is_taken.iter_mut().zip(joins).for_each(|(taken, joins)| *taken &= !joins);
        }
    }

    fn to_bits(&self, shape: [usize; 3]) -> Bits {
        let mut bits = Bits::new(shape);
        for row in 0..self.runs.n_rows() {
            self.runs.row(row).iter().for_each(|run| bits.fill_run(row, run.range()));
        }
        bits
    }

    /// Flips the voxels of the patches that are taken.
    fn apply(&self, mask: &mut Bits, is_taken: &[bool]) {
        let ny = mask.shape()[1];
        for row in 0..self.runs.n_rows() {
            for run in self.runs.of_row(row).filter(|&run| is_taken[self.pieces.of_run[run]]) {
                for x in self.runs.all()[run].range() {
                    let voxel = [x, row % ny, row / ny];
                    if mask.get(voxel) { mask.clear(voxel) } else { mask.set(voxel) }
                }
            }
        }
    }

    /// Of the patches that are taken, those that touch more than one component of the mask as it is now, or none.
    fn that_part(&self, mask: &Bits, is_taken: &[bool]) -> Vec<bool> {
        let now = Runs::cut(mask);
        let bodies = now.components(Connectivity::All);
        let mut parts = pieces_that_join(&self.runs, &self.pieces, &now, &bodies, true);
        parts.iter_mut().zip(is_taken).for_each(|(parts, taken)| *parts &= taken);
        parts
    }

    /// Counts and lists the patches that were taken.
    fn record(&self, mask: &Bits, grid: &Grid, is_taken: &[bool]) -> Healed {
        let ny = mask.shape()[1];
        // Voxels filled, cleared, and the sum of their coordinates.
        let mut sums = vec![(0_usize, 0_usize, DVec3::ZERO); self.pieces.n_components];
        for row in 0..self.runs.n_rows() {
            for run in self.runs.of_row(row) {
                let (filled, cleared, sum) = &mut sums[self.pieces.of_run[run]];
                for x in self.runs.all()[run].range() {
                    let is_filled = mask.get([x, row % ny, row / ny]);
                    *filled += usize::from(is_filled);
                    *cleared += usize::from(!is_filled);
                    *sum += DVec3::new(x as f64, (row % ny) as f64, (row / ny) as f64);
                }
            }
        }
        let taken: Vec<_> =
            sums.iter().zip(is_taken).filter(|(_, taken)| **taken).map(|(sum, _)| *sum).collect();
        let entry = |&(filled, cleared, sum): &(usize, usize, DVec3)| LedgerEntry {
            kind: LedgerKind::TunnelClosed,
            position_mm: grid.world_from_voxel().transform_point3(sum / (filled + cleared) as f64),
            radius_mm: 0.0,
            length_mm: 0.0,
            reason: format!(
                "{filled} voxels filled, {cleared} cleared; a blur of 0.7 voxel, or filling its pits, closes it"
            ),
        };
        let mut entries: Vec<LedgerEntry> = taken.iter().take(MAX_LISTED).map(entry).collect();
        if taken.len() > MAX_LISTED {
            let rest = taken[MAX_LISTED..]
                .iter()
                .fold((0, 0, DVec3::ZERO), |all, one| (all.0 + one.0, all.1 + one.1, all.2 + one.2));
            let n_rest = taken.len() - MAX_LISTED;
            let mut all = entry(&rest);
            all.reason = format!("{n_rest} further places: {}", all.reason);
            entries.push(all);
        }
        Healed {
            n_patches: taken.len(),
            n_filled: taken.iter().map(|sum| sum.0).sum(),
            n_cleared: taken.iter().map(|sum| sum.1).sum(),
            entries,
        }
    }
}

/// The eight voxels about a vertex, the one with the lowest coordinates being voxel `vertex` − 1.
fn block(bits: &Bits, [x, y, z]: [i64; 3]) -> usize {
    let of = |i: i64| bits.contains([x - 1 + i % 2, y - 1 + i / 2 % 2, z - 1 + i / 4]);
    (0..8).fold(0, |block, i| block | usize::from(of(i)) << i)
}

#[cfg(test)]
mod tests {
    use espalier_model::Grid;

    use super::*;
    use crate::euler::euler_number;
    use crate::flood::random_bits;

    fn grid(bits: &Bits) -> Grid {
        Grid::axis_aligned(bits.shape(), DVec3::ONE, DVec3::ZERO).expect("legal")
    }

    #[test]
    fn random_masks_gain_no_tunnel_and_keep_their_components() {
        let components = |bits: &Bits| Runs::cut(bits).components(Connectivity::All).n_components;
        let mut n_closed = 0;
        for case in 0..1500 {
            let before = random_bits(case);
            let mut after = before.clone();
            let healed = heal(&mut after, &grid(&before));
            assert_eq!(components(&after), components(&before), "case {case}");
            assert!(euler_number(&after) >= euler_number(&before), "case {case}");
            assert_eq!(healed.entries.len(), healed.n_patches);
            n_closed += healed.n_patches;
        }
        assert!(n_closed > 50, "{n_closed}");
    }

    /// A plate with a hole of nine voxels about another component, and a pinhole at its corner: filled together, both
    /// tunnels are closed and the components joined. The Euler number rises all the same.
    #[test]
    fn a_patch_that_joins_components_is_left_out() {
        let mut plate = Bits::new([12, 10, 3]);
        (1..9).for_each(|y| plate.fill_run(10 + y, 1..11));
        let smooth = plate.clone();
        (3..6).for_each(|y| plate.clear_run(10 + y, 3..6));
        plate.set([4, 4, 1]);
        plate.clear([6, 6, 1]);
        let patches = Patches::between(&plate, &smooth);
        let mut is_taken = patches.raise_euler_number(&plate);
        assert_eq!(is_taken, [true]);
        patches.leave_apart(&plate, &mut is_taken);
        assert_eq!(is_taken, [false]);
        // Without the component in the hole there is nothing to join.
        plate.clear([4, 4, 1]);
        let patches = Patches::between(&plate, &smooth);
        let mut is_taken = patches.raise_euler_number(&plate);
        patches.leave_apart(&plate, &mut is_taken);
        assert_eq!(is_taken, [true]);
    }

    /// A branch one slice thick, as on thick slices, in which a voxel is missing: a blur leaves the hole.
    #[test]
    fn a_hole_in_a_single_slice_closes() {
        let mut slice = Bits::new([40, 9, 3]);
        (2..7).for_each(|y| slice.fill_run(9 + y, 2..38));
        let whole = slice.clone();
        slice.clear([20, 4, 1]);
        let healed = heal(&mut slice, &grid(&whole));
        assert_eq!((healed.n_patches, healed.n_filled, healed.n_cleared), (1, 1, 0));
        assert_eq!(slice, whole);
    }

    #[test]
    fn a_pinhole_closes_and_a_ring_stays() {
        let mut plate = Bits::new([70, 9, 4]);
        (0..18).for_each(|row| plate.fill_run(9 + row, 58..68));
        plate.clear([63, 4, 1]);
        plate.clear([63, 4, 2]);
        let healed = heal(&mut plate.clone(), &grid(&plate));
        assert_eq!((healed.n_patches, healed.n_filled, healed.n_cleared), (1, 2, 0));
        assert_eq!(healed.entries[0].position_mm, DVec3::new(63.0, 4.0, 1.5));

        // A ring of one voxel's width about a hole of five: a vessel that runs in a circle, not a fault.
        let mut ring = Bits::new([9, 9, 3]);
        (1..8).for_each(|y| ring.fill_run(9 + y, 1..8));
        (2..7).for_each(|y| ring.clear_run(9 + y, 2..7));
        let before = ring.clone();
        assert_eq!(heal(&mut ring, &grid(&before)).n_patches, 0);
        assert_eq!(ring, before);
    }
}
