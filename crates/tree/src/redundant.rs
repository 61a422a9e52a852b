//! Branches inside of other branches.
//!
//! Thinning a wide or flat lumen, or opening a loop about a hole in its wall, can leave two centrelines side by side in
//! one vessel. Such a branch may be long, so its length does not betray it; that it runs in the lumen of others does.
//!
//! **Input** the tree of pieces, a tip, and the mask. **Output** how much of the branch at the tip lies in the lumen of the
//! rest.
//! **Steps** 1. Sort all samples into cubes of the largest diameter's half. 2. For each sample of the branch that is
//! beyond its fork's sphere, look in the 27 cubes about it for a sphere of another run that contains it. 3. In a flat
//! lumen lines may run beside each other with none in the other's spheres: so look for the nearest sample of another run
//! whose sphere nearly touches; it is in one lumen with that if the way between them leads aside ([`MAX_COSINE`]) and
//! the lumen is wide all along (see [`lumen`]). A branch that leaves its parent leads away from it,
//! and two vessels side by side have a wall or a waist between them. 4. Stop as soon as too many are outside.
//! **Guarantees** a branch all of which lies inside of its fork's sphere is called redundant here only if it has a twin:
//! another that the scan cuts off there, and whose tip's sphere has this tip inside. Alone it may be what a scan left of a
//! trunk. As branches go, the share of the others only falls.
//! **Cost** O(N log N) for N samples, and for each sample looked at O(log N + those in 27 cubes, or in 343). As one in ten
//! outside is enough, and tips come first, few are looked at on branches that stay.

use std::collections::BTreeMap;

use espalier_model::Mask;
use glam::{DVec3, IVec3};

use crate::graph::Sample;
use crate::living::Living;
use crate::lumen;

/// The share of its samples beyond its fork's sphere that a redundant branch has in the spheres of others.
const MIN_SHARE: f64 = 0.9;
/// Lines in one flat lumen are at most this multiple of the sum of their radii apart.
const BESIDE: f64 = 1.25;
/// The cosine between a branch and the way to the line beside it. A branch that leaves at up to 58° has a wedge of background
/// on that way as soon as half its radius is out of its parent; one that leaves at a right angle never has.
const MAX_COSINE: f64 = 0.85;
/// A branch's direction is that of the chord over so many samples on each side.
const CHORD: usize = 3;

/// All samples of a graph by place.
pub(crate) struct Spheres {
    cube_mm: f64,
    /// (piece, sample) in each cube.
    cubes: BTreeMap<[i32; 3], Vec<(usize, Sample)>>,
}

/// A branch that runs in the lumen of others.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Redundant {
    /// How many of its samples are beyond its fork's sphere.
    pub(crate) n_beyond: usize,
    /// How many of those are inside of other branches' spheres.
    pub(crate) n_inside: usize,
    /// How many more are beside another branch in one lumen.
    pub(crate) n_beside: usize,
}

impl Spheres {
    /// Sorts the samples of a graph.
    pub(crate) fn of(living: &Living<'_>) -> Self {
        let n_pieces = living.graph.pieces.len();
        let all = || {
            (0..n_pieces).flat_map(|piece| living.graph.polyline(piece).into_iter().map(move |s| (piece, s)))
        };
        let cube_mm = all().map(|(_, s)| s.radius_mm).fold(0.0, f64::max);
        let mut spheres = Self { cube_mm, cubes: BTreeMap::new() };
        if cube_mm > 0.0 {
            for (piece, sample) in all() {
                spheres
                    .cubes
                    .entry(spheres.cube_of(sample.position_mm).to_array())
                    .or_default()
                    .push((piece, sample));
            }
        }
        spheres
    }

    fn cube_of(&self, position_mm: DVec3) -> IVec3 {
        (position_mm / self.cube_mm).floor().as_ivec3()
    }

