//! The parts of a tree that views look at, each as an enhanced tree.
//!
//! **Input** a tree and one of its parts: the whole, a subtree, a chain set, a branching set.
//! **Output** [`Part`]: the part's real edges and its imaginary ones, as pairs of nodes.
//! **Notation** k children at a fork, m = `max_siblings`.
//! **Steps** 1. The part's nodes are those whose edge to the parent belongs to it. 2. Each of them is joined to
//! its grandparent, to its siblings and to its parent's siblings, where those edges stay inside the part.
//! **Guarantees** each pair once; at most 1 + 1 + m + 2m pairs per node, all siblings where k ≤ 2m + 1.
//! **Source** [Hu2022] section 3.1.1 (enhanced tree), section 3.1.2 (subtrees), section 3.2.1 (sets).
//! **Differs from the source** at forks of more than 2m + 1 children, which the paper's O(k²) pairs cannot serve:
//! siblings stand in a ring in tree order and each is joined to the m next ones on either side.
//! **Cost** O(N · m) time and memory, N the part's edges.

use std::ops::Range;

use espalier_model::{Branch, Tree};
use glam::DVec3;

/// A part of a tree as an enhanced tree.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Part {
    /// A node of it, the one nearest to the root: where a part without edges is.
    pub(crate) top: usize,
    /// Its real edges, as (node, parent).
    pub(crate) real: Vec<(usize, usize)>,
    /// Its imaginary edges.
    pub(crate) imaginary: Vec<(usize, usize)>,
}

impl Part {
    /// The subtree of `root` with the edge above it; the whole tree for the root.
    pub(crate) fn subtree(tree: &Tree, root: usize, max_siblings: u32) -> Self {
        let nodes = tree.subtree(root);
        let mut part = Self::of_range(tree, nodes.clone());
        let m = max_siblings as usize;
        for node in nodes.clone() {
            join_siblings(tree.children(node), m, &mut part.imaginary);
        }
        for (node, parent) in edges_of(tree, nodes).filter(|&(_, parent)| parent > root) {
            let uncles = tree.parent(parent).map_or(&[][..], |grandparent| tree.children(grandparent));
            let nearby = neighbours_in_ring(uncles, parent, m);
            part.imaginary.extend(nearby.map(|uncle| (node, uncle)));
        }
        part
    }

    /// The chain set of a branch: its nodes and its hub.
    pub(crate) fn chain(tree: &Tree, branch: &Branch) -> Self {
        Self::of_range(tree, branch.nodes.clone())
    }

    /// The branching set of a fork: the node, its parent and its children.
    pub(crate) fn fork(tree: &Tree, fork: usize, max_siblings: u32) -> Self {
        let children = tree.children(fork);
        let mut part = Self { top: fork, real: Vec::new(), imaginary: Vec::new() };
        if let Some(parent) = tree.parent(fork) {
            part.top = parent;
            part.real.push((fork, parent));
            part.imaginary.extend(children.iter().map(|&child| (child, parent)));
        }
        part.real.extend(children.iter().map(|&child| (child, fork)));
        join_siblings(children, max_siblings as usize, &mut part.imaginary);
        part
    }

    /// The nodes of a range with the edges above them and the edges to their grandparents.
    fn of_range(tree: &Tree, nodes: Range<usize>) -> Self {
        let first = nodes.start;
        let real: Vec<_> = edges_of(tree, nodes).collect();
        let imaginary = real.iter().filter(|&&(_, parent)| parent >= first);
        let imaginary = imaginary.filter_map(|&(node, parent)| Some((node, tree.parent(parent)?))).collect();
        Self { top: tree.parent(first).unwrap_or(first), real, imaginary }
    }

    /// The length-weighted centroid of the real edges, and the expansion radius about it, in mm.
    pub(crate) fn center_and_radius_mm(&self, tree: &Tree) -> (DVec3, f64) {
        let top = tree.position_mm(self.top);
        let (mut moment, mut length) = (DVec3::ZERO, 0.0);
        for &(node, parent) in &self.real {
            let (a, b) = (tree.position_mm(node) - top, tree.position_mm(parent) - top);
            moment += 0.5 * (a + b) * a.distance(b);
            length += a.distance(b);
        }
        let center = if length > 0.0 { top + moment / length } else { top };
        let ends = self.real.iter().map(|&(node, _)| node).chain([self.top]);
        (center, ends.map(|node| tree.position_mm(node).distance(center)).fold(0.0, f64::max))
    }
}

fn edges_of(tree: &Tree, nodes: Range<usize>) -> impl Iterator<Item = (usize, usize)> {
    nodes.filter_map(|node| Some((node, tree.parent(node)?)))
}

