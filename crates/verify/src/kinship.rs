//! Where two nodes of a tree part, by heavy paths.
//!
//! **Input** a tree. **Output** lowest common ancestors, path lengths between edges.
//! **Notation** a heavy path goes from each node to the child with most nodes below it; a path to the root changes
//! heavy paths at most log₂ N times. **Source** Sleator and Tarjan (1983). **Cost** O(N) to make, O(log N) to ask.

use espalier_model::Tree;

/// A tree with its heavy paths.
pub(crate) struct Kinship<'a> {
    tree: &'a Tree,
    /// The upper end of the heavy path on which each node lies.
    head: Vec<usize>,
    depth: Vec<usize>,
}

impl<'a> Kinship<'a> {
    pub(crate) fn new(tree: &'a Tree) -> Self {
        let n_nodes = tree.n_nodes();
        let (mut head, mut depth): (Vec<usize>, Vec<usize>) = ((0..n_nodes).collect(), vec![0; n_nodes]);
        for (node, parent) in tree.edges() {
            depth[node] = depth[parent] + 1;
        }
        for node in 0..n_nodes {
            if let Some(&heavy) = tree.children(node).iter().max_by_key(|&&child| tree.subtree(child).len()) {
                head[heavy] = head[node];
            }
        }
        Self { tree, head, depth }
    }

    /// The parent of a node; the root's is itself.
    pub(crate) fn parent(&self, node: usize) -> usize {
        self.tree.parent(node).unwrap_or(0)
    }

    /// Whether two edges, by their lower nodes, have a node in common.
    pub(crate) fn are_neighbours(&self, a: usize, b: usize) -> bool {
        let (upper_a, upper_b) = (self.parent(a), self.parent(b));
        upper_a == upper_b || upper_a == b || upper_b == a
    }

    /// The near ends of two edges without a common node, by their lower nodes a < b, and the node at which the way
    /// from one to the other turns round.
    pub(crate) fn near_ends(&self, a: usize, b: usize) -> (usize, usize, usize) {
        let upper_b = self.parent(b);
        if self.tree.subtree(a).contains(&b) {
            return (a, upper_b, a);
        }
        let upper_a = self.parent(a);
        (upper_a, upper_b, self.common(upper_a, upper_b))
    }

    /// The lowest node above both, or one of them.
    fn common(&self, mut a: usize, mut b: usize) -> usize {
        while self.head[a] != self.head[b] {
            if self.depth[self.head[a]] >= self.depth[self.head[b]] {
                a = self.parent(self.head[a]);
            } else {
                b = self.parent(self.head[b]);
            }
        }
        if self.depth[a] < self.depth[b] { a } else { b }
    }
}
