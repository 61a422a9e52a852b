//! The rooted tree that the whole second half of the pipeline works on.

use std::ops::Range;

use glam::DVec3;
use thiserror::Error;

use crate::diagnose::{Class, Diagnose};

/// A node of a tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    /// Where it is, RAS+ mm.
    pub position_mm: DVec3,
    /// The radius of the organ here, in mm; at least 0.
    pub radius_mm: f64,
    /// The index of its parent; `None` for the root.
    pub parent: Option<usize>,
    /// The SWC structure type (0 undefined, 1 soma, 2 axon, 3 dendrite, …), carried through.
    pub kind: i32,
}

/// A rooted tree.
///
/// **Guarantees** at least one node; node 0 is the only root; nodes stand in depth-first preorder, so a parent
/// stands before its children, the subtree of a node is a contiguous range, and so is a chain; positions are
/// finite, radii finite and at least 0; every edge has a positive length.
#[derive(Clone, Debug, PartialEq)]
pub struct Tree {
    nodes: Vec<Node>,
    subtree_end: Vec<usize>,
    child_offsets: Vec<usize>,
    child_list: Vec<usize>,
}

/// Why nodes are not a tree.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum TreeError {
    /// No node at all.
    #[error("a tree needs at least one node")]
    Empty,
    /// A parent index outside the nodes.
    #[error("node {node} names parent {parent}, but there are {n_nodes} nodes")]
    NoSuchParent {
        /// The node.
        node: usize,
        /// The parent it names.
        parent: usize,
        /// How many nodes there are.
        n_nodes: usize,
    },
    /// Not exactly one root.
    #[error("a tree has one root, not {n_roots}")]
    Roots {
        /// How many roots there are.
        n_roots: usize,
    },
    /// Nodes that no path leads to from the root.
    #[error("node {node} lies on a cycle or hangs from one")]
    Cycle {
        /// One of the nodes.
        node: usize,
    },
    /// A number that is not finite, or a negative radius.
    #[error("node {node} has position {position_mm} and radius {radius_mm}")]
    Number {
        /// The node.
        node: usize,
        /// Its position.
        position_mm: DVec3,
        /// Its radius.
        radius_mm: f64,
    },
    /// A node at the place of its parent.
    #[error("node {node} lies at the place of its parent {parent}")]
    ZeroEdge {
        /// The node.
        node: usize,
        /// Its parent.
        parent: usize,
    },
}

impl Diagnose for TreeError {
    fn code(&self) -> &'static str {
        match self {
            Self::Empty => "E-TREE-EMPTY",
            Self::NoSuchParent { .. } => "E-TREE-PARENT",
            Self::Roots { .. } => "E-TREE-ROOTS",
            Self::Cycle { .. } => "E-TREE-CYCLE",
            Self::Number { .. } => "E-TREE-NUMBER",
            Self::ZeroEdge { .. } => "E-TREE-ZERO-EDGE",
        }
    }

    fn class(&self) -> Class {
        Class::Input
    }
}

impl Tree {
    /// A tree from nodes in any order; they are brought into preorder, siblings keeping their order.
    ///
    /// # Errors
    /// [`TreeError`] if one of the guarantees cannot be met.
    pub fn new(nodes: &[Node]) -> Result<Self, TreeError> {
        Self::with_order(nodes).map(|(tree, _)| tree)
    }

