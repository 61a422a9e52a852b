//! Random trees of eight families and plain views, for all tests of the crate.
#![allow(dead_code, reason = "each test file uses a part of it")]
#![allow(clippy::expect_used, reason = "a test that cannot go on says why")]

use espalier_geom::math;
use espalier_geom::random::{Purpose, Stream};
use espalier_geom::space::plane_axes;
use espalier_model::{LocalPlane, Node, SubtreeView, Tree, View, ViewHierarchy};
use glam::DVec3;

/// The names of the families of [`random_tree`].
pub(crate) const FAMILIES: [&str; 8] =
    ["recursive", "binary", "comb", "star", "caterpillar", "broom", "spider", "chains"];

/// A stream for tests.
pub(crate) fn stream(key: u32) -> Stream {
    Stream::new(1, Purpose::Test, key, 0)
}

/// The parent of each of `n` nodes in one of the families.
fn parents(family: usize, n: usize, stream: &mut Stream) -> Vec<Option<usize>> {
    let mut below = |n: usize| stream.below(n as u32) as usize;
    let parent = |node: usize| match family {
        0 => below(node),
        1 => (node - 1) / 2,
        2 => {
            if node % 2 == 1 {
                node.saturating_sub(2)
            } else {
                node - 1
            }
        }
        3 => 0,
        4 => {
            if below(3) == 0 {
                node - 1
            } else {
                node - 1 - below(node.min(4))
            }
        }
        5 => {
            if node <= n / 2 {
                node - 1
            } else {
                n / 2
            }
        }
        6 => {
            if node <= n / 5 {
                0
            } else {
                node - (n / 5).max(1)
            }
        }
        _ => {
            if below(5) == 0 {
                below(node)
            } else {
                node - 1
            }
        }
    };
    std::iter::once(None).chain((1..n).map(parent).map(Some).collect::<Vec<_>>()).collect()
}

/// A random tree of about `n` nodes with lengths over `decades` powers of ten; flat if it lies in z = 0.
pub(crate) fn random_tree(family: usize, n: usize, decades: f64, is_flat: bool, key: u32) -> Tree {
    let mut stream = stream(key);
    let parents = parents(family, n, &mut stream);
    let mut nodes: Vec<Node> = Vec::new();
    for parent in parents {
        let length = math::pow(10.0, decades * (stream.unit() - 0.5));
        let z = if is_flat { 0.0 } else { stream.normal() };
        let step = DVec3::new(stream.normal(), stream.normal(), z).normalize_or(DVec3::X) * length;
        let position_mm = parent.map_or(DVec3::ZERO, |parent: usize| nodes[parent].position_mm + step);
        nodes.push(Node { position_mm, radius_mm: 0.01 * length, parent, kind: 0 });
    }
    Tree::new(&nodes).expect("a tree")
}

/// A tree from (x, y, z, parent).
pub(crate) fn tree_of(nodes: &[(f64, f64, f64, Option<usize>)]) -> Tree {
    let node = |&(x, y, z, parent): &(f64, f64, f64, Option<usize>)| Node {
        position_mm: DVec3::new(x, y, z),
        radius_mm: 0.1,
        parent,
        kind: 0,
    };
    Tree::new(&nodes.iter().map(node).collect::<Vec<_>>()).expect("a tree")
}

/// Views of which every one looks along the same direction.
pub(crate) fn views_along(tree: &Tree, towards_camera: DVec3) -> ViewHierarchy {
    let (_, up) = plane_axes(towards_camera, DVec3::Y);
    let view = View { towards_camera, up, center_mm: DVec3::ZERO, radius_mm: tree.extent_mm(), loss: 0.0 };
    let plane = LocalPlane { view, is_mirrored: false };
    ViewHierarchy {
        tree: tree.digest(),
        global: view,
        subtrees: vec![SubtreeView { level: 0, root: 0, view }],
        chains: vec![plane; tree.branches().list().len()],
        forks: (0..tree.n_nodes()).map(|node| (tree.children(node).len() > 1).then_some(plane)).collect(),
    }
}
