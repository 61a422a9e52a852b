//! From ratios, or from headings, to positions.
//!
//! **Input** one heading and one length per edge. **Output** node positions in plane mm, the root at the origin.
//! **Steps** walk the nodes in preorder: a node lies at its parent plus its length along its heading.
//! **Cost** O(N), no stack: parents stand before their children.

use espalier_geom::angle;
use espalier_geom::math;
use glam::DVec2;

use crate::problem::Problem;
use crate::ratio;

/// Positions from headings, with the exact lengths.
pub(crate) fn from_headings(problem: &Problem, heading_rad: &[f64]) -> Vec<DVec2> {
    let mut positions = vec![DVec2::ZERO; problem.n_nodes()];
    for node in 1..problem.n_nodes() {
        let parent = problem.parent[node] as usize;
        positions[node] =
            positions[parent] + math::unit_vector(heading_rad[node]) * problem.targets.length_mm[node];
    }
    positions
}

/// The heading of each edge, radians; an edge without length goes on like its parent's. 0 for the root.
pub(crate) fn headings(problem: &Problem, positions: &[DVec2]) -> Vec<f64> {
    let mut heading_rad = vec![0.0; positions.len()];
    for node in 1..positions.len() {
        let parent = problem.parent[node] as usize;
        let edge = positions[node] - positions[parent];
        heading_rad[node] = if edge == DVec2::ZERO { heading_rad[parent] } else { angle::heading(edge) };
    }
    heading_rad
}

/// The turn of each edge against its parent's edge, in [−π, π); 0 for the root and its children.
pub(crate) fn turns(problem: &Problem, heading_rad: &[f64]) -> Vec<f64> {
    let turn = |node: usize| match problem.parent[node] as usize {
        0 => 0.0,
        parent => angle::wrap(heading_rad[node] - heading_rad[parent]),
    };
    (0..heading_rad.len()).map(turn).collect()
}

/// The angle ratio of each edge, 0 for the root. Children of the root have one too, against heading 0: it costs
/// nothing, but a particle must have it to be the same layout.
pub(crate) fn angle_ratios(problem: &Problem, heading_rad: &[f64]) -> Vec<f64> {
    let mut ratios = vec![0.0; heading_rad.len()];
    for node in 1..heading_rad.len() {
        let turn_rad = heading_rad[node] - heading_rad[problem.parent[node] as usize];
        ratios[node] = ratio::angle_ratio(problem.targets.angle_rad[node], turn_rad);
    }
    ratios
}