    /// Whether a place is inside of a sphere of another run than this one.
    fn has_other(&self, living: &mut Living<'_>, run: usize, position_mm: DVec3) -> bool {
        let center = self.cube_of(position_mm);
        (0..27).any(|i| {
            let cube = center + IVec3::new(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
            self.cubes.get(&cube.to_array()).is_some_and(|samples| {
                samples.iter().any(|(piece, s)| {
                    s.position_mm.distance(position_mm) < s.radius_mm
                        && living.run_of(*piece).is_some_and(|other| other != run)
                })
            })
        })
    }

    /// Whether a place on a run that leads along `direction` is beside another run in one lumen.
    fn is_beside_other(
        &self,
        living: &mut Living<'_>,
        (run, place, direction): (usize, Sample, DVec3),
        mask: &Mask,
    ) -> bool {
        if self.cubes.is_empty() || direction == DVec3::ZERO {
            return false;
        }
        let center = self.cube_of(place.position_mm);
        let reach = (BESIDE * (place.radius_mm / self.cube_mm + 1.0)).ceil() as i32;
        let range = |at: i32| at.saturating_sub(reach)..=at.saturating_add(reach);
        let mut nearest: Option<(f64, Sample)> = None;
        for (x, y) in range(center.x).flat_map(|x| range(center.y).map(move |y| (x, y))) {
            let column = self.cubes.range([x, y, *range(center.z).start()]..=[x, y, *range(center.z).end()]);
            for (piece, other) in column.flat_map(|(_, samples)| samples) {
                let apart_mm = other.position_mm.distance(place.position_mm);
                let is_near = apart_mm <= BESIDE * (place.radius_mm + other.radius_mm)
                    && nearest.is_none_or(|(least_mm, _)| apart_mm < least_mm);
                if is_near && living.run_of(*piece).is_some_and(|other| other != run) {
                    nearest = Some((apart_mm, *other));
                }
            }
        }
        nearest.is_some_and(|(apart_mm, other)| {
            let along_mm = direction.dot(other.position_mm - place.position_mm).abs();
            along_mm <= MAX_COSINE * apart_mm && lumen::is_one(mask, place, other)
        })
    }

    /// Whether the branch at a tip runs in the lumen of others.
    pub(crate) fn redundant_at(&self, living: &mut Living<'_>, tip: usize, mask: &Mask) -> Option<Redundant> {
        let piece = living.pieces_at(tip).next()?;
        let run = living.run_of(piece)?;
        let (branch, fork_idx, _) = living.branch_from(tip, piece);
        let fork = living.graph.hubs[fork_idx].sample;
        let is_beyond = |s: &Sample| s.position_mm.distance(fork.position_mm) > fork.radius_mm;
        let n_beyond = branch.iter().filter(|s| is_beyond(s)).count();
        let may_be_outside = ((1.0 - MIN_SHARE) * n_beyond as f64) as usize;
        let (mut n_outside, mut n_beside) = (0, 0);
        for (i, &sample) in branch.iter().enumerate().filter(|(_, s)| is_beyond(s)) {
            if self.has_other(living, run, sample.position_mm) {
                continue;
            }
            let ends = [i.saturating_sub(CHORD), (i + CHORD).min(branch.len() - 1)];
            let chord_mm = branch[ends[1]].position_mm - branch[ends[0]].position_mm;
            if self.is_beside_other(living, (run, sample, chord_mm.normalize_or_zero()), mask) {
                n_beside += 1;
                continue;
            }
            n_outside += 1;
            if n_outside > may_be_outside {
                return None;
            }
        }
        (n_beyond > 0 || has_twin(living, tip, fork_idx)).then_some(Redundant {
            n_beyond,
            n_inside: n_beyond - n_outside - n_beside,
            n_beside,
        })
    }
}

/// Whether another branch of a fork ends at the border of the scan with a sphere that contains this tip.
fn has_twin(living: &mut Living<'_>, tip: usize, fork: usize) -> bool {
    let tip_mm = living.graph.hubs[tip].sample.position_mm;
    let pieces: Vec<usize> = living.pieces_at(fork).collect();
    pieces.into_iter().map(|piece| living.branch_from(fork, piece).1).any(|end| {
        let hub = living.graph.hubs[end];
        let is_other = end != tip && living.degree(end) == 1 && hub.is_at_border;
        is_other && hub.sample.position_mm.distance(tip_mm) < hub.sample.radius_mm
    })
}
