//! Rectangles around runs of edges: who meets whom after a part of the tree has moved, without looking at most edges.
//!
//! **Input** edges in preorder, as segments; a part of them and an isometry. **Output** pairs of edges that may be
//! nearer than a margin. **Notation** a block is an aligned run of 2^k edges; block 1 holds all, block b the blocks
//! 2b and 2b + 1.
//! **Steps** each block has a rectangle around its edges. A question walks pairs of blocks from the large to the
//! small and leaves out pairs whose rectangles are apart. A part that moves as a whole takes its rectangles along, so only blocks
//! that hold both moved and unmoved edges are made anew.
//! Each block also has two sums over its edges, Σ p e^{i(h − H)} and Σ p e^{i(h + H)}, which a rotation multiplies
//! and a reflection swaps.
//! **Why not a grid?** a grid has to take out and enter again each edge that moves, and a question has to look at
//! each edge of the smaller side; here a part that is far from the others costs a few dozen rectangles.
//! **Guarantees** every pair nearer than the margin is visited; the order depends on the input only.
//! **Cost** a move O(size of the part + log N); a question about log N and the pairs that are near.

use std::ops::Range;

use glam::DVec2;

use super::isometry::{Isometry, conjugate};
use super::rectangle::Rectangle;

/// Sums over edges of p e^{i(h − H)} and p e^{i(h + H)}.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct HeadingSums {
    pub(super) direct: DVec2,
    pub(super) mirrored: DVec2,
}

impl HeadingSums {
    /// Of one edge with the heading h, as a unit vector, and the aim p e^{iH}.
    pub(super) fn of_edge(heading: DVec2, aim: DVec2) -> Self {
        Self { direct: conjugate(aim).rotate(heading), mirrored: aim.rotate(heading) }
    }

    /// After the edges have moved.
    pub(super) fn moved(&self, isometry: &Isometry) -> Self {
        let (direct, mirrored) =
            if isometry.is_mirror { (self.mirrored, self.direct) } else { (self.direct, self.mirrored) };
        Self { direct: isometry.direction(direct), mirrored: isometry.direction(mirrored) }
    }

    pub(super) fn plus(&self, other: &Self) -> Self {
        Self { direct: self.direct + other.direct, mirrored: self.mirrored + other.mirrored }
    }

    pub(super) fn minus(&self, other: &Self) -> Self {
        Self { direct: self.direct - other.direct, mirrored: self.mirrored - other.mirrored }
    }
}

/// Two blocks that may meet.
#[derive(Clone, Copy)]
struct BlockPair {
    /// Of the part that moves, with where its rectangle goes.
    moving: u32,
    rectangle: Rectangle,
    /// Of the edges as they are.
    fixed: u32,
}

/// Edges under rectangles.
#[derive(Clone)]
pub(super) struct Hierarchy {
    /// Start and end of each edge, in mm.
    pub(super) ends: Vec<(DVec2, DVec2)>,
    /// The number of smallest blocks, a power of two.
    n_leaves: usize,
    rectangles: Vec<Rectangle>,
    sums: Vec<HeadingSums>,
}

/// The memory of a question.
#[derive(Clone, Default)]
pub(super) struct Walk {
    stack: Vec<BlockPair>,
    moving: Vec<(u32, Rectangle)>,
    /// Pairs of blocks looked at so far: the measure of work.
    pub(super) n_visits: u64,
}

impl Hierarchy {
    /// Without edges yet.
    pub(super) fn new(n_edges: usize) -> Self {
        let n_leaves = n_edges.next_power_of_two();
        Self {
            ends: vec![(DVec2::ZERO, DVec2::ZERO); n_edges],
            n_leaves,
            rectangles: vec![Rectangle::EMPTY; 2 * n_leaves],
            sums: vec![HeadingSums::default(); 2 * n_leaves],
        }
    }

    /// Places an edge with its direction; `finish` has to follow.
    pub(super) fn place(&mut self, edge: usize, (ends, axis): ((DVec2, DVec2), DVec2), sums: HeadingSums) {
        self.ends[edge] = ends;
        self.rectangles[self.n_leaves + edge] = Rectangle::of_segment(ends, axis);
        self.sums[self.n_leaves + edge] = sums;
    }

    /// Makes all blocks from the edges.
    pub(super) fn finish(&mut self) {
        (1..self.n_leaves).rev().for_each(|block| self.make(block));
    }

    fn make(&mut self, block: usize) {
        self.rectangles[block] = self.rectangles[2 * block].around(&self.rectangles[2 * block + 1]);
        self.sums[block] = self.sums[2 * block].plus(&self.sums[2 * block + 1]);
    }

    /// The sums over all edges.
    pub(super) fn total(&self) -> HeadingSums {
        self.sums[1]
    }

