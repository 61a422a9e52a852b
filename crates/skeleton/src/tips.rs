//! Gives tips back what thinning took too much.
//!
//! **Input** a thinned lattice and the depths of the mask. **Output** the lattice with its curve ends prolonged.
//! **Notation** t a tip (one skeleton neighbour); q a mask voxel beside it; h its heading, from the skeleton voxel
//! [`HEADING_VOXELS`] before it.
//! **Steps** For each tip, in raster order, at most [`MAX_VOXELS`] times: among the q that touch the skeleton in t
//! alone, within 60° of h, and less than [`LEEWAY`] shallower than the tip was, add the deepest (then the
//! straightest, then the first); q is the tip now.
//! **Guarantees** q touches the skeleton in one voxel that had one neighbour, so adding it changes no topology
//! and makes no end. In a tube all axis voxels are equally deep up to a radius before its end, so a tip is moved up
//! to there; along a spur the depth falls outward, so it stays as it is.
//! **Cost** O(ends).

use crate::depth::{Depths, UNITS_PER_SPACING};
use crate::lattice::Lattice;
use crate::simple::{is_endpoint, n_neighbors};

/// Sub-iterations of the last sweeps take one or two voxels of an oblique tip: no tube of width 1–9 lost more.
const MAX_VOXELS: usize = 3;
/// How much less deep than the tip the voxels beyond it may be, in spacings: of 445 tubes of even and odd width, the
/// worst ends 0.6 voxel short with 0.5, none with 0.7; a spur loses a whole spacing a voxel.
const LEEWAY: f64 = 0.7;
/// How far back the heading looks: far enough to smooth a staircase, near enough for a bend.
const HEADING_VOXELS: usize = 4;
/// Cosine of the widest turn that a prolonged tip may take.
const MIN_COSINE: f64 = 0.5;

/// Prolongs all tips; returns the number of voxels added.
pub(crate) fn regrow(lattice: &mut Lattice, depths: &Depths) -> usize {
    let mut n_added = 0;
    let tips: Vec<usize> =
        lattice.foreground().filter(|&cell| is_endpoint(lattice.neighborhood(cell))).collect();
    for tip in tips {
        let Some(heading) = heading(lattice, tip) else { continue };
        let least_depth = f64::from(depths.at(tip)) - LEEWAY * UNITS_PER_SPACING;
        let mut end = tip;
        for _ in 0..MAX_VOXELS {
            let Some(next) = continuation(lattice, depths, end, heading, least_depth) else { break };
            lattice.add(next);
            n_added += 1;
            end = next;
        }
    }
    n_added
}

/// The unit vector out of the tip, in mm along the lattice's axes; `None` for a curve that closes on itself.
fn heading(lattice: &Lattice, tip: usize) -> Option<[f64; 3]> {
    let (mut before, mut current) = (tip, tip);
    for _ in 0..HEADING_VOXELS {
        // At a junction the curve is no longer one: the heading ends before it.
        let mut onward = lattice.neighbors(current).filter(|&cell| cell != before);
        let Some(next) = onward.next() else { break };
        if onward.next().is_some() {
            break;
        }
        (before, current) = (current, next);
    }
    direction(lattice, current, tip)
}

fn direction(lattice: &Lattice, from: usize, to: usize) -> Option<[f64; 3]> {
    let (a, b, spacing) = (lattice.coordinates(from), lattice.coordinates(to), lattice.spacing());
    let step = [0, 1, 2].map(|axis| (b[axis] as f64 - a[axis] as f64) * spacing[axis]);
    let length = dot(step, step).sqrt();
    (length > 0.0).then(|| step.map(|component| component / length))
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The voxel that best prolongs the curve beyond `end`.
fn continuation(
    lattice: &Lattice,
    depths: &Depths,
    end: usize,
    heading: [f64; 3],
    least_depth: f64,
) -> Option<usize> {
    lattice
        .surroundings(end)
        .filter(|&cell| {
            let is_mask = depths.at(cell) > 0 && !lattice.is_foreground(cell);
            is_mask
                && f64::from(depths.at(cell)) >= least_depth
                && n_neighbors(lattice.neighborhood(cell)) == 1
        })
        .filter_map(|cell| direction(lattice, end, cell).map(|step| (cell, dot(step, heading))))
        .filter(|&(_, cosine)| cosine >= MIN_COSINE)
        .max_by(|a, b| depths.at(a.0).cmp(&depths.at(b.0)).then(a.1.total_cmp(&b.1)).then(b.0.cmp(&a.0)))
        .map(|(cell, _)| cell)
}