    /// As [`Tree::new`]; also tells for each node of the tree which of the given nodes it was.
    ///
    /// # Errors
    /// As [`Tree::new`].
    pub fn with_order(nodes: &[Node]) -> Result<(Self, Vec<usize>), TreeError> {
        check_nodes(nodes)?;
        let n_nodes = nodes.len();
        let (offsets, list) = children_of(nodes);
        let children = |node: usize| &list[offsets[node]..offsets[node + 1]];

        // Walk depth first with an explicit stack: the depth of a tree is the user's, not the stack's.
        let root = nodes.iter().position(|node| node.parent.is_none()).unwrap_or(0);
        let mut order = Vec::with_capacity(n_nodes);
        let mut stack = vec![root];
        while let Some(node) = stack.pop() {
            order.push(node);
            stack.extend(children(node).iter().rev());
        }
        let mut new_index = vec![usize::MAX; n_nodes];
        for (new, &old) in order.iter().enumerate() {
            new_index[old] = new;
        }
        if let Some(node) = new_index.iter().position(|&new| new == usize::MAX) {
            return Err(TreeError::Cycle { node });
        }

        let ordered: Vec<Node> = order
            .iter()
            .map(|&old| Node { parent: nodes[old].parent.map(|parent| new_index[parent]), ..nodes[old] })
            .collect();
        let mut subtree_end: Vec<usize> = (1..=n_nodes).collect();
        for node in (1..n_nodes).rev() {
            if let Some(parent) = ordered[node].parent {
                subtree_end[parent] = subtree_end[parent].max(subtree_end[node]);
            }
        }
        let (child_offsets, child_list) = children_of(&ordered);
        Ok((Self { nodes: ordered, subtree_end, child_offsets, child_list }, order))
    }

    /// The nodes in preorder.
    #[must_use]
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The number of nodes.
    #[must_use]
    pub fn n_nodes(&self) -> usize {
        self.nodes.len()
    }

    /// The parent of a node; `None` for the root.
    #[must_use]
    pub fn parent(&self, node: usize) -> Option<usize> {
        self.nodes[node].parent
    }

    /// The children of a node, in order.
    #[must_use]
    pub fn children(&self, node: usize) -> &[usize] {
        &self.child_list[self.child_offsets[node]..self.child_offsets[node + 1]]
    }

    /// The nodes of the subtree below and including `node`.
    #[must_use]
    pub fn subtree(&self, node: usize) -> Range<usize> {
        node..self.subtree_end[node]
    }

    /// The position of a node, RAS+ mm.
    #[must_use]
    pub fn position_mm(&self, node: usize) -> DVec3 {
        self.nodes[node].position_mm
    }

    /// The length of the edge from a node to its parent, in mm; 0 for the root.
    #[must_use]
    pub fn edge_length_mm(&self, node: usize) -> f64 {
        self.parent(node).map_or(0.0, |parent| self.position_mm(node).distance(self.position_mm(parent)))
    }

    /// The edges as (node, parent), in preorder of the node.
    pub fn edges(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.nodes.iter().enumerate().filter_map(|(node, data)| data.parent.map(|parent| (node, parent)))
    }

    /// The sum of all edge lengths, in mm.
    #[must_use]
    pub fn length_mm(&self) -> f64 {
        (0..self.n_nodes()).map(|node| self.edge_length_mm(node)).sum()
    }

    /// The mean radius over the tree's length, in mm: each edge counts with its length and the mean of its ends'
    /// radii. The root's radius for a tree of one node.
    #[must_use]
    pub fn mean_radius_mm(&self) -> f64 {
        let (mut weighted, mut length) = (0.0, 0.0);
        for (node, parent) in self.edges() {
            let edge = self.edge_length_mm(node);
            weighted += edge * 0.5 * (self.nodes[node].radius_mm + self.nodes[parent].radius_mm);
            length += edge;
        }
        if length > 0.0 { weighted / length } else { self.nodes[0].radius_mm }
    }

    /// The number of tips: nodes without children, the root apart.
    #[must_use]
    pub fn n_tips(&self) -> usize {
        (1..self.n_nodes()).filter(|&node| self.children(node).is_empty()).count()
    }

    /// Half the diagonal of the tree's bounding box, in mm: a scale for tolerances.
    #[must_use]
    pub fn extent_mm(&self) -> f64 {
        espalier_geom::space::extent(self.nodes.iter().map(|node| node.position_mm))
    }

    /// The branches of the tree.
    #[must_use]
    pub fn branches(&self) -> Branches {
        Branches::of(self)
    }
}

