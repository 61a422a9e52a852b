//! A layout as a linkage: ratios are its joints, and a change of some of them is tested before it is made.
//!
//! **Input** a shape; changes of ratios. **Output** what a change gains, whether it brings edges together, and the shape
//! after the changes that were made.
//! **Notation** a change is *clear* if no pair of edges meets after it, and no pair is too near that was not as near
//! before.
//! **Guarantees** a change is tested against all pairs that it moves against each other; changes may jump over
//! branches, since only their end counts.
//! **Cost** that of `hierarchy`: about log² N for each change, and the pairs near what moves.

use std::ops::Range;

use espalier_geom::math;
use espalier_geom::plane::Segment;
use glam::DVec2;

use super::hierarchy::Hierarchy;
use super::joint::{Change, Part, Pieces};
use super::placement::Placement;
use super::shape::Shape;
use super::work::Work;
use crate::problem::Problem;
use crate::ratio;
use crate::separation::Separation;

/// Changes after which positions are made anew from the ratios: each adds a rounding error to what it moves.
const REFRESH: u32 = 4096;

/// What is in the way of a change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rule {
    /// Pairs that meet after it.
    Crossings,
    /// Those, and pairs that are too near after it and were not as near before.
    Clearance,
}

/// A layout with joints.
pub(crate) struct Linkage<'a> {
    problem: &'a Problem<'a>,
    separation: &'a Separation,
    pub(crate) shape: Shape,
    hierarchy: Hierarchy,
    /// The placement term, if it counts.
    pub(crate) placement: Option<Placement>,
    /// What a unit of r_l² costs for each segment.
    length_cost: Vec<f64>,
    /// The change that is looked at, and what it moves.
    pub(crate) change: Change,
    parts: Vec<Part>,
    pieces: Pieces,
    n_changes: u32,
}

impl<'a> Linkage<'a> {
    /// The linkage of a shape; the placement term does not count.
    pub(crate) fn new(problem: &'a Problem<'a>, separation: &'a Separation, shape: Shape) -> Self {
        let hierarchy = Hierarchy::new(&problem.parent, &shape.positions(problem));
        let mut length_cost = vec![0.0; shape.length_ratio.len()];
        for node in 1..problem.n_nodes() {
            length_cost[problem.branch[node] as usize] += problem.length_cost[node];
        }
        Self {
            problem,
            separation,
            shape,
            hierarchy,
            placement: None,
            length_cost,
            change: Change::default(),
            parts: Vec::new(),
            pieces: Pieces::default(),
            n_changes: 0,
        }
    }

    /// The same with the placement term.
    pub(crate) fn with_placement(mut self) -> Self {
        self.placement = Some(Placement::of(self.problem, &self.shape.headings(self.problem)));
        self
    }

    /// The node where the paths to two edges part.
    pub(crate) fn parting(&self, a: usize, b: usize) -> usize {
        self.separation.paths.parting(a, b)
    }

    /// What the ratio of a segment costs.
    pub(crate) fn length_loss(&self, segment: usize) -> f64 {
        let ratio = self.shape.length_ratio[segment];
        self.length_cost[segment] * ratio * ratio
    }

    /// What the ratio of a node costs.
    pub(crate) fn angle_loss(&self, node: usize) -> f64 {
        let ratio = self.shape.angle_ratio[node];
        self.problem.angle_cost[node] * ratio * ratio
    }

    /// By how much the change lowers the loss (without the placement term).
    pub(crate) fn loss_gain(&self) -> f64 {
        let angle = |&(node, ratio): &(usize, f64)| {
            self.angle_loss(node) - self.problem.angle_cost[node] * ratio * ratio
        };
        let length = |&(segment, ratio): &(usize, f64)| {
            self.length_loss(segment) - self.length_cost[segment] * ratio * ratio
        };
        let angles: f64 = self.change.angles.iter().map(angle).sum();
        angles + self.change.lengths.iter().map(length).sum::<f64>()
    }

    /// By how much the change, which is cut, lowers the placement term.
    fn placement_gain(&self) -> f64 {
        let Some(placement) = &self.placement else { return 0.0 };
        let turns = self.pieces.turns(self.problem.n_nodes());
        turns.map(|(range, turn_rad)| placement.gain(&range, turn_rad)).sum()
    }

    /// By how much the change, which is cut, lowers what counts.
    pub(crate) fn gain(&self) -> f64 {
        self.loss_gain() + self.placement_gain()
    }

    /// Whether the change, which is cut, is clear within a range of edges; if not, a pair of edges in its way.
    pub(crate) fn is_clear(&mut self, window: &Range<usize>, work: &mut Work) -> Result<(), (usize, usize)> {
        let Self { problem, separation, hierarchy, pieces, .. } = self;
        let (before, mut in_the_way) = (hierarchy.n_looked, (0, 0));
        let margin_mm = separation.clearance_mm.max(separation.tolerance_mm());
        let is_clear = hierarchy.each_near(pieces, window, margin_mm, |pair| {
            in_the_way = pair.edges;
            separation.may_move(problem, pair.edges, &pair.before, &pair.after)
        });
        work.done += hierarchy.n_looked - before;
        if is_clear { Ok(()) } else { Err(in_the_way) }
    }

    /// The pairs of edges within a range that are in the way of the change, which is cut, up to one more than a limit.
    pub(crate) fn obstacles(
        &mut self,
        rule: Rule,
        (window, limit): (&Range<usize>, usize),
        found: &mut Vec<(u32, u32)>,
        work: &mut Work,
    ) {
        let Self { problem, separation, hierarchy, pieces, .. } = self;
        let before = hierarchy.n_looked;
        let margin_mm = separation.clearance_mm.max(separation.tolerance_mm());
        found.clear();
        hierarchy.each_near(pieces, window, margin_mm, |pair| {
            let is_in_the_way = match rule {
                Rule::Crossings => separation.meet_at(problem, pair.edges, &pair.after),
                Rule::Clearance => !separation.may_move(problem, pair.edges, &pair.before, &pair.after),
            };
            if is_in_the_way {
                found.push((pair.edges.0 as u32, pair.edges.1 as u32));
            }
            found.len() <= limit
        });
        work.done += hierarchy.n_looked - before;
    }

