//! Spurs: short terminal branches that thinning grew on bumps of the surface, and branches inside of others.
//!
//! **Input** a graph without cycles. **Output** the same without spurs; a ledger entry for each.
//! **Steps** 1. A terminal branch is a spur if it is shorter than `prune_factor` × the radius at its fork, or than
//! `prune_min_mm`; or if it winds, being less than twice that long, without getting that far from its fork. A stub
//! of an opened loop must be `STUB_FACTOR` times as long to stay: most of them are holes in a wall. However long, a
//! branch is redundant if it runs in the lumen of others (see [`redundant`](crate::redundant)). 2. Take the
//! shortest spur away. 3. If two branches are left at its fork, they are one branch now, with their joint length.
//! 4. Again, until there is no spur.
//! **Guarantees** at least two branches stay at every fork that was one; the root of the user's policy stays, and cut-off
//! vessels do unless redundant; the result does not depend on the order of the voxels but for exact ties, which go to
//! the lower hub index.
//! **Cost** O(B log B) in branches, and what `redundant` takes.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use espalier_model::{Ledger, LedgerEntry, LedgerKind, Mask};

use crate::graph::Sample;
use crate::living::Living;
use crate::params::Params;
use crate::redundant::Spheres;
use crate::root::Protection;

/// How much longer than other terminal branches a stub of an opened loop must be.
const STUB_FACTOR: f64 = 2.0;
/// A branch of at most this multiple of the limit may be a spur that winds.
const WINDING: f64 = 2.0;

/// Prunes all spurs and redundant branches whose tips are not protected; returns how many there were. The mask tells walls.
pub(crate) fn prune(
    living: &mut Living<'_>,
    protection: &[Protection],
    (mask, params): (&Mask, &Params),
    ledger: &mut Ledger,
) -> usize {
    if params.prune_factor <= 0.0 && params.prune_min_mm <= 0.0 {
        return 0;
    }
    let spheres = Spheres::of(living);
    let mut n_pruned = 0;
    // Lengths are at least 0, so their bits order as they do.
    let mut shortest_first = BinaryHeap::new();
    for tip in living.tips() {
        if let Some((run, _)) = living.run_at_tip(tip) {
            shortest_first.push(Reverse((run.length_mm.to_bits(), tip)));
        }
    }
    while let Some(Reverse((length_bits, tip))) = shortest_first.pop() {
        if living.degree(tip) != 1 || protection[tip] == Protection::Root {
            continue;
        }
        let Some((run, fork)) = living.run_at_tip(tip) else { continue };
        let is_outdated = run.length_mm.to_bits() != length_bits;
        if is_outdated || living.degree(fork) < 3 {
            continue;
        }
        let Some(reason) =
            reason_to_prune(living, (tip, fork), run.length_mm, protection[tip], (&spheres, mask, params))
        else {
            continue;
        };
        let Sample { position_mm, radius_mm } = living.graph.hubs[tip].sample;
        let kind = LedgerKind::SpurPruned;
        ledger.0.push(LedgerEntry { kind, position_mm, radius_mm, length_mm: run.length_mm, reason });
        living.remove_at_tip(tip);
        n_pruned += 1;
        // If the fork dissolved, branches that ended there are longer now: look at them again.
        if living.degree(fork) == 2 {
            let Some(run) = living.run_through(fork) else { continue };
            for end in run.ends.into_iter().filter(|&end| living.degree(end) == 1) {
                shortest_first.push(Reverse((run.length_mm.to_bits(), end)));
            }
        }
    }
    n_pruned
}

/// Why the branch from a fork to a tip is to go; `None` if it is to stay.
fn reason_to_prune(
    living: &mut Living<'_>,
    (tip, fork): (usize, usize),
    length_mm: f64,
    protection: Protection,
    (spheres, mask, params): (&Spheres, &Mask, &Params),
) -> Option<String> {
    let fork_radius_mm = living.graph.hubs[fork].sample.radius_mm;
    let stub_factor = if living.graph.hubs[tip].is_stub { STUB_FACTOR } else { 1.0 };
    let limit_mm = stub_factor * (params.prune_factor * fork_radius_mm).max(params.prune_min_mm);
    if protection == Protection::Free && is_spur(living, tip, length_mm, limit_mm) {
        return Some(format!(
            "terminal branch of {length_mm:.3} mm at a fork of radius {fork_radius_mm:.3} mm; the limit there is {limit_mm:.3} mm"
        ));
    }
    let redundant = spheres.redundant_at(living, tip, mask)?;
    if redundant.n_beyond == 0 {
        return Some(format!(
            "terminal branch of {length_mm:.3} mm inside of its fork's radius of {fork_radius_mm:.3} mm, its tip in the sphere of a twin at the border of the scan"
        ));
    }
    let beside = match redundant.n_beside {
        0 => String::new(),
        n_beside => format!(", {n_beside} beside them with no wall between"),
    };
    Some(format!(
        "terminal branch of {length_mm:.3} mm in the lumen of others: beyond its fork's radius of {fork_radius_mm:.3} mm, {} of {} places are inside their spheres{beside}",
        redundant.n_inside, redundant.n_beyond
    ))
}

/// Whether the branch at a tip is shorter than the limit, or winds without leaving it.
fn is_spur(living: &Living<'_>, tip: usize, length_mm: f64, limit_mm: f64) -> bool {
    // Where two tubes part at a small angle, sphere centres jump between their axes: the branch is longer than it
    // leads. Twice the limit bounds the walk.
    if length_mm < limit_mm || length_mm >= WINDING * limit_mm {
        return length_mm < limit_mm;
    }
    let Some(piece) = living.pieces_at(tip).next() else { return false };
    let (branch, fork, _) = living.branch_from(tip, piece);
    let fork_mm = living.graph.hubs[fork].sample.position_mm;
    branch.iter().all(|s| s.position_mm.distance(fork_mm) < limit_mm)
}
