//! The pairs of edges that cross or come too near, as a list and by edge.
//!
//! **Input** pairs as they come and go. **Output** their numbers, any one of them by index, those of an edge.
//! **Steps** a list without holes; each pair is linked into the lists of its two edges, in both directions, so that
//! it can be taken out. The last pair moves into the place of one that goes.
//! **Cost** O(1) for each operation.

const NONE: u32 = u32::MAX;

/// What is wrong with a pair of edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Fault {
    /// They meet.
    Crossing,
    /// They are nearer than the clearance.
    Near,
    /// One of them enters the space that is kept free behind the root.
    KeepOut,
}

/// A pair of edges that should not be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Conflict {
    pub(super) edges: [u32; 2],
    pub(super) fault: Fault,
}

#[derive(Clone, Copy, Debug)]
struct Link {
    next: u32,
    previous: u32,
}

/// All conflicts.
#[derive(Clone)]
pub(super) struct Conflicts {
    list: Vec<Conflict>,
    /// Two for each pair; link 2i + s belongs to edge s of pair i.
    links: Vec<Link>,
    /// The first link of each edge.
    heads: Vec<u32>,
    /// How many there are of each fault.
    counts: [usize; 3],
}

impl Conflicts {
    pub(super) fn new(n_edges: usize) -> Self {
        Self { list: Vec::new(), links: Vec::new(), heads: vec![NONE; n_edges], counts: [0; 3] }
    }

    pub(super) fn list(&self) -> &[Conflict] {
        &self.list
    }

    pub(super) fn count(&self, fault: Fault) -> usize {
        self.counts[fault as usize]
    }

    pub(super) fn clear(&mut self) {
        self.list.clear();
        self.links.clear();
        self.heads.fill(NONE);
        self.counts = [0; 3];
    }

    pub(super) fn insert(&mut self, conflict: Conflict) {
        let pair_idx = self.list.len() as u32;
        self.list.push(conflict);
        self.counts[conflict.fault as usize] += 1;
        for (side, edge) in (0..).zip(conflict.edges) {
            let (link_idx, next) = (2 * pair_idx + side, self.heads[edge as usize]);
            self.links.push(Link { next, previous: NONE });
            if next != NONE {
                self.links[next as usize].previous = link_idx;
            }
            self.heads[edge as usize] = link_idx;
        }
    }

    /// Takes out pairs by index; the indices must rise.
    pub(super) fn remove_all(&mut self, pair_indices: &[usize]) {
        pair_indices.iter().rev().for_each(|&pair_idx| self.remove(pair_idx));
    }

    fn remove(&mut self, pair_idx: usize) {
        let conflict = self.list[pair_idx];
        self.counts[conflict.fault as usize] -= 1;
        for (side, edge) in conflict.edges.into_iter().enumerate() {
            let Link { next, previous } = self.links[2 * pair_idx + side];
            self.point_at(previous, edge, next);
            if next != NONE {
                self.links[next as usize].previous = previous;
            }
        }
        let last_idx = self.list.len() - 1;
        self.list.swap_remove(pair_idx);
        if pair_idx != last_idx {
            for side in 0..2 {
                let link = self.links[2 * last_idx + side];
                let (edge, link_idx) = (self.list[pair_idx].edges[side], (2 * pair_idx + side) as u32);
                self.links[link_idx as usize] = link;
                self.point_at(link.previous, edge, link_idx);
                if link.next != NONE {
                    self.links[link.next as usize].previous = link_idx;
                }
            }
        }
        self.links.truncate(2 * last_idx);
    }

    /// Lets what stood before a link of an edge point at another.
    fn point_at(&mut self, previous: u32, edge: u32, link_idx: u32) {
        if previous == NONE {
            self.heads[edge as usize] = link_idx;
        } else {
            self.links[previous as usize].next = link_idx;
        }
    }

    /// Visits the pairs of an edge: index, the other edge, the fault.
    pub(super) fn each_of(&self, edge: usize, mut visit: impl FnMut(usize, usize, Fault)) {
        let mut link_idx = self.heads[edge];
        while link_idx != NONE {
            let pair_idx = link_idx as usize / 2;
            let Conflict { edges, fault } = self.list[pair_idx];
            visit(pair_idx, edges[1 - link_idx as usize % 2] as usize, fault);
            link_idx = self.links[link_idx as usize].next;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common::stream;

    #[test]
    fn equals_a_plain_list() {
        let mut stream = stream(5200);
        let n_edges = 20;
        let (mut conflicts, mut plain) = (Conflicts::new(n_edges), Vec::<Conflict>::new());
        for round in 0..3000 {
            if plain.is_empty() || stream.below(9) < 4 {
                let first = stream.below(19);
                let edges = [first, first + 1 + stream.below(19 - first)];
                let fault = [Fault::Crossing, Fault::Near, Fault::KeepOut][stream.below(3) as usize];
                conflicts.insert(Conflict { edges, fault });
                plain.push(Conflict { edges, fault });
            } else {
                let mut gone: Vec<usize> =
                    (0..stream.below(4)).map(|_| stream.below(plain.len() as u32) as usize).collect();
                gone.sort_unstable();
                gone.dedup();
                for &pair_idx in &gone {
                    let conflict = conflicts.list()[pair_idx];
                    plain
                        .swap_remove(plain.iter().position(|&other| other == conflict).expect("it is there"));
                }
                conflicts.remove_all(&gone);
            }
            let mut found = conflicts.list().to_vec();
            found.sort_unstable();
            plain.sort_unstable();
            assert_eq!(found, plain, "round {round}");
            for edge in 0..n_edges {
                let mut n_of_edge = 0;
                conflicts.each_of(edge, |pair_idx, other, fault| {
                    let conflict = conflicts.list()[pair_idx];
                    assert!(
                        conflict.edges.contains(&(edge as u32)) && conflict.edges.contains(&(other as u32))
                    );
                    assert_eq!(conflict.fault, fault);
                    n_of_edge += 1;
                });
                assert_eq!(n_of_edge, plain.iter().filter(|c| c.edges.contains(&(edge as u32))).count());
            }
        }
        assert_eq!(conflicts.count(Fault::Near), plain.iter().filter(|c| c.fault == Fault::Near).count());
    }
}
