//! Radial layout with equal angles: each tip gets the same share of the circle.
//!
//! **Input** the problem. **Output** the heading of each edge, radians; exact lengths.
//! **Notation** ω_c = 2π · tips(c) / tips(root), the wedge of child c.
//! **Steps** in preorder: cut a node's wedge into its children's, in the order of their target angles; each child
//! lies on the bisector of its wedge, so a chain is straight.
//! **Guarantees** no crossing for any positive lengths: either side of an edge stays in its own wedge or in the
//! complement of it, and one of the two is convex.
//! **Source** the equal-angle drawing of trees; [Hu2022] takes it, by way of [Marino2015], as the start P_1.
//! **Cost** O(N log k) for forks of k children.

use std::f64::consts::{PI, TAU};

use crate::problem::Problem;

/// The heading of each edge; 0 for the root.
pub(crate) fn headings(problem: &Problem) -> Vec<f64> {
    headings_in_order(problem, |node| problem.children_by_target(node))
}

/// The heading of each edge, with the children of each node in an order that is given.
pub(crate) fn headings_in_order(problem: &Problem, children: impl Fn(usize) -> Vec<usize>) -> Vec<f64> {
    let n_nodes = problem.n_nodes();
    let n_tips = problem.n_tips_below();
    let share_rad = TAU / f64::from(n_tips[0]);
    let mut heading_rad = vec![0.0; n_nodes];
    // Wedges start at whole tips: counting tips keeps the borders of nested wedges equal to the last bit.
    let mut first_tip = vec![0_u32; n_nodes];
    for node in 0..n_nodes {
        let mut tip = first_tip[node];
        for child in children(node) {
            first_tip[child] = tip;
            heading_rad[child] = (f64::from(tip) + 0.5 * f64::from(n_tips[child])) * share_rad - PI;
            tip += n_tips[child];
        }
    }
    heading_rad
}
