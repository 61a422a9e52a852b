//! The tree strung together from its angles: where each edge heads in the picture.
//!
//! **Input** a tree and its planes. **Output** headings, radians counter-clockwise from the right; and how far they
//! are from those of the global view.
//! **Notation** for each node: h the heading of its edge in the picture, H its heading in the global view, P its
//! edge as the global view shows it, so |P| = conf · l; τ = θ − π its turn, θ as in section 3.2.1.
//! **Steps** a child of the root heads as the root's plane shows it; any other node as its parent plus its turn.
//! The magnitude of τ is the exact bend in space, its sign is what the plane of its set shows.
//! **Source** [Hu2022] section 3.2.1.
//! **Differs from the source** in the magnitude of τ, which the paper takes from the plane too.
//! **Cost** O(N).

use espalier_geom::{angle, math};
use espalier_model::{Branches, Tree, View, ViewHierarchy};
use glam::{DVec2, DVec3};

/// The edge that leads to a node; none for the root.
fn edge_mm(tree: &Tree, node: usize) -> Option<DVec3> {
    tree.parent(node).map(|parent| tree.position_mm(node) - tree.position_mm(parent))
}

/// P by node: its edge as a view shows it, in mm; 0 for the root.
pub(crate) fn edges_seen_mm(tree: &Tree, view: &View) -> Vec<DVec2> {
    (0..tree.n_nodes())
        .map(|node| edge_mm(tree, node).map_or(DVec2::ZERO, |edge| view.project(edge)))
        .collect()
}

/// The turn τ at the parent of `node`: the exact bend in space, positive to the left in the view.
pub(crate) fn turn_rad(tree: &Tree, view: &View, node: usize) -> f64 {
    let incoming = tree.parent(node).and_then(|parent| edge_mm(tree, parent));
    let (Some(outgoing), Some(incoming)) = (edge_mm(tree, node), incoming) else { return 0.0 };
    let bend = angle::between(incoming, outgoing);
    let is_left = view.project(incoming).perp_dot(view.project(outgoing)) > 0.0;
    if is_left { bend } else { -bend }
}

/// The heading of a child of the root as the root's plane shows it; 0 for an only child, which has no plane.
pub(crate) fn heading_at_root_rad(tree: &Tree, views: &ViewHierarchy, child: usize) -> f64 {
    let seen = views.forks[0].zip(edge_mm(tree, child)).map(|(plane, edge)| plane.view.project(edge));
    seen.map_or(0.0, angle::heading)
}

/// How far the angles strung together are from the global view: 1 − |Σ P e^{−ih}| / Σ |P|, which is
/// Σ conf · l (1 − cos(h − H)) / Σ conf · l after the best rotation of the whole. 0 if they reproduce it, near 1 for
/// headings at random.
pub(crate) fn heading_mismatch(tree: &Tree, branches: &Branches, views: &ViewHierarchy) -> f64 {
    let mut heading_rad = vec![0.0; tree.n_nodes()];
    for (branch, chain) in branches.list().iter().zip(&views.chains) {
        let first = branch.nodes.start;
        heading_rad[first] = match &views.forks[branch.hub] {
            Some(fork) if branch.hub > 0 => heading_rad[branch.hub] + turn_rad(tree, &fork.view, first),
            _ => heading_at_root_rad(tree, views, first),
        };
        for node in branch.nodes.clone().skip(1) {
            heading_rad[node] = heading_rad[node - 1] + turn_rad(tree, &chain.view, node);
        }
    }
    let (mut sum, mut total) = (DVec2::ZERO, 0.0);
    for (seen, heading) in edges_seen_mm(tree, &views.global).into_iter().zip(heading_rad) {
        sum += math::unit_vector(-heading).rotate(seen);
        total += seen.length();
    }
    if total > 0.0 { 1.0 - sum.length() / total } else { 0.0 }
}
