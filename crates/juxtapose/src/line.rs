//! Polylines by arc length: branches, and chains of branches.
//!
//! **Differs from the tree** the radius at a fork is that of the tube that comes in, which a branch that leaves it does
//! not have: a line that starts at a fork takes the radius of its own first node there.

use espalier_model::{Branch, Tree};
use glam::DVec3;

/// A polyline with its arc lengths; at least two points.
#[derive(Clone, Debug)]
pub(crate) struct Line {
    /// Nodes of the tree.
    pub(crate) nodes: Vec<usize>,
    /// RAS+ mm of its own tree.
    pub(crate) points_mm: Vec<DVec3>,
    pub(crate) radii_mm: Vec<f64>,
    /// From the start, increasing from 0.
    pub(crate) arcs_mm: Vec<f64>,
}

impl Line {
    /// The line along branches that follow on one another; `branches` has at least one.
    pub(crate) fn along<'a>(tree: &Tree, branches: impl Iterator<Item = &'a Branch>) -> Self {
        let mut nodes: Vec<usize> = Vec::new();
        for branch in branches {
            if nodes.is_empty() {
                nodes.push(branch.hub);
            }
            nodes.extend(branch.nodes.clone());
        }
        let mut radii_mm: Vec<f64> = nodes.iter().map(|&node| tree.nodes()[node].radius_mm).collect();
        if tree.children(nodes[0]).len() > 1 {
            radii_mm[0] = radii_mm[1];
        }
        let (mut arcs_mm, mut arc_mm) = (vec![0.0], 0.0);
        for &node in &nodes[1..] {
            arc_mm += tree.edge_length_mm(node);
            arcs_mm.push(arc_mm);
        }
        let points_mm = nodes.iter().map(|&node| tree.position_mm(node)).collect();
        Self { nodes, points_mm, radii_mm, arcs_mm }
    }

    pub(crate) fn length_mm(&self) -> f64 {
        self.arcs_mm[self.arcs_mm.len() - 1]
    }

    pub(crate) fn start_mm(&self) -> DVec3 {
        self.points_mm[0]
    }

    pub(crate) fn end_mm(&self) -> DVec3 {
        self.points_mm[self.points_mm.len() - 1]
    }

    pub(crate) fn end_radius_mm(&self) -> f64 {
        self.radii_mm[self.radii_mm.len() - 1]
    }

    /// The edge that holds an arc length, as the index of its outer point, and the place on it from 0 to 1.
    pub(crate) fn locate(&self, arc_mm: f64) -> (usize, f64) {
        let last = self.arcs_mm.len() - 1;
        let outer = self.arcs_mm.partition_point(|&known| known < arc_mm).clamp(1, last);
        let (low, high) = (self.arcs_mm[outer - 1], self.arcs_mm[outer]);
        // Edges have a positive length, but a sum of lengths may not feel the shortest.
        let share = if high > low { ((arc_mm - low) / (high - low)).clamp(0.0, 1.0) } else { 1.0 };
        (outer, share)
    }

    /// The point at an arc length.
    pub(crate) fn point_mm(&self, arc_mm: f64) -> DVec3 {
        let (outer, share) = self.locate(arc_mm);
        self.points_mm[outer - 1].lerp(self.points_mm[outer], share)
    }

    /// The radius at an arc length.
    pub(crate) fn radius_mm(&self, arc_mm: f64) -> f64 {
        let (outer, share) = self.locate(arc_mm);
        self.radii_mm[outer - 1] * (1.0 - share) + self.radii_mm[outer] * share
    }

    /// The mean radius between two arc lengths; that at the first where they are one.
    pub(crate) fn mean_radius_mm(&self, [from, to]: [f64; 2]) -> f64 {
        let (mut weighted, mut length) = (0.0, 0.0);
        for (arcs, radii) in self.arcs_mm.windows(2).zip(self.radii_mm.windows(2)) {
            let (low, high) = (arcs[0].max(from), arcs[1].min(to));
            if high > low && arcs[1] > arcs[0] {
                let at = |arc: f64| radii[0] + (radii[1] - radii[0]) * (arc - arcs[0]) / (arcs[1] - arcs[0]);
                weighted += (high - low) * 0.5 * (at(low) + at(high));
                length += high - low;
            }
        }
        if length > 0.0 { weighted / length } else { self.radius_mm(from) }
    }

    /// The direction in which it sets out: its chord from one to three radii of its start, or the whole chord where it
    /// is shorter than that; without a radius its first edge. 0 if it has none.
    pub(crate) fn direction_at_start(&self, hub_radius_mm: f64) -> DVec3 {
        let (near, far) = self.stretch(hub_radius_mm, self.arcs_mm[1]);
        (self.point_mm(far) - self.point_mm(near)).normalize_or_zero()
    }

    /// The direction in which it arrives, measured likewise.
    pub(crate) fn direction_at_end(&self) -> DVec3 {
        let (last, length) = (self.arcs_mm.len() - 1, self.length_mm());
        let (near, far) = self.stretch(self.end_radius_mm(), length - self.arcs_mm[last - 1]);
        (self.point_mm(length - near) - self.point_mm(length - far)).normalize_or_zero()
    }

    fn stretch(&self, radius_mm: f64, first_edge_mm: f64) -> (f64, f64) {
        let length = self.length_mm();
        if radius_mm <= 0.0 {
            return (0.0, first_edge_mm);
        }
        let far = (3.0 * radius_mm).min(length);
        if far - radius_mm < radius_mm { (0.0, length) } else { (radius_mm, far) }
    }
}
