//! Whether there is room at all: a proof by areas that tubes are too thick for exact lengths.
//!
//! **Input** the tree with radii. **Output** the area that tubes cover at least, and the area there is.
//! **Notation** H the longest path from the root to a tip, w_max the largest width.
//! **Steps** 1. With exact lengths every node lies within H of the root, so all is in a disc of π (H + w_max / 2)².
//! 2. Edges are picked along each branch, far enough apart along the tree that no two of them may merge: from a fork
//! as far as its largest junction disc, from each other twice the sum of their radii, which is the disc of a chain.
//! Their capsules are disjoint in any layout without overlaps, so their areas add up.
//! **Guarantees** if more is needed than there is, no layout has exact lengths and tubes that merge only near forks:
//! forks narrower than 20° count as 20°, for what runs on side by side does not part. Less says nothing.
//! **Source** ours. **Cost** O(N).

use std::f64::consts::PI;

use super::overlap::disc_radius;
use crate::problem::Problem;

/// The narrowest gap of a fork.
const NARROWEST_RAD: f64 = PI / 9.0;

/// The area that tubes need at least, and what is available, in mm².
pub(super) fn needed_and_available(problem: &Problem) -> (f64, f64) {
    let nodes = problem.tree.nodes();
    let length = &problem.targets.length_mm;
    let mut depth = vec![0.0; problem.n_nodes()];
    let mut radius = vec![0.0; problem.n_nodes()];
    for node in 1..problem.n_nodes() {
        let parent = problem.parent[node] as usize;
        depth[node] = depth[parent] + length[node];
        radius[node] = 0.5 * (nodes[node].radius_mm + nodes[parent].radius_mm);
    }
    let thickest = radius.iter().copied().fold(0.0, f64::max);
    let reach = depth.iter().copied().fold(0.0, f64::max) + thickest;

    let mut needed = 0.0;
    for branch in problem.branches.list() {
        let (start, end) = (depth[branch.hub] + margin(problem, &radius, branch.hub), depth[branch.end()]);
        let end = end - margin(problem, &radius, branch.end());
        let mut free_from = start;
        let mut last_radius = 0.0;
        for node in branch.nodes.clone() {
            let (from, to, r) = (depth[node] - length[node], depth[node], radius[node]);
            // Far enough from both forks for its own width, and from the last one picked.
            let spacing = if last_radius > 0.0 { 2.0 * (last_radius + r) } else { 0.0 };
            let is_clear = from >= free_from + spacing && from >= depth[branch.hub] + r;
            if r > 0.0
                && is_clear
                && to <= end
                && (to <= depth[branch.end()] - r || is_tip(problem, branch.end()))
            {
                needed += PI * r * r + 2.0 * r * length[node];
                (free_from, last_radius) = (to, r);
            }
        }
    }
    (needed, PI * reach * reach)
}

fn is_tip(problem: &Problem, node: usize) -> bool {
    problem.tree.children(node).is_empty()
}

/// How far from a node where branches part tubes may merge: its largest junction disc; none at a tip.
fn margin(problem: &Problem, radius: &[f64], node: usize) -> f64 {
    let children = problem.tree.children(node).iter().copied();
    // The two thickest arms; the edge above the node is one of them.
    let arms = children.chain((node != 0).then_some(node));
    let (mut first, mut second) = (0.0, 0.0);
    for r in arms.map(|arm| radius[arm]) {
        if r > first {
            (first, second) = (r, first);
        } else if r > second {
            second = r;
        }
    }
    if is_tip(problem, node) { 0.0 } else { disc_radius(NARROWEST_RAD, first, second) }
}
