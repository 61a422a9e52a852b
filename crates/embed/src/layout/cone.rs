//! The cone start: nested convex cones that keep the side and the order of every turn.
//!
//! **Input** the problem. **Output** the heading of each edge, radians; exact lengths.
//! **Notation** I_v the interval of directions of node v, at most 0.9π wide; h_v ∈ I_v its heading.
//! **Steps** 1. Root: half a circle for the children on each side, shared by tips, at most 0.9π each. 2. In preorder: a
//! single child goes straight on and keeps the interval. At a fork the children that turn right share the part of
//! I_v right of h_v, the others the left part, in target order, wide by tips. 3. h_v sits in I_v at the share of
//! tips that the next fork below sends right, so that every tip gets a like share.
//! **Guarantees** no crossing for **any** lengths: a convex cone is closed under addition, so the subtree of v
//! stays in x_v + cone(I_v), and sibling cones meet only at their apex. Sides and sibling order are those of the
//! targets.
//! A side without children keeps a quarter of a tip's share: at a constant share the intervals along a comb of
//! 10,000 teeth would underflow, so they shrink only by the fourth root of the number of tips.
//! **Cost** O(N log k) for forks of k children.

use std::f64::consts::PI;

use crate::problem::Problem;

/// The widest interval: convex with room to spare.
const WIDEST_RAD: f64 = 0.9 * PI;
/// What a side without children gets, in tips.
const EMPTY_SIDE_TIPS: f64 = 0.25;

/// The heading of each edge; 0 for the root.
pub(crate) fn headings(problem: &Problem) -> Vec<f64> {
    let n_nodes = problem.n_nodes();
    let n_tips = problem.n_tips_below();
    let right_share = right_shares(problem, &n_tips);
    let mut heading_rad = vec![0.0; n_nodes];
    let mut interval = vec![(0.0, 0.0); n_nodes];
    root_intervals(problem, &n_tips, &right_share, &mut interval);

    for node in 1..n_nodes {
        let (low, high) = interval[node];
        let parent = problem.parent[node] as usize;
        let is_single = parent != 0 && problem.tree.children(parent).len() == 1;
        heading_rad[node] =
            if is_single { heading_rad[parent] } else { low + right_share[node] * (high - low) };
        match problem.tree.children(node) {
            [] => {}
            &[child] => interval[child] = interval[node],
            _ => {
                let (right, left) = by_side(problem, node);
                share_out(&right, (low, heading_rad[node]), &n_tips, &mut interval);
                share_out(&left, (heading_rad[node], high), &n_tips, &mut interval);
            }
        }
    }
    heading_rad
}

/// The intervals of the root's children: those that turn right share the right half of the circle, the others
/// the left, so that this layout is a particle too; a single child points to heading 0.
fn root_intervals(problem: &Problem, n_tips: &[u32], right_share: &[f64], interval: &mut [(f64, f64)]) {
    if let &[child] = problem.tree.children(0) {
        let low = -right_share[child] * WIDEST_RAD;
        interval[child] = (low, low + WIDEST_RAD);
        return;
    }
    let (right, left) = by_side(problem, 0);
    share_out(&right, (-PI, 0.0), n_tips, interval);
    share_out(&left, (0.0, PI), n_tips, interval);
    for &child in problem.tree.children(0) {
        let (low, high) = interval[child];
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low).min(WIDEST_RAD));
        interval[child] = (middle - half, middle + half);
    }
}

/// The children that turn right and those that turn left, each in target order.
fn by_side(problem: &Problem, node: usize) -> (Vec<usize>, Vec<usize>) {
    problem.children_by_target(node).into_iter().partition(|&child| problem.side[child] < 0.0)
}

/// Where in its interval a node's heading sits: the share of tips that the next fork below it sends right.
fn right_shares(problem: &Problem, n_tips: &[u32]) -> Vec<f64> {
    let mut right_share = vec![0.5; n_tips.len()];
    for node in (0..n_tips.len()).rev() {
        match problem.tree.children(node) {
            [] => {}
            &[child] => right_share[node] = right_share[child],
            children => {
                let right: u32 =
                    children.iter().filter(|&&c| problem.side[c] < 0.0).map(|&c| n_tips[c]).sum();
                let (right, all) = (f64::from(right), f64::from(n_tips[node]));
                let least = EMPTY_SIDE_TIPS.min(0.5 * all);
                right_share[node] = (right.clamp(least, all - least)) / all;
            }
        }
    }
    right_share
}

/// Cuts an interval into one for each child, wide by tips.
fn share_out(children: &[usize], (low, high): (f64, f64), n_tips: &[u32], interval: &mut [(f64, f64)]) {
    let all: f64 = children.iter().map(|&child| f64::from(n_tips[child])).sum();
    let mut before = 0.0;
    for &child in children {
        let start = low + (high - low) * (before / all);
        before += f64::from(n_tips[child]);
        interval[child] = (start, low + (high - low) * (before / all));
    }
}
