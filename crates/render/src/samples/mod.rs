//! The samples of one tile: which cone is highest, and how others join it.
//!
//! **Input** the cones of a tile in preorder. **Output** what is seen at each sample.
//! **Files** `lattice`: where samples lie; `surface`: what is seen at one; `tube`, `fillet`: how cones become one tube and
//! tubes one tree; `near`: which of them belong together.
//! **Notation** the level of a cone is the square of its height, under 0 outside of it.
//! **Steps** 1. The highest cone at each sample (outside of all, the one of the highest level). 2. Cones of the same
//! branch that come near it share their normals and colours, so that a chain of cones looks like one tube; corners inside
//! bends are filled. 3. Branches join, the first in preorder first: the crotch of a fork is filled. What is filled fades
//! where the path between two places along the tree is long. 4. Where a cone in front passes over a distant part, leave a
//! gap; where distant parts touch, draw a seam.
//! **Guarantees** branches join in preorder, whichever is the highest, so the bytes do not depend on threads, and
//! nothing jumps where another cone becomes the highest.
//! **Source** [`fillet`]. Gaps and seams are ours.

mod fillet;
mod lattice;
mod near;
mod surface;
mod tube;

use std::ops::Range;

use glam::Vec2;

pub(crate) use lattice::Lattice;
use near::{Near, level_from};
pub(crate) use surface::{Best, Surface};
use tube::Tube;

use crate::cone::Cone;
use crate::raster::{Job, NOTHING, TILE};

/// Where two distant parts of the map overlap at their widths, a dark line this wide says that they do not join.
const SEAM_PX: f32 = 1.3;
/// Width of the gap beside a branch that passes in front.
pub(crate) const GAP_PX: f32 = 1.6;
/// Samples per tile and axis at most: three for each pixel.
const MOST_SAMPLES: usize = 3 * TILE;

/// The samples of one square.
pub(crate) struct Samples {
    /// Where they lie.
    pub lattice: Lattice,
    /// What is highest.
    pub best: Vec<Best>,
    /// What is seen, wherever [`Self::best`] is something.
    pub surface: Vec<Surface>,
    /// By row: the samples outside of which nothing is.
    used: Vec<Range<usize>>,
    /// The branch in hand, by sample, and the samples that it comes near to.
    tubes: Vec<Tube>,
    touched: Vec<usize>,
}

impl Samples {
    /// Samples that see nothing.
    pub(crate) fn new() -> Self {
        let lattice = Lattice { origin: Vec2::ZERO, n_pixels: 0, n: 1 };
        Self {
            lattice,
            best: Vec::new(),
            surface: Vec::new(),
            used: Vec::new(),
            tubes: Vec::new(),
            touched: Vec::new(),
        }
    }

    /// The pixels of a row outside of which nothing is.
    pub(crate) fn used_pixels(&self, row: usize) -> Range<usize> {
        let Lattice { n, .. } = self.lattice;
        let (first, rows) = (self.lattice.row(), self.used.get(row * n..(row + 1) * n).unwrap_or_default());
        let offset = |(i, range): (usize, &Range<usize>)| {
            let start = (row * n + i) * first;
            (range.start - start, range.end - start)
        };
        let used = rows.iter().enumerate().filter(|(_, range)| !range.is_empty()).map(offset);
        let (from, to) = used.fold((usize::MAX, 0), |all, own| (all.0.min(own.0), all.1.max(own.1)));
        from.min(to) / n..to.div_ceil(n)
    }

    /// Forgets what was drawn.
    fn clear(&mut self, lattice: Lattice) {
        for range in self.used.drain(..) {
            self.best[range].fill(Best::NOTHING);
        }
        self.lattice = lattice;
        let n_samples = lattice.row() * lattice.row();
        if self.best.len() < n_samples {
            self.best.resize(n_samples, Best::NOTHING);
            self.tubes.resize(n_samples, Tube::NOTHING);
            self.surface.resize(n_samples, Surface::NOTHING);
        }
        self.used.resize(lattice.row(), 0..0);
    }

