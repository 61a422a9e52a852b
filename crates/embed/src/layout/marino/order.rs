//! The order of the children around each fork, as the view shows their subtrees.
//!
//! **Input** the tree as seen. **Output** the children of every node, counter-clockwise.
//! **Notation** dist = path in space from the fork; δ_c = the longest dist below child c; d = the least δ_c.
//! **Steps** 1. δ by one pass from the tips. 2. At a fork, m_c = mean of the seen positions of the subtree of c within
//! d, weight 1 − dist/d, so that a far end counts as little as the near shape allows. 3. Sort by the counter-clockwise
//! angle at the fork from the direction *back to the parent* to m_c. Measured from the direction ahead, siblings swap
//! sides: 4.7° of residual in place of 1.7° on a neuron of 235 nodes.
//! **Differs from the source** see `marino`. A subtree of which nothing counts stands where its first edge points.
//! **Cost** O(nodes within d of their forks): N log N for balanced trees.

use std::f64::consts::PI;

use espalier_geom::angle::{ccw, wrap_positive};
use espalier_geom::math;
use glam::DVec2;

use super::Seen;
use crate::problem::Problem;

/// What orders children.
pub(super) struct Order<'a> {
    problem: &'a Problem<'a>,
    seen: &'a Seen,
    /// The longest path below each node, in mm.
    reach_mm: Vec<f64>,
}

impl<'a> Order<'a> {
    pub(super) fn new(problem: &'a Problem<'a>, seen: &'a Seen) -> Self {
        Self { problem, seen, reach_mm: reaches(problem) }
    }

    /// The children of a node in order.
    pub(super) fn children(&self, fork: usize) -> Vec<usize> {
        let Self { problem, seen, .. } = *self;
        let children = problem.tree.children(fork).to_vec();
        if children.len() < 2 {
            return children;
        }
        let below_mm = |&child: &usize| self.reach_mm[child] + problem.targets.length_mm[child];
        let within_mm = children.iter().map(below_mm).fold(f64::INFINITY, f64::min);
        // The root has no parent: any start gives the same cyclic order.
        let back_rad = seen.ahead_rad[fork] + PI;
        let back = math::unit_vector(back_rad);
        let angle = |child: usize| {
            let middle = self.middle((fork, child), within_mm);
            if middle == DVec2::ZERO {
                wrap_positive(seen.ahead_rad[child] - back_rad)
            } else {
                ccw(back, middle)
            }
        };
        let mut keyed: Vec<(f64, usize)> = children.into_iter().map(|child| (angle(child), child)).collect();
        keyed.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        keyed.into_iter().map(|(_, child)| child).collect()
    }

    /// m_c from the fork, times the sum of weights; zero if nothing counts.
    fn middle(&self, (fork, child): (usize, usize), within_mm: f64) -> DVec2 {
        let Self { problem, seen, .. } = *self;
        let end = problem.tree.subtree(child).end;
        let mut sum = DVec2::ZERO;
        // The path from the fork is known for the nodes above the next one only: nodes stand in preorder.
        let mut path: Vec<(usize, f64)> = vec![(fork, 0.0)];
        let mut node = child;
        while node < end {
            let parent = problem.parent[node] as usize;
            while path.last().is_some_and(|&(above, _)| above != parent) {
                path.pop();
            }
            let here_mm = path.last().map_or(0.0, |&(_, mm)| mm) + problem.targets.length_mm[node];
            if here_mm >= within_mm {
                node = problem.tree.subtree(node).end;
                continue;
            }
            sum += (1.0 - here_mm / within_mm) * (seen.positions[node] - seen.positions[fork]);
            path.push((node, here_mm));
            node += 1;
        }
        sum
    }
}

/// The longest path below each node, in mm.
fn reaches(problem: &Problem) -> Vec<f64> {
    let mut reach_mm = vec![0.0_f64; problem.n_nodes()];
    for node in (1..reach_mm.len()).rev() {
        let parent = problem.parent[node] as usize;
        reach_mm[parent] = reach_mm[parent].max(reach_mm[node] + problem.targets.length_mm[node]);
    }
    reach_mm
}
