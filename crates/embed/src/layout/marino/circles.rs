//! Whether a subtree that turns as a whole would meet the rest: circles around runs of edges, halved again and again.
//!
//! **Input** a layout without crossings; a range of edges and a motion. **Output** whether any of them would then meet
//! an edge outside of the range; the layout after the motion.
//! **Notation** a part is 2^k edges next to each other in preorder, so that a subtree is at most 2 log N parts.
//! **Steps** 1. Every part has a circle around its edges. 2. A motion is noted at the largest parts it moves, and
//! handed down when their halves are looked at. 3. Pairs of one part that moves and one that does not: nothing meets
//! if the circles do not; else halve the part with the larger circle; in the end edge against edge.
//! **Guarantees** every pair of edges nearer than 1e-6 of the median edge length is found; edges with a common node
//! meet if they point the same way to within 1e-6 rad. No recursion.
//! Why not a grid? Turning a subtree would take its edges out and put them in again, one by one: on a chain of
//! 10,000 nodes that is 25 million edges per sweep.
//! **Source** [Lotan2004], for the chain of a protein: the hierarchy over the chain, and pairs of its parts.
//! **Cost** O(log N) for a motion; for a question O(log N) and the pairs of circles that meet.

use std::ops::Range;

use glam::DVec2;

use crate::crossing::{TOLERANCE, neighbours_overlap, segments_meet};
use crate::problem::Problem;
use crate::solver::Work;

/// A turn about a point: p → r p + offset, complex.
#[derive(Clone, Copy)]
pub(super) struct Motion {
    turn: DVec2,
    offset: DVec2,
}

impl Motion {
    /// By a unit vector about a pivot.
    pub(super) fn about(pivot: DVec2, turn: DVec2) -> Self {
        Self { turn, offset: pivot - turn.rotate(pivot) }
    }

    fn of(&self, p: DVec2) -> DVec2 {
        self.turn.rotate(p) + self.offset
    }

    /// The other motion, then this one.
    fn after(&self, other: &Self) -> Self {
        Self { turn: self.turn.rotate(other.turn), offset: self.of(other.offset) }
    }
}

/// A circle around the edges of a part.
#[derive(Clone, Copy)]
struct Circle {
    middle: DVec2,
    /// Negative for a part without edges.
    radius: f64,
}

/// A part: its place in the heap (the whole is 1, the halves of k are 2 k and 2 k + 1) and its edges.
#[derive(Clone, Copy)]
struct Part {
    idx: usize,
    start: usize,
    len: usize,
}

impl Part {
    fn halves(self) -> [Self; 2] {
        let (idx, len) = (2 * self.idx, self.len / 2);
        [Self { idx, len, ..self }, Self { idx: idx + 1, start: self.start + len, len }]
    }

    fn is_within(self, range: &Range<usize>) -> bool {
        range.start <= self.start && self.start + self.len <= range.end
    }

    fn is_outside(self, range: &Range<usize>) -> bool {
        self.start + self.len <= range.start || range.end <= self.start
    }
}

/// A layout under motions of subtrees.
pub(super) struct Circles<'a> {
    parent: &'a [u32],
    tolerance_mm: f64,
    /// Both ends of each edge, the upper one first, up to what is due; that of the root is never used.
    ends: Vec<[DVec2; 2]>,
    /// By place in the heap.
    circles: Vec<Circle>,
    /// The motion that the halves have still to make, by place in the heap.
    due: Vec<Option<Motion>>,
    whole: Part,
    pairs: Vec<(Part, Part)>,
    parts: Vec<Part>,
}

impl<'a> Circles<'a> {
    pub(super) fn new(problem: &'a Problem, positions: &[DVec2]) -> Self {
        let len = positions.len().next_power_of_two();
        let none = Circle { middle: DVec2::ZERO, radius: -1.0 };
        let ends = |node: usize| [positions[problem.parent[node] as usize], positions[node]];
        let mut circles = Self {
            parent: &problem.parent,
            tolerance_mm: TOLERANCE * problem.scale_mm,
            ends: (0..positions.len()).map(ends).collect(),
            circles: vec![none; 2 * len],
            due: vec![None; len],
            whole: Part { idx: 1, start: 0, len },
            pairs: Vec::new(),
            parts: Vec::new(),
        };
        for node in 1..positions.len() {
            let [a, b] = circles.ends[node];
            let circle = &mut circles.circles[len + node];
            (circle.middle, circle.radius) = (0.5 * (a + b), 0.5 * a.distance(b));
        }
        for idx in (1..len).rev() {
            circles.enclose(idx);
        }
        circles
    }

    /// Where a node is now; not the root.
    pub(super) fn position(&mut self, node: usize) -> DVec2 {
        let mut part = self.whole;
        while part.len > 1 {
            let [first, second] = self.open(part);
            part = if node < second.start { first } else { second };
        }
        self.ends[node][1]
    }

