//! What angles along branches do not see: siblings, chords, what points backward, the box.
//!
//! **Input** positions, headings. **Output** summaries.
//! **Siblings** |γ − γ_e| for pairs of edges with a common upper node, γ their angle in space, γ_e in the plane, both in
//! [0, π]. Forks of the root count: the angles at the root that have no loss in the energy are the angles between its
//! edges. Of forks with more than 64 edges only pairs at most 32 apart in the tree's order, for a star of 10,000 has 50
//! million.
//! **Chords** |c − c_e| / max(c, L/20) for each branch of length L, c the distance between its ends in space: bends that
//! are each exact make a zigzag of an arc where their sides change, and only this sees it.
//! **Backward** the share of Σ conf · l whose edges point over 90° off their heading H in the global view. The whole is
//! turned first, and reflected where that is better, as `pose` does: so that Σ conf · l · cos(h − H) is largest. An edge
//! that the view shows end-on has no heading and no weight.
//! **Cost** O(N).

use std::f64::consts::PI;

use espalier_geom::{angle, math};
use glam::DVec2;

use super::Summary;
use crate::pose;
use crate::problem::Problem;

/// The largest fork of which all pairs are compared.
const MOST_SIBLINGS: usize = 64;
/// How far apart in larger forks siblings may stand.
const SIBLING_REACH: usize = 32;
/// The least denominator of a chord's error, as a share of the branch's length.
const CHORD_GUARD: f64 = 0.05;

/// Errors of the angles between siblings, in degrees.
pub(super) fn sibling_errors_deg(problem: &Problem, positions: &[DVec2]) -> Summary {
    let tree = problem.tree;
    let mut errors = Summary::default();
    for hub in 0..positions.len() {
        let children = tree.children(hub);
        let reach = if children.len() > MOST_SIBLINGS { SIBLING_REACH } else { MOST_SIBLINGS };
        for (idx, &a) in children.iter().enumerate() {
            for &b in children[idx + 1..].iter().take(reach) {
                let solid = |node: usize| tree.position_mm(node) - tree.position_mm(hub);
                let flat = |node: usize| (positions[node] - positions[hub]).extend(0.0);
                let error = angle::between(solid(a), solid(b)) - angle::between(flat(a), flat(b));
                errors.add(error.abs().to_degrees());
            }
        }
    }
    errors
}

/// Relative errors of the chords of branches.
pub(super) fn chord_errors(problem: &Problem, positions: &[DVec2]) -> Summary {
    let tree = problem.tree;
    let mut errors = Summary::default();
    for branch in problem.branches.list() {
        let length_mm: f64 = branch.nodes.clone().map(|node| problem.targets.length_mm[node]).sum();
        let solid = tree.position_mm(branch.end()).distance(tree.position_mm(branch.hub));
        let flat = positions[branch.end()].distance(positions[branch.hub]);
        errors.add((solid - flat).abs() / solid.max(CHORD_GUARD * length_mm));
    }
    errors
}

/// The share of the seen length that points backward.
pub(super) fn backward_share(problem: &Problem, heading_rad: &[f64]) -> f64 {
    let mirrored_rad: Vec<f64> = heading_rad.iter().map(|h| PI - h).collect();
    let (agreement, weight) = pose::agreement(problem, heading_rad);
    let (mirrored, _) = pose::agreement(problem, &mirrored_rad);
    let is_reflected = pose::is_reflected(agreement, mirrored, weight);
    let (heading_rad, agreement) =
        if is_reflected { (&mirrored_rad[..], mirrored) } else { (heading_rad, agreement) };
    let rotation_rad = angle::heading(agreement);
    let mut backward = 0.0;
    for (node, h) in heading_rad.iter().enumerate().skip(1) {
        let off_rad = h + rotation_rad - problem.targets.heading_rad[node];
        if math::cos(off_rad) < 0.0 {
            backward += problem.targets.confidence[node] * problem.targets.length_mm[node];
        }
    }
    if weight > 0.0 { backward / weight } else { 0.0 }
}

/// Area of the upright box, and its shorter over its longer side.
pub(super) fn bounding_box(positions: &[DVec2]) -> (f64, f64) {
    let low = positions.iter().fold(DVec2::INFINITY, |low, &p| low.min(p));
    let size = positions.iter().fold(DVec2::NEG_INFINITY, |high, &p| high.max(p)) - low;
    let longer = size.max_element();
    (size.x * size.y, if longer > 0.0 { size.min_element() / longer } else { 0.0 })
}
