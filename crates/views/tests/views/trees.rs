//! Trees for the tests.

use std::f64::consts::TAU;

use espalier_geom::math;
use espalier_geom::random::{Purpose, Stream};
use espalier_model::swc::{SwcScale, TracedNode, parse};
use espalier_model::{Node, Tree};
use glam::{DMat3, DVec3};

/// A tree from positions and the parents of all nodes but the first.
pub(crate) fn tree(positions: &[DVec3], parents: &[usize]) -> Tree {
    let parent_of = |node: usize| node.checked_sub(1).map(|i| parents[i]);
    let node = |i: usize| Node { position_mm: positions[i], radius_mm: 1.0, parent: parent_of(i), kind: 0 };
    Tree::new(&(0..positions.len()).map(node).collect::<Vec<_>>()).expect("a tree")
}

/// The same tree with its positions moved.
pub(crate) fn moved(tree: &Tree, to: impl Fn(DVec3) -> DVec3) -> Tree {
    let nodes: Vec<Node> =
        tree.nodes().iter().map(|node| Node { position_mm: to(node.position_mm), ..*node }).collect();
    Tree::new(&nodes).expect("the same topology")
}

/// A rotation about an axis.
pub(crate) fn rotation(axis: DVec3, angle_rad: f64) -> DMat3 {
    DMat3::from_axis_angle(axis.normalize(), angle_rad)
}

/// A tree that grows at random: each node goes on from its parent with a bend, and one in `fork_every` hangs from
/// an earlier node. In the plane z = 0 if `is_flat`.
pub(crate) fn random_tree(n_nodes: usize, fork_every: u32, is_flat: bool, seed: u64) -> Tree {
    let mut stream = Stream::new(seed, Purpose::Test, 0, 0);
    let (mut positions, mut headings) = (vec![DVec3::ZERO], vec![DVec3::X]);
    let mut parents = Vec::new();
    for node in 1..n_nodes {
        let goes_on = stream.below(fork_every) > 0;
        let parent = if goes_on { node - 1 } else { stream.below(node as u32) as usize };
        let spread = if goes_on { 0.3 } else { 1.2 };
        let mut bend = DVec3::new(stream.normal(), stream.normal(), stream.normal()) * spread;
        bend.z = if is_flat { 0.0 } else { bend.z };
        let heading = (headings[parent] + bend).try_normalize().unwrap_or(DVec3::X);
        positions.push(positions[parent] + heading * stream.uniform(0.5, 2.0));
        headings.push(heading);
        parents.push(parent);
    }
    tree(&positions, &parents)
}

/// A straight spine with one tooth at each of its nodes, winding about it.
pub(crate) fn comb(n_teeth: usize) -> Tree {
    let (mut positions, mut parents, mut spine) = (vec![DVec3::ZERO], Vec::new(), 0);
    for tooth in 0..n_teeth {
        positions.push(DVec3::X * (tooth + 1) as f64);
        parents.push(spine);
        spine = positions.len() - 1;
        let (sin, cos) = math::sin_cos(0.1 * tooth as f64 % TAU);
        positions.push(positions[spine] + DVec3::new(0.3, 2.0 * cos, 2.0 * sin));
        parents.push(spine);
    }
    tree(&positions, &parents)
}

/// The tree of the first root of an SWC text in µm, nodes at their parent's place left out.
pub(crate) fn tree_of_swc(text: &[u8]) -> Tree {
    let traced = parse(text, &SwcScale::micrometres()).expect("well-formed SWC").0.nodes;
    let mut children = vec![Vec::new(); traced.len()];
    for (node, data) in traced.iter().enumerate() {
        if let Some(parent) = data.parent {
            children[parent].push(node);
        }
    }
    let root = traced.iter().position(|node| node.parent.is_none()).expect("a root");
    let mut nodes: Vec<Node> = Vec::new();
    let mut stack = vec![(root, None)];
    while let Some((node, parent)) = stack.pop() {
        let TracedNode { position_mm, radius_mm, kind, .. } = traced[node];
        let twin = parent.filter(|&parent: &usize| nodes[parent].position_mm == position_mm);
        let place = twin.unwrap_or(nodes.len());
        if twin.is_none() {
            nodes.push(Node { position_mm, radius_mm, parent, kind });
        }
        stack.extend(children[node].iter().rev().map(|&child| (child, Some(place))));
    }
    Tree::new(&nodes).expect("a tree")
}