    /// The pairs of edges that meet, of different pieces of a range that is cut at some nodes; within the first pieces,
    /// as many as said, too.
    pub(crate) fn crossings(
        &mut self,
        window: &Range<usize>,
        (starts, n_loose): (impl Iterator<Item = usize>, usize),
        work: &mut Work,
    ) -> Vec<(u32, u32)> {
        self.pieces.cut_at(std::iter::once(0).chain(starts), n_loose + 1);
        let Self { problem, separation, hierarchy, pieces, .. } = self;
        let (before, mut found) = (hierarchy.n_looked, Vec::new());
        hierarchy.each_near(pieces, window, separation.tolerance_mm(), |pair| {
            if separation.meet_at(problem, pair.edges, &pair.after) {
                found.push((pair.edges.0 as u32, pair.edges.1 as u32));
            }
            true
        });
        work.done += hierarchy.n_looked - before;
        found
    }

    /// Whether the change, which is cut, moves two edges against each other.
    pub(crate) fn parts_pair(&self, a: usize, b: usize) -> bool {
        !self.pieces.move_together(self.pieces.of(a), self.pieces.of(b))
    }

    /// Whether one pair of edges allows the change, which is cut.
    pub(crate) fn allows(&mut self, (a, b): (usize, usize)) -> bool {
        let (piece_a, piece_b) = (self.pieces.of(a), self.pieces.of(b));
        if self.pieces.move_together(piece_a, piece_b) {
            return true;
        }
        let before = [self.hierarchy.edge(a), self.hierarchy.edge(b)];
        let after = [self.moved(&before[0], piece_a), self.moved(&before[1], piece_b)];
        self.separation.may_move(self.problem, (a, b), &before, &after)
    }

    fn moved(&self, edge: &Segment, piece: usize) -> Segment {
        super::hierarchy::moved(edge, &self.pieces.motions[piece])
    }

    /// Makes the change, which is cut.
    pub(crate) fn make(&mut self) {
        if let Some(placement) = &mut self.placement {
            let turns = self.pieces.turns(self.problem.n_nodes());
            placement.total -= turns.map(|(range, turn_rad)| placement.gain(&range, turn_rad)).sum::<f64>();
        }
        // Inner parts first: an outer one would move the pivots of its inner ones.
        for part in self.parts.iter().rev() {
            self.hierarchy.move_range(&part.range, &part.motion());
            if let Some(placement) = &mut self.placement {
                placement.turn(&part.range, part.turn_rad);
            }
        }
        for &(node, ratio) in &self.change.angles {
            self.shape.angle_ratio[node] = ratio;
        }
        for &(segment, ratio) in &self.change.lengths {
            self.shape.length_ratio[segment] = ratio;
        }
        self.n_changes += 1;
        if self.n_changes >= REFRESH {
            self.refresh();
        }
    }

    /// Goes to another shape.
    pub(crate) fn set_shape(&mut self, shape: Shape) {
        self.shape = shape;
        self.refresh();
    }

    /// An edge as it lies.
    #[cfg(test)]
    pub(crate) fn edge(&mut self, node: usize) -> Segment {
        self.hierarchy.edge(node)
    }

    /// Makes the positions anew from the ratios.
    pub(crate) fn refresh(&mut self) {
        self.n_changes = 0;
        self.hierarchy.place(&self.problem.parent, &self.shape.positions(self.problem));
        if let Some(placement) = &mut self.placement {
            placement.look(self.problem, &self.shape.headings(self.problem));
        }
    }

    /// Finds what the change moves.
    pub(crate) fn cut(&mut self) {
        self.parts.clear();
        for &(node, ratio) in &self.change.angles {
            let (bend, old) = (self.problem.bend[node], self.shape.angle_ratio[node]);
            let turn_rad = self.problem.side[node]
                * (ratio::embedded_bend(bend, ratio) - ratio::embedded_bend(bend, old));
            if turn_rad != 0.0 {
                let part = Part {
                    range: self.problem.tree.subtree(node),
                    pivot: self.hierarchy.edge(node).a,
                    turn: math::unit_vector(turn_rad),
                    turn_rad,
                };
                self.parts.push(part);
            }
        }
        for idx in 0..self.change.lengths.len() {
            let (segment, ratio) = self.change.lengths[idx];
            let scale = (1.0 + ratio) / (1.0 + self.shape.length_ratio[segment]);
            if scale != 1.0 {
                self.scale_segment(segment, scale);
            }
        }
        self.pieces.cut(&mut self.parts, self.problem.n_nodes());
    }

    fn scale_segment(&mut self, segment: usize, scale: f64) {
        let nodes = self.problem.branches.list()[segment].nodes.clone();
        let (first, end) = (nodes.start, nodes.end - 1);
        let range = self.problem.tree.subtree(first);
        let below = nodes.end..range.end;
        let pivot = self.hierarchy.edge(first).a;
        self.parts.push(Part { range, pivot, turn: DVec2::new(scale, 0.0), turn_rad: 0.0 });
        if !below.is_empty() {
            let pivot = self.hierarchy.edge(end).b;
            self.parts.push(Part { range: below, pivot, turn: DVec2::new(1.0 / scale, 0.0), turn_rad: 0.0 });
        }
    }
}
