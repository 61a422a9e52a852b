//! A joint move: several ratios changed at once, and what it does to the layout.
//!
//! **Input** new values for some ratios. **Output** the parts that move, each a range of the preorder with a similarity;
//! the pieces into which they cut the preorder.
//! **Notation** a change of r_a at node v turns the range of v's subtree about v's parent. A change of r_l scales the
//! segment's nodes about its hub, and shifts what is below its end: that is the subtree below scaled with it and
//! scaled back about the end. So every change is one or two parts, parts are nested or apart, and a piece moves by
//! the outer part's motion after the inner one's.
//! **Cost** O(k log k) for k changes.

use std::ops::Range;

use glam::DVec2;

use super::similarity::Similarity;

/// New values for ratios; a ratio appears once.
#[derive(Clone, Debug, Default)]
pub(crate) struct Change {
    /// Nodes with their new r_a.
    pub(crate) angles: Vec<(usize, f64)>,
    /// Segments with their new r_l.
    pub(crate) lengths: Vec<(usize, f64)>,
}

impl Change {
    pub(crate) fn clear(&mut self) {
        self.angles.clear();
        self.lengths.clear();
    }

    /// How many ratios change.
    pub(crate) fn n_ratios(&self) -> usize {
        self.angles.len() + self.lengths.len()
    }
}

/// A range of the preorder that turns and scales about a point.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    pub(crate) range: Range<usize>,
    pub(crate) pivot: DVec2,
    /// The turn, as cosine and sine times the scale.
    pub(crate) turn: DVec2,
    /// The turn in rad.
    pub(crate) turn_rad: f64,
}

impl Part {
    pub(crate) fn motion(&self) -> Similarity {
        Similarity::about(self.pivot, self.turn)
    }
}

/// The preorder cut into ranges of one motion each.
#[derive(Debug, Default)]
pub(crate) struct Pieces {
    /// Where each piece starts; the first at 0.
    starts: Vec<usize>,
    pub(crate) motions: Vec<Similarity>,
    /// Pieces of one group have the same motion.
    groups: Vec<usize>,
    /// By how much a piece turns in all, in rad.
    turns_rad: Vec<f64>,
    /// Whether the edges of a piece keep their distances, or widen them.
    is_rigid: Vec<bool>,
    open: Vec<Open>,
}

/// A part that has started and not ended.
#[derive(Clone, Copy, Debug)]
struct Open {
    end: usize,
    motion: Similarity,
    turn_rad: f64,
    group: usize,
}

impl Pieces {
    /// Cuts the preorder of `n_nodes` by parts, which are sorted here so that outer parts stand before inner ones.
    pub(crate) fn cut(&mut self, parts: &mut [Part], n_nodes: usize) {
        parts.sort_by(|a, b| (a.range.start, b.range.end).cmp(&(b.range.start, a.range.end)));
        self.starts.clear();
        self.motions.clear();
        self.groups.clear();
        self.turns_rad.clear();
        self.is_rigid.clear();
        self.open.clear();
        let mut top = Open { end: n_nodes, motion: Similarity::IDENTITY, turn_rad: 0.0, group: 0 };
        self.start(0, top);
        for (idx, part) in parts.iter().enumerate() {
            top = self.close_up_to(part.range.start, top);
            self.open.push(top);
            top = Open {
                end: part.range.end,
                motion: top.motion.after(&part.motion()),
                turn_rad: top.turn_rad + part.turn_rad,
                group: idx + 1,
            };
            self.start(part.range.start, top);
        }
        self.close_up_to(n_nodes - 1, top);
    }

    /// Cuts the preorder at some nodes, in order; nothing moves, and each piece is a group of its own. The first
    /// pieces, as many as said, are not rigid.
    pub(crate) fn cut_at(&mut self, starts: impl Iterator<Item = usize>, n_loose: usize) {
        self.starts.clear();
        self.starts.extend(starts);
        let n_pieces = self.starts.len();
        self.motions.clear();
        self.motions.resize(n_pieces, Similarity::IDENTITY);
        self.groups.clear();
        self.groups.extend(0..n_pieces);
        self.is_rigid.clear();
        self.is_rigid.extend((0..n_pieces).map(|piece| piece >= n_loose));
    }

    /// Closes parts that end at or before a node; what is open then.
    fn close_up_to(&mut self, node: usize, mut top: Open) -> Open {
        while top.end <= node
            && let Some(outer) = self.open.pop()
        {
            self.start(top.end, outer);
            top = outer;
        }
        top
    }

    /// Starts a piece; one that starts at the same node has no nodes and goes.
    fn start(&mut self, node: usize, Open { motion, turn_rad, group, .. }: Open) {
        if self.starts.last() == Some(&node) {
            self.starts.pop();
            self.motions.pop();
            self.groups.pop();
            self.turns_rad.pop();
            self.is_rigid.pop();
        }
        self.starts.push(node);
        self.motions.push(motion);
        self.groups.push(group);
        self.turns_rad.push(turn_rad);
        self.is_rigid.push(motion.scale() > 1.0 - 1e-12);
    }

    /// The ranges of a preorder of `n_nodes` that turn, and by how much, in rad.
    pub(crate) fn turns(&self, n_nodes: usize) -> impl Iterator<Item = (Range<usize>, f64)> + '_ {
        let ends = self.starts.iter().skip(1).copied().chain(std::iter::once(n_nodes));
        let ranges = self.starts.iter().zip(ends).map(|(&start, end)| start..end);
        ranges
            .zip(&self.turns_rad)
            .map(|(range, &turn_rad)| (range, turn_rad))
            .filter(|(_, turn)| *turn != 0.0)
    }

    /// The piece of a node.
    #[inline]
    pub(crate) fn of(&self, node: usize) -> usize {
        self.starts.partition_point(|&start| start <= node) - 1
    }

    /// The piece of all nodes of a range, which is not empty, if it is one.
    #[inline]
    pub(crate) fn whole(&self, range: &Range<usize>) -> Option<usize> {
        let piece = self.of(range.start);
        let holds = self.starts.get(piece + 1).is_none_or(|&next| range.end <= next);
        holds.then_some(piece)
    }

    /// Whether two pieces keep the distances of their edges, or widen them.
    #[inline]
    pub(crate) fn move_together(&self, a: usize, b: usize) -> bool {
        self.groups[a] == self.groups[b] && self.is_rigid[a]
    }
}
