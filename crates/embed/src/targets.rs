//! Target angles, lengths and headings: what every layout aims at.
//!
//! **Input** a tree and its views. **Output** `Targets`, one entry per node.
//! **Notation** v a node, p its parent, g its grandparent; θ = counter-clockwise angle from p → g to p → v as the
//! local plane's camera sees it, in (0, 2π); φ the same angle in space, in [0, π].
//! **Steps** 1. θ of each node in its local plane: that of its branching set if p is a fork, of its chain if not.
//! 2. `intrinsic`: keep the side, take the magnitude from φ. 3. Move siblings apart. 4. Root children: a virtual
//! grandparent in the middle of the largest gap. 5. Headings in the global view, with their confidence.
//! **Guarantees** θ in [0.02, 2π − 0.02]; under `intrinsic` siblings at least min(0.05, π / (k + 1)) apart.
//! **Source** [Hu2022] section 3.2.1.
//! **Differs from the source** `intrinsic`: any tree's lengths and unsigned bends can be drawn exactly in the
//! plane, while a projection loses some degrees before the layout begins. Siblings on one side stand in the order
//! of their exact angles, and in the view's order where those are equal: the view's order everywhere would force
//! pairs with swapped magnitudes to one angle. Fold-backs are opened to 0.02 under `projected` too, since θ = 0
//! has no relative loss.
//! **Cost** O(N log k) for forks of k children.

use std::f64::consts::{PI, TAU};

use espalier_geom::angle::{between, ccw, heading, wrap_positive};
use espalier_model::{Branches, Targets, Tree, View, ViewHierarchy};
use glam::{DVec2, DVec3};

use crate::choices::TargetMode;
use crate::error::Error;
use crate::siblings;

/// A projection shorter than this share of its vector has no direction.
const VANISHING: f64 = 1e-9;

/// The targets of every node.
pub(crate) fn targets(
    tree: &Tree,
    branches: &Branches,
    views: &ViewHierarchy,
    mode: TargetMode,
) -> Result<Targets, Error> {
    check_views(tree, branches, views)?;
    let n_nodes = tree.n_nodes();
    let mut angle_rad = vec![f64::NAN; n_nodes];
    root_angles(tree, views, &mut angle_rad);
    for (node, parent) in tree.edges().filter(|&(_, parent)| parent != 0) {
        let plane = match (views.forks[parent], branches.of_node(node)) {
            (Some(fork), _) => fork.view,
            (None, Some(branch)) => views.chains[branch].view,
            (None, None) => views.global,
        };
        angle_rad[node] = angle_in_plane(tree, node, parent, &plane);
    }

    let view_angle_rad = angle_rad.clone();
    if mode == TargetMode::Intrinsic {
        for (node, parent) in tree.edges().filter(|&(_, parent)| parent != 0) {
            let interior = interior_angle(tree, node, parent);
            angle_rad[node] = if angle_rad[node] <= PI { interior } else { TAU - interior };
        }
        for node in 0..n_nodes {
            siblings::separate(tree.children(node), &view_angle_rad, &mut angle_rad);
        }
    }
    for angle in &mut angle_rad[1..] {
        *angle = angle.clamp(siblings::MARGIN_RAD, TAU - siblings::MARGIN_RAD);
    }

    let (heading_rad, confidence) = global_headings(tree, &views.global);
    let length_mm = (0..n_nodes).map(|node| tree.edge_length_mm(node)).collect();
    Ok(Targets { kind: mode.into(), angle_rad, length_mm, heading_rad, confidence })
}

fn check_views(tree: &Tree, branches: &Branches, views: &ViewHierarchy) -> Result<(), Error> {
    if views.tree != tree.digest() {
        return Err(Error::OtherTree);
    }
    let check = |what, n_found, n_expected| {
        if n_found == n_expected { Ok(()) } else { Err(Error::Views { what, n_found, n_expected }) }
    };
    check("planes of branches", views.chains.len(), branches.list().len())?;
    check("entries for nodes", views.forks.len(), tree.n_nodes())?;
    let n_forks = (0..tree.n_nodes()).filter(|&node| tree.children(node).len() > 1).count();
    let n_planes = (0..tree.n_nodes())
        .filter(|&node| tree.children(node).len() > 1 && views.forks[node].is_some())
        .count();
    check("planes of forks", n_planes, n_forks)
}

/// θ as the camera of the plane sees it; straight where the plane shows one of the two edges end-on.
fn angle_in_plane(tree: &Tree, node: usize, parent: usize, plane: &View) -> f64 {
    let Some(grandparent) = tree.parent(parent) else { return PI };
    let hub = tree.position_mm(parent);
    let (back, ahead) = (tree.position_mm(grandparent) - hub, tree.position_mm(node) - hub);
    let (flat_back, flat_ahead) = (plane.project(back), plane.project(ahead));
    let is_seen = |flat: DVec2, solid: DVec3| flat.length() > VANISHING * solid.length();
    if is_seen(flat_back, back) && is_seen(flat_ahead, ahead) { ccw(flat_back, flat_ahead) } else { PI }
}

/// The angle at `parent` between its own parent and `node` in space, in [0, π]; π where there is none.
pub(crate) fn interior_angle(tree: &Tree, node: usize, parent: usize) -> f64 {
    let Some(grandparent) = tree.parent(parent) else { return PI };
    let hub = tree.position_mm(parent);
    between(tree.position_mm(grandparent) - hub, tree.position_mm(node) - hub)
}

/// Angles of the root's children from the middle of the largest gap between them.
fn root_angles(tree: &Tree, views: &ViewHierarchy, angle_rad: &mut [f64]) {
    let children = tree.children(0);
    let plane = views.forks[0].map_or(views.global, |fork| fork.view);
    let hub = tree.position_mm(0);
    let seen = |child: usize| heading(plane.project(tree.position_mm(child) - hub));
    let mut headings: Vec<(f64, usize)> = children.iter().map(|&child| (seen(child), child)).collect();
    headings.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));

    // The gap after the last one closes the circle; of equal gaps the first counts.
    let (mut back, mut largest) = (0.0, -1.0);
    for (idx, &(start, _)) in headings.iter().enumerate() {
        let end = headings.get(idx + 1).map_or(headings[0].0 + TAU, |next| next.0);
        if end - start > largest {
            (back, largest) = (0.5 * (start + end), end - start);
        }
    }
    for (angle, child) in headings {
        angle_rad[child] = wrap_positive(angle - back);
    }
}

/// The heading of each edge in the global view, and how much of its length that view shows.
fn global_headings(tree: &Tree, global: &View) -> (Vec<f64>, Vec<f64>) {
    let (mut heading_rad, mut confidence) = (vec![0.0; tree.n_nodes()], vec![0.0; tree.n_nodes()]);
    for (node, parent) in tree.edges() {
        let edge = tree.position_mm(node) - tree.position_mm(parent);
        let flat = global.project(edge);
        heading_rad[node] = heading(flat);
        confidence[node] = (flat.length() / edge.length()).min(1.0);
    }
    (heading_rad, confidence)
}