/// Joins each sibling to the next `m` in their ring, each pair once.
fn join_siblings(siblings: &[usize], m: usize, pairs: &mut Vec<(usize, usize)>) {
    let k = siblings.len();
    for i in 0..k {
        for step in 1..=m.min(k / 2) {
            // Half-way round an even ring the same pair comes up from both its ends.
            if 2 * step < k || i < step {
                pairs.push((siblings[i], siblings[(i + step) % k]));
            }
        }
    }
}

/// The up to `m` siblings on either side of `node` in their ring, without itself, each once.
fn neighbours_in_ring(siblings: &[usize], node: usize, m: usize) -> impl Iterator<Item = usize> {
    let k = siblings.len();
    // Siblings stand in index order, as the tree's preorder has them.
    let place = siblings.partition_point(|&sibling| sibling < node);
    let n_before = m.min(k.saturating_sub(1) / 2);
    let n_after = m.min(k / 2);
    let after = (1..=n_after).map(move |step| siblings[(place + step) % k]);
    let before = (1..=n_before).map(move |step| siblings[(place + k - step) % k]);
    after.chain(before)
}

#[cfg(test)]
mod tests {
    use espalier_model::Node;

    use super::*;

    fn tree(parents: &[usize]) -> Tree {
        let position = |i: usize| DVec3::new(i as f64, (i * i % 7) as f64, (i % 3) as f64);
        let node = |i: usize, parent| Node { position_mm: position(i), radius_mm: 1.0, parent, kind: 0 };
        let rest = parents.iter().enumerate().map(|(i, &parent)| node(i + 1, Some(parent)));
        Tree::new(&std::iter::once(node(0, None)).chain(rest).collect::<Vec<_>>()).expect("a tree")
    }

    fn sorted(pairs: &[(usize, usize)]) -> Vec<(usize, usize)> {
        let mut pairs: Vec<_> = pairs.iter().map(|&(a, b)| (a.max(b), a.min(b))).collect();
        pairs.sort_unstable();
        pairs
    }

    /// 0 → 1 → {2 → {3, 4}, 5 → 6}.
    #[test]
    fn enhanced_tree_of_a_small_tree() {
        let tree = tree(&[0, 1, 2, 2, 1, 5]);
        let whole = Part::subtree(&tree, 0, 8);
        assert_eq!(whole.real, [(1, 0), (2, 1), (3, 2), (4, 2), (5, 1), (6, 5)]);
        let grandparents = [(2, 0), (5, 0), (3, 1), (4, 1), (6, 1)];
        let (siblings, uncles) = ([(5, 2), (4, 3)], [(5, 3), (5, 4), (6, 2)]);
        assert_eq!(sorted(&whole.imaginary), sorted(&[&grandparents[..], &siblings, &uncles].concat()));

        let below = Part::subtree(&tree, 2, 8);
        assert_eq!((below.top, &below.real[..]), (1, &[(2, 1), (3, 2), (4, 2)][..]));
        assert_eq!(sorted(&below.imaginary), [(3, 1), (4, 1), (4, 3)]);

        let fork = Part::fork(&tree, 2, 8);
        assert_eq!((fork.top, &fork.real[..]), (1, &[(2, 1), (3, 2), (4, 2)][..]));
        assert_eq!(sorted(&fork.imaginary), [(3, 1), (4, 1), (4, 3)]);

        let chain = Part::chain(&tree, &tree.branches().list()[4]);
        assert_eq!(
            (chain.top, &chain.real[..], &chain.imaginary[..]),
            (1, &[(5, 1), (6, 5)][..], &[(6, 1)][..])
        );
    }

    #[test]
    fn rings_join_each_pair_once_and_at_most_m_a_side() {
        for (k, m) in [(1, 3), (2, 3), (3, 1), (6, 3), (7, 3), (8, 3), (40, 3), (400, 8)] {
            let siblings: Vec<usize> = (10..10 + k).collect();
            let mut pairs = Vec::new();
            join_siblings(&siblings, m, &mut pairs);
            let mut unique = sorted(&pairs);
            unique.dedup();
            assert_eq!(unique.len(), pairs.len(), "k = {k}");
            let expected = if k <= 2 * m + 1 { k * (k - 1) / 2 } else { k * m };
            assert_eq!(pairs.len(), expected, "k = {k}");
            for &node in &siblings {
                let near: Vec<_> = neighbours_in_ring(&siblings, node, m).collect();
                assert!(!near.contains(&node), "k = {k}");
                assert_eq!(near.len(), (2 * m).min(k - 1), "k = {k}");
            }
        }
    }
}
