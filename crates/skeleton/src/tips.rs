//! Moves tips to where they belong: thinning takes a voxel or two too much.
//!
//! **Input** a thinned lattice and the depths of the mask. **Output** the lattice with its curve ends prolonged.
//! **Notation** t a tip (one skeleton neighbour); p that neighbour; q a mask voxel beside t; h the tip's heading, from
//! the skeleton voxel [`HEADING_VOXELS`] before it.
//! **Steps** For each tip, in raster order, at most [`MAX_VOXELS`] times, take the best q that is no more than [`LEEWAY`]
//! shallower than the tip was:
//! 1. *add* q if it touches the skeleton in t alone and lies within 60° of h; q is the tip now;
//! 2. else *swap* t for q if q touches t and p alone and lies at least [`LEAST_GAIN`] further along h.
//!
//! The best is the deepest, then the straightest, then the first; adding comes before swapping.
//!
//! **Guarantees** q touches the rest of the skeleton in one voxel that had one neighbour, so neither move changes the
//! topology or makes an end. In a tube all axis voxels are equally deep up to a radius before its end, so a tip is
//! moved up to there; along a spur the depth falls outward, so it gains a voxel at most.
//! **Cost** O(ends).

use crate::depth::{Depths, UNITS_PER_SPACING};
use crate::lattice::Lattice;
use crate::simple::{is_endpoint, n_neighbors};

/// Sweeps take one to three voxels of a tip; the rest is for swaps along a staircase.
const MAX_VOXELS: usize = 8;
/// How much less deep than the tip the voxels beyond it may be, in spacings: with less, tubes of some widths end short;
/// a spur loses a whole spacing a voxel.
const LEEWAY: f64 = 1.0;
/// How much further along its heading a swap must bring a tip, in spacings.
const LEAST_GAIN: f64 = 0.3;
/// How far back the heading looks: far enough to smooth a staircase, near enough for a bend.
const HEADING_VOXELS: usize = 4;
/// Cosine of the widest turn that a prolonged tip may take.
const MIN_COSINE: f64 = 0.5;

/// Prolongs all tips.
pub(crate) fn settle(lattice: &mut Lattice, depths: &Depths) {
    let tips: Vec<usize> =
        lattice.foreground().filter(|&cell| is_endpoint(lattice.neighborhood(cell))).collect();
    for tip in tips {
        let Some(heading) = heading(lattice, tip) else { continue };
        let least_depth = f64::from(depths.at(tip)) - LEEWAY * UNITS_PER_SPACING;
        let mut end = tip;
        for _ in 0..MAX_VOXELS {
            let Some((next, way)) = continuation(lattice, depths, end, (heading, least_depth)) else { break };
            if way == Move::Swap {
                lattice.delete(end);
            }
            lattice.add(next);
            end = next;
        }
    }
}

/// What brings a tip on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Move {
    Swap,
    Add,
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
    let way = step(lattice, current, tip);
    let length = dot(way, way).sqrt();
    (length > 0.0).then(|| way.map(|component| component / length))
}

/// The way between two cells, in mm along the lattice's axes.
fn step(lattice: &Lattice, from: usize, to: usize) -> [f64; 3] {
    let (a, b, spacing) = (lattice.coordinates(from), lattice.coordinates(to), lattice.spacing());
    [0, 1, 2].map(|axis| (b[axis] as f64 - a[axis] as f64) * spacing[axis])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The voxel that best prolongs the curve beyond `end`, and how.
fn continuation(
    lattice: &Lattice,
    depths: &Depths,
    end: usize,
    (heading, least_depth): ([f64; 3], f64),
) -> Option<(usize, Move)> {
    let before = lattice.neighbors(end).next()?;
    let least_gain = LEAST_GAIN * lattice.spacing().into_iter().fold(f64::INFINITY, f64::min);
    let consider = |cell: usize| {
        let depth = depths.at(cell);
        if depth == 0 || lattice.is_foreground(cell) || f64::from(depth) < least_depth {
            return None;
        }
        let way = step(lattice, end, cell);
        let gain = dot(way, heading);
        let cosine = gain / dot(way, way).sqrt();
        let mut touched = lattice.neighbors(cell);
        let best_move = match n_neighbors(lattice.neighborhood(cell)) {
            1 if cosine >= MIN_COSINE => Move::Add,
            2 if gain >= least_gain && touched.all(|other| other == end || other == before) => Move::Swap,
            _ => return None,
        };
        Some((best_move, depth, cosine, cell))
    };
    lattice
        .surroundings(end)
        .filter_map(consider)
        .max_by(|a, b| (a.0, a.1).cmp(&(b.0, b.1)).then(a.2.total_cmp(&b.2)).then(b.3.cmp(&a.3)))
        .map(|(best_move, _, _, cell)| (cell, best_move))
}
