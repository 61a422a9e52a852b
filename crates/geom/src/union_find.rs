//! Disjoint sets, each named by its lowest member.
//!
//! **Input** numbers 0..n and pairs that belong together. **Output** for each number the lowest of its set, or the
//! number of its set.
//! **Guarantees** names and numbers depend on the sets alone, not on the order in which they were joined; no recursion.
//! **Cost** O(log n) a call, averaged over all calls.

/// Disjoint sets of 0..n.
///
/// ```
/// use espalier_geom::union_find::UnionFind;
/// let mut sets = UnionFind::new(5);
/// assert!(sets.join(4, 1) && sets.join(3, 4) && !sets.join(1, 3));
/// assert_eq!((sets.find(3), sets.find(2)), (1, 2));
/// sets.add(1);
/// assert_eq!(sets.into_numbers(), (vec![0, 1, 2, 1, 1, 3], 4));
/// ```
#[derive(Clone, Debug)]
pub struct UnionFind {
    parent: Vec<usize>,
}

impl UnionFind {
    /// Every number in a set of its own.
    #[must_use]
    pub fn new(n: usize) -> Self {
        Self { parent: (0..n).collect() }
    }

    /// Adds so many numbers after the last, each in a set of its own.
    pub fn add(&mut self, n: usize) {
        let first = self.parent.len();
        self.parent.extend(first..first + n);
    }

    /// The lowest number in the set of `member`.
    ///
    /// # Panics
    /// If `member` is not below n.
    pub fn find(&mut self, mut member: usize) -> usize {
        // Path halving: half the way to the top is forgotten on each visit, which keeps paths short without a stack.
        while self.parent[member] != member {
            self.parent[member] = self.parent[self.parent[member]];
            member = self.parent[member];
        }
        member
    }

    /// Makes one set of two; whether they were two.
    ///
    /// # Panics
    /// If a member is not below n.
    pub fn join(&mut self, a: usize, b: usize) -> bool {
        let (a, b) = (self.find(a), self.find(b));
        self.parent[a.max(b)] = a.min(b);
        a != b
    }

    /// For each member the number of its set, sets counted from 0 in the order of their lowest members, and how many
    /// sets there are.
    #[must_use]
    pub fn into_numbers(mut self) -> (Vec<usize>, usize) {
        let mut number = vec![0; self.parent.len()];
        let mut n_sets = 0;
        for member in 0..self.parent.len() {
            let lowest = self.find(member);
            number[member] = if lowest == member { n_sets } else { number[lowest] };
            n_sets += usize::from(lowest == member);
        }
        (number, n_sets)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Purpose, Stream};

    #[test]
    fn equals_relabelling_whatever_the_order() {
        let mut stream = Stream::new(3, Purpose::Test, 0, 0);
        for n in 1..40_u32 {
            let mut sets = UnionFind::new(n as usize);
            let mut label: Vec<usize> = (0..n as usize).collect();
            for _ in 0..n {
                let (a, b) = (stream.below(n) as usize, stream.below(n) as usize);
                let (from, to) = (label[a].max(label[b]), label[a].min(label[b]));
                assert_eq!(sets.join(a, b), from != to);
                label.iter_mut().filter(|l| **l == from).for_each(|l| *l = to);
            }
            let found: Vec<usize> = (0..n as usize).map(|member| sets.find(member)).collect();
            assert_eq!(found, label);
            let mut names = label.clone();
            names.sort_unstable();
            names.dedup();
            let expected: Vec<usize> =
                label.iter().map(|l| names.binary_search(l).unwrap_or(n as usize)).collect();
            assert_eq!(sets.into_numbers(), (expected, names.len()));
        }
    }

    #[test]
    fn long_paths_need_no_stack() {
        let n = 300_000;
        let mut sets = UnionFind::new(n);
        (1..n).rev().for_each(|member| assert!(sets.join(member - 1, member)));
        assert_eq!(sets.into_numbers().1, 1);
    }
}