    /// Draws the listed cones. Without `joins`, each cone stands for itself.
    pub(crate) fn draw(&mut self, job: &Job<'_>, list: &[u32], lattice: Lattice, joins: bool) {
        debug_assert!(lattice.row() <= MOST_SAMPLES, "the square is larger than a tile");
        self.clear(lattice);
        for &index in list {
            let cone = &job.drawn[index as usize].cone;
            let reach = reach_px(cone, job, lattice, joins);
            for (row, y, samples) in lattice.runs(cone, reach) {
                let used = &mut self.used[row];
                let from = if used.end == 0 { samples.start } else { used.start.min(samples.start) };
                *used = from..used.end.max(samples.end);
                for sample in samples {
                    if let Some(hit) = cone.at(lattice.pixel(row, sample, y), reach) {
                        self.best[sample].offer(index, hit);
                    }
                }
            }
        }
        for range in &self.used {
            for (best, surface) in self.best[range.clone()].iter().zip(&mut self.surface[range.clone()]) {
                if best.index != NOTHING {
                    *surface = Surface::of(job, best);
                }
            }
        }
        if joins {
            let branch_of = |&index: &u32| job.kinship.branch_of(job.drawn[index as usize].node);
            for of_branch in list.chunk_by(|a, b| branch_of(a) == branch_of(b)) {
                self.join(job, of_branch);
            }
            for range in &self.used {
                for (best, surface) in self.best[range.clone()].iter().zip(&mut self.surface[range.clone()]) {
                    if best.index != NOTHING {
                        surface.widen(best);
                    }
                }
            }
        }
    }

    /// Lets the cones of a branch become one tube, and the tube join what it comes near to.
    fn join(&mut self, job: &Job<'_>, of_branch: &[u32]) {
        let Self { lattice, best, surface, tubes, touched, .. } = self;
        let branch_of = |index: u32| job.kinship.branch_of(job.drawn[index as usize].node);
        let Some(own) = of_branch.first().map(|&index| branch_of(index)) else { return };
        for &index in of_branch {
            let edge = &job.drawn[index as usize];
            let reach = reach_px(&edge.cone, job, *lattice, true);
            for (row, y, samples) in lattice.runs(&edge.cone, reach) {
                for sample in samples {
                    let winner = &best[sample];
                    if winner.n_near < 2 {
                        continue;
                    }
                    let is_winner = winner.index == index;
                    let at = || edge.cone.at(lattice.pixel(row, sample, y), reach);
                    let Some(hit) = (if is_winner { Some(winner.hit) } else { at() }) else { continue };
                    let level = if is_winner {
                        hit.level
                    } else if branch_of(winner.index) == own {
                        let near = Near::new(job, winner, (index, hit), lattice.fringe_px());
                        near.chain(job, &mut surface[sample], winner);
                        if near.kin <= 0.0 {
                            continue;
                        }
                        near.level
                    } else {
                        level_from(&winner.hit, &hit)
                    };
                    if tubes[sample].index == NOTHING {
                        touched.push(sample);
                    }
                    tubes[sample].take(edge, (index, hit), level);
                }
            }
        }
        for sample in touched.drain(..) {
            let tube = std::mem::replace(&mut tubes[sample], Tube::NOTHING);
            let (winner, surface) = (&best[sample], &mut surface[sample]);
            if branch_of(winner.index) == own {
                surface.join_own(tube.level, winner.hit.radius);
            } else {
                let near = Near::new(job, winner, (tube.index, tube.hit), lattice.fringe_px());
                near.meet(job, (surface, winner), &tube);
            }
        }
    }
}

/// How far from its outline a cone is looked at.
fn reach_px(cone: &Cone, job: &Job<'_>, lattice: Lattice, joins: bool) -> f32 {
    let fringe_px = lattice.fringe_px();
    match (joins, job.has_depth) {
        (false, _) => fringe_px,
        (true, false) => cone.fillet_px().max(fringe_px),
        (true, true) => cone.fillet_px().max(GAP_PX),
    }
}
