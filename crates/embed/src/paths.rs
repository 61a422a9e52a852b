//! Paths in the tree: the lowest common ancestor of two nodes, and how far apart two edges are along the tree.
//!
//! **Input** parents in preorder, edge lengths. **Output** ancestors and path lengths in constant time.
//! **Steps** a sparse table of least parents over ranges of the preorder; path lengths from the root.
//! **Cost** O(N log N) to make, O(1) to ask.

/// Path lengths from the root, and ancestors.
pub(crate) struct Paths {
    /// The path from the root to each node, in mm.
    pub(crate) depth_mm: Vec<f64>,
    parent: Vec<u32>,
    ancestors: Ancestors,
}

impl Paths {
    /// The paths of a tree of which every node has a parent (the root itself) and an edge length.
    pub(crate) fn new(parent: &[u32], length_mm: &[f64]) -> Self {
        let mut depth_mm = vec![0.0; parent.len()];
        for node in 1..parent.len() {
            depth_mm[node] = depth_mm[parent[node] as usize] + length_mm[node];
        }
        Self { depth_mm, parent: parent.to_vec(), ancestors: Ancestors::new(parent) }
    }

    /// The node where the paths to two edges part; edges by their lower nodes. The lower node of the upper edge
    /// where one edge lies below the other.
    pub(crate) fn parting(&self, a: usize, b: usize) -> usize {
        self.ancestors.lowest_common(a, b)
    }

    /// The path along the tree between the near ends of two different edges, by their lower nodes, in mm; 0 for
    /// neighbours.
    pub(crate) fn gap_mm(&self, a: usize, b: usize) -> f64 {
        let (first, last) = (a.min(b), a.max(b));
        let parting = self.parting(first, last);
        let near_first = if parting == first { first } else { self.parent[first] as usize };
        let near_last = self.parent[last] as usize;
        self.depth_mm[near_first] + self.depth_mm[near_last] - 2.0 * self.depth_mm[parting]
    }
}

/// Lowest common ancestors in constant time: the lowest parent over a range of the preorder.
pub(crate) struct Ancestors {
    /// `levels[k][v]` = the least parent among nodes v .. v + 2^k.
    levels: Vec<Vec<u32>>,
}

impl Ancestors {
    pub(crate) fn new(parent: &[u32]) -> Self {
        let mut levels = vec![parent.to_vec()];
        let mut width = 1;
        while 2 * width <= parent.len() {
            let last = &levels[levels.len() - 1];
            let next = (0..=parent.len() - 2 * width).map(|v| last[v].min(last[v + width])).collect();
            levels.push(next);
            width *= 2;
        }
        Self { levels }
    }

    /// In preorder the ancestor is the least parent among the nodes after the first up to the second.
    pub(crate) fn lowest_common(&self, a: usize, b: usize) -> usize {
        let (first, last) = (a.min(b), a.max(b));
        if first == last {
            return first;
        }
        let level = (last - first).ilog2() as usize;
        let row = &self.levels[level];
        row[first + 1].min(row[last + 1 - (1 << level)]) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ancestors_equal_climbing() {
        // 0 ─ 1 ─ 2, 1 ─ 3 ─ {4, 5 ─ 6}, 0 ─ 7 ─ 8
        let parent = [0, 0, 1, 1, 3, 3, 5, 0, 7];
        let ancestors = Ancestors::new(&parent);
        let chain = |mut node: usize| {
            let mut chain = vec![node];
            while node != 0 {
                node = parent[node] as usize;
                chain.push(node);
            }
            chain
        };
        for a in 0..parent.len() {
            for b in 0..parent.len() {
                let above = chain(a);
                let expected = chain(b).into_iter().find(|node| above.contains(node));
                assert_eq!(Some(ancestors.lowest_common(a, b)), expected, "{a} {b}");
            }
        }
    }
}
