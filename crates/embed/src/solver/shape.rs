//! A layout by its ratios, as the solver changes it.
//!
//! **Notation** r_l one length ratio per segment, r_a one angle ratio per node (freedom `n`); the root's children
//! have an angle ratio too, against heading 0, which costs nothing.
//! **Guarantees** ratios in range; the side of every turn is that of the target.
//! **Source** Eq. 3 and Eq. 4 of [Hu2022]. **Cost** O(N).

use espalier_geom::math;
use glam::DVec2;

use crate::place;
use crate::problem::Problem;
use crate::ratio;

/// A layout by its ratios.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Shape {
    /// r_l of each segment, in [−0.97, 1].
    pub(crate) length_ratio: Vec<f64>,
    /// r_a of each node, in [−0.97, 1]; that of the root is 0.
    pub(crate) angle_ratio: Vec<f64>,
}

impl Shape {
    /// The targets themselves.
    pub(crate) fn targets(problem: &Problem) -> Self {
        Self {
            length_ratio: vec![0.0; problem.branches.list().len()],
            angle_ratio: vec![0.0; problem.n_nodes()],
        }
    }

    /// Exact lengths and given headings, which keep the sides of the targets.
    ///
    /// No edge is folded onto its parent's; children of the root have none to be folded onto.
    pub(crate) fn from_headings(problem: &Problem, heading_rad: &[f64]) -> Self {
        let (low, high) = ratio::ANGLE_RANGE;
        let mut angle_ratio = place::angle_ratios(problem, heading_rad);
        for (ratio, &parent) in angle_ratio.iter_mut().zip(&problem.parent) {
            *ratio = ratio.clamp(if parent == 0 { -1.0 } else { low }, high);
        }
        Self { angle_ratio, ..Self::targets(problem) }
    }

    /// The turn of a node's edge against its parent's, in radians.
    pub(crate) fn turn_rad(&self, problem: &Problem, node: usize) -> f64 {
        problem.side[node] * ratio::embedded_bend(problem.bend[node], self.angle_ratio[node])
    }

    /// The length of a node's edge, in mm.
    pub(crate) fn length_mm(&self, problem: &Problem, node: usize) -> f64 {
        problem.targets.length_mm[node] * (1.0 + self.length_ratio[problem.branch[node] as usize])
    }

    /// Headings of all edges, radians, not wrapped; 0 for the root.
    pub(crate) fn headings(&self, problem: &Problem) -> Vec<f64> {
        let mut heading_rad = vec![0.0; problem.n_nodes()];
        for node in 1..problem.n_nodes() {
            heading_rad[node] = heading_rad[problem.parent[node] as usize] + self.turn_rad(problem, node);
        }
        heading_rad
    }

    /// Positions of all nodes, plane mm, the root at the origin.
    pub(crate) fn positions(&self, problem: &Problem) -> Vec<DVec2> {
        let heading_rad = self.headings(problem);
        let mut positions = vec![DVec2::ZERO; problem.n_nodes()];
        for node in 1..problem.n_nodes() {
            positions[node] = positions[problem.parent[node] as usize]
                + math::unit_vector(heading_rad[node]) * self.length_mm(problem, node);
        }
        positions
    }

    /// The length and angle terms of the energy (Eq. 4).
    pub(crate) fn loss(&self, problem: &Problem) -> f64 {
        (1..problem.n_nodes())
            .map(|node| {
                let (r_l, r_a) = (self.length_ratio[problem.branch[node] as usize], self.angle_ratio[node]);
                problem.length_cost[node] * (r_l * r_l) + problem.angle_cost[node] * (r_a * r_a)
            })
            .sum()
    }
}
