//! Disjoint sets, each named by its lowest member.

/// Disjoint sets of 0..n.
pub(crate) struct UnionFind {
    parent: Vec<usize>,
}

impl UnionFind {
    /// Every number in a set of its own.
    pub(crate) fn new(n: usize) -> Self {
        Self { parent: (0..n).collect() }
    }

    /// The lowest number in the set of `member`.
    pub(crate) fn find(&mut self, mut member: usize) -> usize {
        // Path halving: half the way to the top is forgotten on each visit, which keeps paths short without a stack.
        while self.parent[member] != member {
            self.parent[member] = self.parent[self.parent[member]];
            member = self.parent[member];
        }
        member
    }

    /// Makes one set of two; whether they were two.
    pub(crate) fn join(&mut self, a: usize, b: usize) -> bool {
        let (a, b) = (self.find(a), self.find(b));
        self.parent[a.max(b)] = a.min(b);
        a != b
    }
}