    /// The sums over a range of edges.
    pub(super) fn sums(&self, range: &Range<usize>) -> HeadingSums {
        let mut total = HeadingSums::default();
        self.each_block(range, |block| total = total.plus(&self.sums[block]));
        total
    }

    /// Moves a range of edges; `mend` has to follow once all ranges have moved.
    pub(super) fn carry(&mut self, range: &Range<usize>, isometry: &Isometry) {
        for (start, end) in &mut self.ends[range.clone()] {
            (*start, *end) = (isometry.point(*start), isometry.point(*end));
        }
        let (mut first, mut end) = self.leaves(range);
        while first < end {
            for rectangle in &mut self.rectangles[first..end] {
                *rectangle = rectangle.moved(isometry);
            }
            for sums in &mut self.sums[first..end] {
                *sums = sums.moved(isometry);
            }
            (first, end) = (first.div_ceil(2), end / 2);
        }
    }

    /// Makes the blocks anew that lie across an end of a moved range.
    pub(super) fn mend(&mut self, range: &Range<usize>) {
        if range.is_empty() {
            return;
        }
        let (mut first, mut last) = (self.n_leaves + range.start, self.n_leaves + range.end - 1);
        while first > 1 {
            (first, last) = (first / 2, last / 2);
            self.make(first);
            if last != first {
                self.make(last);
            }
        }
    }

    /// Visits pairs (edge of `moving` with its ends after `isometry`, edge of `fixed` as it is) that may be nearer
    /// than `margin_mm`, until `visit` says no; whether it never did.
    pub(super) fn each_near(
        &self,
        (moving, isometry): (&[Range<usize>], &Isometry),
        fixed: &[Range<usize>],
        margin_mm: f64,
        walk: &mut Walk,
        mut visit: impl FnMut((usize, (DVec2, DVec2)), usize) -> bool,
    ) -> bool {
        self.find_pairs((moving, isometry), fixed, margin_mm, walk);
        while let Some(pair) = walk.stack.pop() {
            walk.n_visits += 1;
            let (a, b) = (pair.moving as usize, pair.fixed as usize);
            let (rectangle, other) = (&pair.rectangle, &self.rectangles[b]);
            if !rectangle.is_near(other, margin_mm) {
                continue;
            }
            if a >= self.n_leaves && b >= self.n_leaves {
                let (edge, other) = (a - self.n_leaves, b - self.n_leaves);
                let (start, end) = self.ends[edge];
                if !visit((edge, (isometry.point(start), isometry.point(end))), other) {
                    return false;
                }
            } else if b >= self.n_leaves || (a < self.n_leaves && rectangle.size() > other.size()) {
                for half in [2 * a, 2 * a + 1] {
                    let rectangle = self.rectangles[half].moved(isometry);
                    walk.stack.push(BlockPair { moving: half as u32, rectangle, ..pair });
                }
            } else {
                for half in [2 * b, 2 * b + 1] {
                    walk.stack.push(BlockPair { fixed: half as u32, ..pair });
                }
            }
        }
        true
    }

    /// Pairs of the largest blocks of two parts, without those that are far from all that moves.
    fn find_pairs(
        &self,
        (moving, isometry): (&[Range<usize>], &Isometry),
        fixed: &[Range<usize>],
        margin_mm: f64,
        walk: &mut Walk,
    ) {
        let Walk { stack, moving: blocks, n_visits } = walk;
        stack.clear();
        blocks.clear();
        for range in moving {
            self.each_block(range, |block| {
                blocks.push((block as u32, self.rectangles[block].moved(isometry)));
            });
        }
        let whole = Rectangle::around_all(blocks.iter().map(|(_, rectangle)| rectangle));
        for range in fixed {
            self.each_block(range, |fixed| {
                *n_visits += 1;
                if self.rectangles[fixed].is_near(&whole, margin_mm) {
                    let pair = |&(moving, rectangle)| BlockPair { moving, rectangle, fixed: fixed as u32 };
                    stack.extend(blocks.iter().map(pair));
                }
            });
        }
    }

    /// The smallest blocks of a range; the last range goes on to the end, so that blocks across the end of the edges
    /// are inside of it.
    fn leaves(&self, range: &Range<usize>) -> (usize, usize) {
        let is_last = range.end == self.ends.len() && !range.is_empty();
        (self.n_leaves + range.start, self.n_leaves + if is_last { self.n_leaves } else { range.end })
    }

    /// Visits the largest blocks that make up a range.
    fn each_block(&self, range: &Range<usize>, mut visit: impl FnMut(usize)) {
        let (mut first, mut end) = self.leaves(range);
        while first < end {
            if first % 2 == 1 {
                visit(first);
                first += 1;
            }
            if end % 2 == 1 {
                end -= 1;
                visit(end);
            }
            (first, end) = (first / 2, end / 2);
        }
    }
}
