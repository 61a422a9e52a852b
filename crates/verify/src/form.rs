//! Losses of form: angles between siblings, chords of branches, what points backward, the box.
//!
//! **Input** tree, targets, positions, directions. **Output** numbers, of those that a comparison decides a range.
//! **Definitions** as documented for the columns of `compare.tsv`. **Cost** O(N).

use espalier_geom::math;
use espalier_model::{Branches, Targets, Tree};
use glam::{DVec2, DVec3};

use crate::flat::{Flat, angle_between};

/// Of forks with more edges, only pairs that stand near each other are compared.
const LARGE_FORK: usize = 64;
/// How near.
const REACH: usize = 32;
/// A chord counts as at least this share of its branch.
const SHORTEST_CHORD: f64 = 0.05;
/// Cosines, and sums of weights, nearer to 0 than this share are left open.
const OPEN: f64 = 1e-9;

/// |γ − γ_e| in degrees of pairs of siblings.
pub(crate) fn sibling_errors_deg(tree: &Tree, positions: &[DVec2]) -> Vec<f64> {
    let angle = |u: DVec3, v: DVec3| if u.length() * v.length() > 0.0 { angle_between(u, v) } else { 0.0 };
    let mut errors = Vec::new();
    for hub in 0..tree.n_nodes() {
        let children = tree.children(hub);
        let space = |node: usize| tree.position_mm(node) - tree.position_mm(hub);
        let plane = |node: usize| (positions[node] - positions[hub]).extend(0.0);
        for (i, &a) in children.iter().enumerate() {
            for (j, &b) in children.iter().enumerate().skip(i + 1) {
                if children.len() > LARGE_FORK && j - i > REACH {
                    break;
                }
                let error = angle(space(a), space(b)) - angle(plane(a), plane(b));
                errors.push(error.abs() * (180.0 / std::f64::consts::PI));
            }
        }
    }
    errors
}

/// |c − c_e| / c of branches.
pub(crate) fn chord_errors(tree: &Tree, branches: &Branches, positions: &[DVec2]) -> Vec<f64> {
    let error = |branch: &espalier_model::Branch| {
        let (from, to) = (branch.hub, branch.nodes.end - 1);
        let length_mm: f64 = branch.nodes.clone().map(|node| tree.edge_length_mm(node)).sum();
        let space = (tree.position_mm(to) - tree.position_mm(from)).length();
        let plane = (positions[to] - positions[from]).length();
        (plane - space).abs() / space.max(SHORTEST_CHORD * length_mm)
    };
    branches.list().iter().map(error).collect()
}

/// The share of the seen length that points backward, and by how much it may be off where an edge points straight
/// to the side, or where the layout and its mirror image agree as well with the view.
pub(crate) fn backward_share(targets: &Targets, flat: &Flat) -> (f64, f64) {
    let weight = |node: usize| targets.confidence[node] * targets.length_mm[node];
    let seen = |node: usize| math::unit_vector(targets.heading_rad[node]);
    let n_nodes = flat.direction.len();
    let total: f64 = (1..n_nodes).map(weight).sum();
    if total <= 0.0 {
        return (0.0, 0.0);
    }
    let measure = |image: f64| {
        let drawn = |node: usize| DVec2::new(image * flat.direction[node].x, flat.direction[node].y);
        // Σ w e^{i(H − h)}: its direction is the rotation, its length the agreement.
        let agreement: DVec2 = (1..n_nodes)
            .map(|node| {
                weight(node) * DVec2::new(drawn(node).dot(seen(node)), drawn(node).perp_dot(seen(node)))
            })
            .sum();
        let turn = if agreement == DVec2::ZERO { DVec2::X } else { agreement / agreement.length() };
        let (mut backward, mut open) = (0.0, 0.0);
        for node in 1..n_nodes {
            let cosine = turn.rotate(drawn(node)).dot(seen(node));
            if cosine < -OPEN {
                backward += weight(node);
            } else if cosine < OPEN {
                open += weight(node);
            }
        }
        (agreement.length(), (backward / total, open / total))
    };
    let (as_is, (own, own_open)) = measure(1.0);
    let (reflected, (mirrored, mirrored_open)) = measure(-1.0);
    let lead = (reflected - as_is) / total;
    if lead.abs() <= 2.0 * OPEN {
        (own, own_open + (own - mirrored).abs() + mirrored_open)
    } else if lead > 0.0 {
        (mirrored, mirrored_open)
    } else {
        (own, own_open)
    }
}

/// Area and aspect of the upright box.
pub(crate) fn bounding_box(positions: &[DVec2]) -> (f64, f64) {
    let span = |of: fn(&DVec2) -> f64| {
        let (low, high) = positions
            .iter()
            .map(of)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        high - low
    };
    let (width, height) = (span(|p| p.x), span(|p| p.y));
    let longer = width.max(height);
    (width * height, if longer > 0.0 { width.min(height) / longer } else { 0.0 })
}
