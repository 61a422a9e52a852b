//! How well the planes show the angles of the tree.
//!
//! **Input** a tree and its planes. **Output** the mean of |φ_plane − φ| over nodes, φ the interior angle at the
//! parent in space, φ_plane the same angle as the plane of its set shows it.
//! **Source** the target angles of [Hu2022] section 3.2.1; Metric 2 of section 5 compares with φ.
//! **Cost** O(N).

use espalier_geom::angle;
use espalier_model::{Branches, Tree, View, ViewHierarchy};

/// Mean angle errors of the planes, in degrees; 0 where there is nothing to measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Recovery {
    /// Over the inner nodes of chains.
    pub(crate) chain_error_mean_deg: f64,
    /// Over the children of forks that have a parent.
    pub(crate) fork_error_mean_deg: f64,
}

/// Measures how well the planes show the angles of the tree.
pub(crate) fn recovery(tree: &Tree, branches: &Branches, views: &ViewHierarchy) -> Recovery {
    let chains = views.chains.iter().zip(branches.list()).flat_map(|(plane, branch)| {
        branch.nodes.clone().skip(1).filter_map(|node| error_rad(tree, &plane.view, node))
    });
    let forks = views.forks.iter().enumerate().filter_map(|(fork, plane)| Some((fork, plane.as_ref()?)));
    let forks = forks.flat_map(|(fork, plane)| {
        tree.children(fork).iter().filter_map(|&child| error_rad(tree, &plane.view, child))
    });
    Recovery {
        chain_error_mean_deg: mean(chains).to_degrees(),
        fork_error_mean_deg: mean(forks).to_degrees(),
    }
}

/// The error of the angle at the parent of `node`; `None` where there is no grandparent.
fn error_rad(tree: &Tree, view: &View, node: usize) -> Option<f64> {
    let parent = tree.parent(node)?;
    let to_grandparent = tree.position_mm(tree.parent(parent)?) - tree.position_mm(parent);
    let to_node = tree.position_mm(node) - tree.position_mm(parent);
    let in_plane = view.project(to_grandparent).extend(0.0).normalize_or_zero();
    let shown = angle::between(in_plane, view.project(to_node).extend(0.0));
    Some((shown - angle::between(to_grandparent, to_node)).abs())
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0_usize), |(sum, n), value| (sum + value, n + 1));
    sum / n.max(1) as f64
}