fn check_nodes(nodes: &[Node]) -> Result<(), TreeError> {
    if nodes.is_empty() {
        return Err(TreeError::Empty);
    }
    let n_roots = nodes.iter().filter(|node| node.parent.is_none()).count();
    for (node_idx, node) in nodes.iter().enumerate() {
        let Node { position_mm, radius_mm, parent, .. } = *node;
        if !position_mm.is_finite() || !radius_mm.is_finite() || radius_mm < 0.0 {
            return Err(TreeError::Number { node: node_idx, position_mm, radius_mm });
        }
        if let Some(parent) = parent {
            if parent >= nodes.len() {
                return Err(TreeError::NoSuchParent { node: node_idx, parent, n_nodes: nodes.len() });
            }
            if nodes[parent].position_mm.distance(position_mm) == 0.0 {
                return Err(TreeError::ZeroEdge { node: node_idx, parent });
            }
        }
    }
    if n_roots == 0 {
        return Err(TreeError::Cycle { node: 0 });
    }
    if n_roots > 1 {
        return Err(TreeError::Roots { n_roots });
    }
    Ok(())
}

/// The children of each node as offsets into one list, in index order.
fn children_of(nodes: &[Node]) -> (Vec<usize>, Vec<usize>) {
    let mut offsets = vec![0; nodes.len() + 1];
    for parent in nodes.iter().filter_map(|node| node.parent) {
        offsets[parent + 1] += 1;
    }
    for node in 0..nodes.len() {
        offsets[node + 1] += offsets[node];
    }
    let mut next = offsets.clone();
    let mut list = vec![0; offsets[nodes.len()]];
    for (node, parent) in nodes.iter().enumerate().filter_map(|(node, data)| data.parent.map(|p| (node, p))) {
        list[next[parent]] = node;
        next[parent] += 1;
    }
    (offsets, list)
}

/// A branch: the chain of edges from a fork (or the root) to the next fork or tip. The paper's *segment*.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Branch {
    /// The fork or root it hangs from; not among its own nodes.
    pub hub: usize,
    /// Its nodes, a contiguous range, from the hub outwards; the last one is a fork or a tip.
    pub nodes: Range<usize>,
    /// The branch it hangs from; `None` at the root.
    pub parent: Option<usize>,
    /// The number of forks between the root and this branch, the root itself not counted.
    pub generation: u32,
    /// Strahler order: 1 at tips.
    pub strahler: u32,
}

impl Branch {
    /// The last node: a fork or a tip.
    #[must_use]
    pub fn end(&self) -> usize {
        self.nodes.end - 1
    }

    /// All nodes of its polyline: the hub, then its own nodes.
    pub fn polyline(&self) -> impl Iterator<Item = usize> + use<> {
        std::iter::once(self.hub).chain(self.nodes.clone())
    }
}

/// The branches of a tree in preorder. Each node but the root belongs to exactly one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Branches {
    list: Vec<Branch>,
    of_node: Vec<Option<usize>>,
}

impl Branches {
    fn of(tree: &Tree) -> Self {
        let n_nodes = tree.n_nodes();
        let mut list: Vec<Branch> = Vec::new();
        let mut of_node = vec![None; n_nodes];
        for (node, parent) in tree.edges() {
            let starts_branch = parent == 0 || tree.children(parent).len() > 1;
            if starts_branch {
                let above = of_node[parent];
                let generation = above.map_or(0, |branch: usize| list[branch].generation + 1);
                list.push(Branch {
                    hub: parent,
                    nodes: node..node + 1,
                    parent: above,
                    generation,
                    strahler: 1,
                });
            } else if let Some(branch) = list.last_mut() {
                branch.nodes.end = node + 1;
            }
            of_node[node] = list.len().checked_sub(1);
        }

        // Strahler: a branch takes the highest order below it, one more if two share that.
        let mut highest = vec![(0_u32, 0_u32); list.len()];
        for branch in (0..list.len()).rev() {
            let (order, n_with_order) = highest[branch];
            list[branch].strahler = if order == 0 { 1 } else { order + u32::from(n_with_order > 1) };
            if let Some(parent) = list[branch].parent {
                let (best, count) = &mut highest[parent];
                match list[branch].strahler.cmp(best) {
                    std::cmp::Ordering::Greater => (*best, *count) = (list[branch].strahler, 1),
                    std::cmp::Ordering::Equal => *count += 1,
                    std::cmp::Ordering::Less => {}
                }
            }
        }
        Self { list, of_node }
    }

