//! The polyline of a branch, from the fork or root that it starts from to its end.
//!
//! **Differs from the tree** the radius at a fork is that of the parent's tube, which the branch does not have: there
//! the line takes the radius of its own first node. A root with one branch is no fork.

use espalier_model::{Branch, Tree};
use glam::DVec3;

/// A polyline with its arc lengths; at least two points.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Line {
    /// Nodes of the tree.
    pub(super) nodes: Vec<usize>,
    /// RAS+ mm.
    pub(super) points_mm: Vec<DVec3>,
    pub(super) radii_mm: Vec<f64>,
    /// Path length from the start, increasing from 0.
    pub(super) arcs_mm: Vec<f64>,
    /// Radius of the fork at its start and at its end; 0 where there is none.
    pub(super) forks_mm: [f64; 2],
}

impl Line {
    pub(super) fn of(tree: &Tree, branch: &Branch) -> Self {
        let nodes: Vec<usize> = branch.polyline().collect();
        let fork_mm = |node: usize| {
            if tree.children(node).len() > 1 { tree.nodes()[node].radius_mm } else { 0.0 }
        };
        let mut radii_mm: Vec<f64> = nodes.iter().map(|&node| tree.nodes()[node].radius_mm).collect();
        if tree.children(branch.hub).len() > 1 {
            radii_mm[0] = radii_mm[1];
        }
        let mut arcs_mm = vec![0.0];
        let mut arc_mm = 0.0;
        for &node in &nodes[1..] {
            arc_mm += tree.edge_length_mm(node);
            arcs_mm.push(arc_mm);
        }
        let points_mm = nodes.iter().map(|&node| tree.position_mm(node)).collect();
        let forks_mm = [fork_mm(branch.hub), fork_mm(branch.end())];
        Self { nodes, points_mm, radii_mm, arcs_mm, forks_mm }
    }

    pub(super) fn length_mm(&self) -> f64 {
        self.arcs_mm[self.arcs_mm.len() - 1]
    }

    /// The edge that holds an arc length, as the index of its outer point, and the place on it from 0 to 1.
    pub(super) fn locate(&self, arc_mm: f64) -> (usize, f64) {
        let last = self.arcs_mm.len() - 1;
        let outer = self.arcs_mm.partition_point(|&known| known < arc_mm).clamp(1, last);
        let (low, high) = (self.arcs_mm[outer - 1], self.arcs_mm[outer]);
        // Edges have a positive length, but a sum of lengths may not feel the shortest.
        let share = if high > low { ((arc_mm - low) / (high - low)).clamp(0.0, 1.0) } else { 1.0 };
        (outer, share)
    }

    /// The point at an arc length.
    pub(super) fn point_mm(&self, arc_mm: f64) -> DVec3 {
        let (outer, share) = self.locate(arc_mm);
        self.points_mm[outer - 1].lerp(self.points_mm[outer], share)
    }

    /// The radius at an arc length.
    pub(super) fn radius_mm(&self, arc_mm: f64) -> f64 {
        let (outer, share) = self.locate(arc_mm);
        self.radii_mm[outer - 1] * (1.0 - share) + self.radii_mm[outer] * share
    }

    /// The edges as (arc lengths, radii) of their ends.
    pub(super) fn edges(&self) -> impl Iterator<Item = ([f64; 2], [f64; 2])> + '_ {
        let pair = |values: &[f64]| [values[0], values[1]];
        self.arcs_mm.windows(2).map(pair).zip(self.radii_mm.windows(2).map(pair))
    }
}