    /// Whether an edge of the range would meet one outside of it, after the motion.
    pub(super) fn would_meet(&mut self, range: Range<usize>, motion: Motion, work: &mut Work) -> bool {
        self.pairs.clear();
        self.parts.clear();
        self.parts.push(self.whole);
        while let Some(part) = self.parts.pop() {
            if part.is_within(&range) {
                self.pairs.push((part, self.whole));
            } else if !part.is_outside(&range) {
                let halves = self.open(part);
                self.parts.extend(halves);
            }
        }
        let (mut n_visited, mut is_met) = (0, false);
        while let Some((moved, other)) = self.pairs.pop() {
            n_visited += 1;
            if moved.len == 1 && other.len == 1 {
                is_met = self.meets(moved.start, other.start, &motion);
                if is_met {
                    break;
                }
            } else if self.halves_other(moved, other, &range) {
                for half in self.open(other) {
                    if !half.is_within(&range) && !self.is_apart(moved, half, &motion) {
                        self.pairs.push((moved, half));
                    }
                }
            } else {
                for half in self.open(moved) {
                    if !self.is_apart(half, other, &motion) {
                        self.pairs.push((half, other));
                    }
                }
            }
        }
        work.spend(n_visited);
        is_met
    }

    /// Which of a pair is halved: what is mixed has to be, else the larger.
    fn halves_other(&self, moved: Part, other: Part, range: &Range<usize>) -> bool {
        let is_larger = || self.circles[other.idx].radius > self.circles[moved.idx].radius;
        !other.is_outside(range) || moved.len == 1 || (other.len > 1 && is_larger())
    }

    /// Moves the edges of a range.
    pub(super) fn apply(&mut self, range: Range<usize>, motion: Motion) {
        self.parts.clear();
        self.parts.push(self.whole);
        let mut idx = 0;
        while idx < self.parts.len() {
            let part = self.parts[idx];
            idx += 1;
            if part.is_within(&range) {
                self.move_part(part.idx, &motion);
            } else if !part.is_outside(&range) {
                let halves = self.open(part);
                self.parts.extend(halves);
            }
        }
        // Halves stand behind what they are halves of.
        while let Some(part) = self.parts.pop() {
            if !part.is_within(&range) && !part.is_outside(&range) {
                self.enclose(part.idx);
            }
        }
    }

    /// Both halves of a part, which have made every motion that was due.
    fn open(&mut self, part: Part) -> [Part; 2] {
        if let Some(motion) = self.due[part.idx].take() {
            self.move_part(2 * part.idx, &motion);
            self.move_part(2 * part.idx + 1, &motion);
        }
        part.halves()
    }

    fn move_part(&mut self, idx: usize, motion: &Motion) {
        let circle = &mut self.circles[idx];
        circle.middle = motion.of(circle.middle);
        if let Some(due) = self.due.get_mut(idx) {
            *due = Some(due.map_or(*motion, |due| motion.after(&due)));
        } else if let Some(ends) = self.ends.get_mut(idx - self.whole.len) {
            *ends = ends.map(|end| motion.of(end));
        }
    }

    /// The least circle around those of the halves.
    fn enclose(&mut self, idx: usize) {
        let (a, b) = (self.circles[2 * idx], self.circles[2 * idx + 1]);
        let distance = a.middle.distance(b.middle);
        let circle = &mut self.circles[idx];
        (circle.middle, circle.radius) = if b.radius < 0.0 || distance + b.radius <= a.radius {
            (a.middle, a.radius)
        } else if a.radius < 0.0 || distance + a.radius <= b.radius {
            (b.middle, b.radius)
        } else {
            let radius = 0.5 * (distance + a.radius + b.radius);
            (a.middle.lerp(b.middle, (radius - a.radius) / distance), radius)
        };
    }

    fn is_apart(&self, moved: Part, other: Part, motion: &Motion) -> bool {
        let (a, b) = (&self.circles[moved.idx], &self.circles[other.idx]);
        // Rounding in the middles is far below the tolerance.
        let reach = a.radius + b.radius + 2.0 * self.tolerance_mm;
        let is_empty = a.radius < 0.0 || b.radius < 0.0;
        is_empty || motion.of(a.middle).distance_squared(b.middle) > reach * reach
    }

    /// Whether an edge that moves would meet one that does not.
    fn meets(&self, moved: usize, other: usize, motion: &Motion) -> bool {
        let [a, b] = self.ends[moved].map(|end| motion.of(end));
        let [c, d] = self.ends[other];
        let array = |p: DVec2, q: DVec2| [p.x, p.y, q.x, q.y];
        let hub = self.parent[moved] as usize;
        // Only the uppermost edge that moves shares a node with one that does not: the pivot.
        if hub == other {
            neighbours_overlap(array(d, c), array(d, b))
        } else if hub == self.parent[other] as usize {
            neighbours_overlap(array(c, d), array(c, b))
        } else {
            segments_meet(array(a, b), array(c, d), self.tolerance_mm)
        }
    }
}