    /// The branches in preorder.
    #[must_use]
    pub fn list(&self) -> &[Branch] {
        &self.list
    }

    /// The branch of a node; `None` for the root.
    #[must_use]
    pub fn of_node(&self, node: usize) -> Option<usize> {
        self.of_node[node]
    }

    /// The length of a branch in mm.
    #[must_use]
    pub fn length_mm(&self, tree: &Tree, branch: usize) -> f64 {
        self.list[branch].nodes.clone().map(|node| tree.edge_length_mm(node)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(x: f64, y: f64, parent: Option<usize>) -> Node {
        Node { position_mm: DVec3::new(x, y, 0.0), radius_mm: 1.0, parent, kind: 0 }
    }

    /// Root, one chain node, a fork into a tip and a fork of two tips; given out of order.
    fn sample() -> (Tree, Vec<usize>) {
        Tree::with_order(&[
            node(3.0, 1.0, Some(2)),
            node(0.0, 0.0, None),
            node(2.0, 0.0, Some(3)),
            node(1.0, 0.0, Some(1)),
            node(3.0, -1.0, Some(2)),
            node(4.0, -1.0, Some(4)),
            node(4.0, -2.0, Some(4)),
        ])
        .expect("a tree")
    }

    #[test]
    fn preorder_subtrees_and_branches() {
        let (tree, order) = sample();
        assert_eq!(order, [1, 3, 2, 0, 4, 5, 6]);
        assert_eq!(tree.subtree(4), 4..7);
        assert_eq!(tree.children(2), [3, 4]);
        assert_eq!(tree.n_tips(), 3);
        let branches = tree.branches();
        let shape: Vec<_> =
            branches.list().iter().map(|b| (b.hub, b.nodes.clone(), b.generation, b.strahler)).collect();
        assert_eq!(
            shape,
            [(0, 1..3, 0, 2), (2, 3..4, 1, 1), (2, 4..5, 1, 2), (4, 5..6, 2, 1), (4, 6..7, 2, 1)]
        );
        assert_eq!(branches.of_node(0), None);
        assert_eq!(branches.of_node(6), Some(4));
        assert_eq!(branches.length_mm(&tree, 0), 2.0);
    }

    #[test]
    fn refuses_what_is_no_tree() {
        assert_eq!(Tree::new(&[]), Err(TreeError::Empty));
        assert_eq!(
            Tree::new(&[node(0.0, 0.0, None), node(1.0, 0.0, None)]),
            Err(TreeError::Roots { n_roots: 2 })
        );
        assert_eq!(
            Tree::new(&[node(0.0, 0.0, None), node(1.0, 0.0, Some(2)), node(2.0, 0.0, Some(1))]),
            Err(TreeError::Cycle { node: 1 })
        );
        assert!(matches!(Tree::new(&[node(0.0, 0.0, Some(0))]), Err(TreeError::ZeroEdge { .. })));
        assert!(matches!(Tree::new(&[node(0.0, 0.0, Some(9))]), Err(TreeError::NoSuchParent { .. })));
        assert!(matches!(Tree::new(&[node(f64::NAN, 0.0, None)]), Err(TreeError::Number { .. })));
    }

    #[test]
    fn deep_chain_needs_no_stack() {
        let chain: Vec<Node> = (0..200_000).map(|i: usize| node(i as f64, 0.0, i.checked_sub(1))).collect();
        let tree = Tree::new(&chain).expect("a tree");
        assert_eq!(tree.subtree(0), 0..200_000);
        assert_eq!(tree.branches().list().len(), 1);
    }
}
