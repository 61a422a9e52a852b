//! The tree as its best global view shows it.
//!
//! **Input** tree and global view. **Output** orthographic picture coordinates, root at the origin.
//! **Guarantees** none about crossings: it shows what a single view costs.
//! **Cost** O(N).

use espalier_model::View;
use glam::DVec2;

use crate::problem::Problem;

/// The projected positions.
pub(crate) fn positions(problem: &Problem, global: &View) -> Vec<DVec2> {
    let root = problem.tree.position_mm(0);
    problem.tree.nodes().iter().map(|node| global.project(node.position_mm - root)).collect()
}
