//! Oriented boxes over ranges of the preorder: who may meet whom, while whole subtrees move.
//!
//! **Input** edges by their lower nodes; parts of the preorder that move, each by a similarity. **Output** the pairs
//! of edges that may come near each other *if* they moved so; or the moved layout.
//! **Notation** a subtree is a range of the preorder, so a motion of it is a motion of a range. A *piece* is a range
//! with one motion; pieces with the same motion are a *group*.
//! **Steps** a binary tree over blocks of edges, each node with a box that holds its edges. A range moves by a motion
//! that waits at the few nodes that cover it, and is handed down when somebody looks below. A question walks down
//! pairs of nodes: a pair is done when both are in one group, which moves as a whole, or when their moved boxes
//! are apart.
//! **Guarantees** every pair of edges of different groups that would be nearer than the margin is visited; in a fixed
//! order.
//! **Source** the chain tree of [Lotan2004], on the preorder of a tree and with oriented boxes.
//! **Differs from the source** a grid with every moved edge in it costs the size of the smaller part for each
//! question, thousands of edges for a branch near the root; here a question costs what is near, and log N.
//! **Cost** O(log N) to move a range; O(log² N + pairs that are near) to ask. Depth log N.

use std::ops::Range;

use espalier_geom::plane::Segment;
use glam::DVec2;

use super::joint::Pieces;
use super::oriented_box::OrientedBox;
use super::similarity::Similarity;

/// Edges in a block: fewer make more boxes, more make more pairs of edges in blocks that are near.
const BLOCK: usize = 4;

/// A node of the hierarchy.
#[derive(Clone, Copy)]
struct Node {
    bounds: OrientedBox,
    /// What the nodes below have still to go through.
    waiting: Option<Similarity>,
}

/// Two edges that may come near each other, as they lie and as they would lie.
pub(crate) struct Pair {
    pub(crate) edges: (usize, usize),
    pub(crate) before: [Segment; 2],
    pub(crate) after: [Segment; 2],
}

/// The boxes of a layout.
pub(crate) struct Hierarchy {
    n_edges: usize,
    n_leaves: usize,
    nodes: Vec<Node>,
    /// Both ends of each edge, the parent's first, as the leaf has them.
    edges: Vec<Segment>,
    /// For the question at hand: upright boxes of nodes with several pieces below them.
    mixed: Vec<OrientedBox>,
    stack: Vec<(u32, u32)>,
    /// Boxes and pairs of edges looked at so far.
    pub(crate) n_looked: u64,
}

impl Hierarchy {
    /// The boxes of a layout by parents and positions.
    pub(crate) fn new(parent: &[u32], positions: &[DVec2]) -> Self {
        let n_edges = positions.len();
        let n_leaves = n_edges.div_ceil(BLOCK).next_power_of_two();
        let empty = Node { bounds: OrientedBox::EMPTY, waiting: None };
        let mut hierarchy = Self {
            n_edges,
            n_leaves,
            nodes: vec![empty; 2 * n_leaves],
            edges: vec![Segment { a: DVec2::ZERO, b: DVec2::ZERO }; n_edges],
            mixed: vec![OrientedBox::EMPTY; 2 * n_leaves],
            stack: Vec::new(),
            n_looked: 0,
        };
        hierarchy.place(parent, positions);
        hierarchy
    }

    /// Puts all edges where they belong, exactly.
    pub(crate) fn place(&mut self, parent: &[u32], positions: &[DVec2]) {
        for (node, edge) in self.edges.iter_mut().enumerate() {
            *edge = Segment { a: positions[parent[node] as usize], b: positions[node] };
        }
        for node in (1..2 * self.n_leaves).rev() {
            self.nodes[node].waiting = None;
            if node >= self.n_leaves {
                self.fit_leaf(node);
            } else {
                self.fit(node);
            }
        }
    }

    /// An edge as it lies.
    pub(crate) fn edge(&mut self, edge: usize) -> Segment {
        let leaf = self.n_leaves + edge / BLOCK;
        for level in (1..=self.n_leaves.ilog2()).rev() {
            self.hand_down(leaf >> level);
        }
        self.edges[edge]
    }

    /// Moves a range of edges.
    pub(crate) fn move_range(&mut self, range: &Range<usize>, motion: &Similarity) {
        self.move_below(1, range, motion);
    }

    /// As [`Self::move_range`], for what is below a node. Goes down log N levels.
    fn move_below(&mut self, node: usize, range: &Range<usize>, motion: &Similarity) {
        let own = self.range(node);
        if own.end <= range.start || range.end <= own.start {
            return;
        }
        if range.start <= own.start && own.end <= range.end {
            self.move_whole(node, motion);
        } else if node >= self.n_leaves {
            for edge in own.start.max(range.start)..own.end.min(range.end) {
                self.edges[edge] = moved(&self.edges[edge], motion);
            }
            self.fit_leaf(node);
        } else {
            self.hand_down(node);
            self.move_below(2 * node, range, motion);
            self.move_below(2 * node + 1, range, motion);
            self.fit(node);
        }
    }

    fn move_whole(&mut self, node: usize, motion: &Similarity) {
        self.nodes[node].bounds = self.nodes[node].bounds.moved(motion);
        if node >= self.n_leaves {
            for edge in self.range(node) {
                self.edges[edge] = moved(&self.edges[edge], motion);
            }
        } else {
            let waiting = self.nodes[node].waiting.map_or(*motion, |first| motion.after(&first));
            self.nodes[node].waiting = Some(waiting);
        }
    }

    fn hand_down(&mut self, node: usize) {
        if let Some(motion) = self.nodes[node].waiting.take() {
            self.move_whole(2 * node, &motion);
            self.move_whole(2 * node + 1, &motion);
        }
    }

    fn fit(&mut self, node: usize) {
        self.nodes[node].bounds = self.nodes[2 * node].bounds.joined(&self.nodes[2 * node + 1].bounds);
    }

    fn fit_leaf(&mut self, leaf: usize) {
        // The root has no edge.
        let range = self.range(leaf);
        let edges = &self.edges[range.start.max(1).min(range.end)..range.end];
        self.nodes[leaf].bounds = OrientedBox::around(edges);
    }

    /// The edges below a node.
    #[inline]
    fn range(&self, node: usize) -> Range<usize> {
        let level = node.ilog2();
        let width = (self.n_leaves >> level) * BLOCK;
        let start = (node - (1 << level)) * width;
        start.min(self.n_edges)..(start + width).min(self.n_edges)
    }

    /// Visits the pairs of edges within a range that the motion of the pieces may bring nearer than the margin, until
    /// `visit` says no; whether it never did.
    pub(crate) fn each_near(
        &mut self,
        pieces: &Pieces,
        window: &Range<usize>,
        margin_mm: f64,
        mut visit: impl FnMut(&Pair) -> bool,
    ) -> bool {
        self.mix(1, pieces, window);
        let mut stack = std::mem::take(&mut self.stack);
        stack.clear();
        stack.push((1, 1));
        let mut goes_on = true;
        while let Some((a, b)) = stack.pop() {
            let (a, b) = (a as usize, b as usize);
            let (of_a, of_b) = (clip(self.range(a), window), clip(self.range(b), window));
            if of_a.is_empty() || of_b.is_empty() {
                continue;
            }
            self.n_looked += 1;
            let (piece_a, piece_b) = (pieces.whole(&of_a), pieces.whole(&of_b));
            if let (Some(piece_a), Some(piece_b)) = (piece_a, piece_b)
                && pieces.move_together(piece_a, piece_b)
            {
                continue;
            }
            if a != b {
                let bounds = |node: usize, piece: Option<usize>| match piece {
                    Some(piece) => self.nodes[node].bounds.moved(&pieces.motions[piece]),
                    None => self.mixed[node],
                };
                if bounds(a, piece_a).is_apart(&bounds(b, piece_b), margin_mm) {
                    continue;
                }
            }
            if a >= self.n_leaves && b >= self.n_leaves {
                goes_on = self.each_near_in_blocks(pieces, (of_a, of_b), margin_mm, &mut visit);
                if !goes_on {
                    break;
                }
            } else if a == b {
                self.hand_down(a);
                let (low, high) = (2 * a as u32, 2 * a as u32 + 1);
                stack.extend([(low, low), (low, high), (high, high)]);
            } else if self.is_first_opened((a, piece_a), (b, piece_b)) {
                self.hand_down(a);
                stack.extend([(2 * a as u32, b as u32), (2 * a as u32 + 1, b as u32)]);
            } else {
                self.hand_down(b);
                stack.extend([(a as u32, 2 * b as u32), (a as u32, 2 * b as u32 + 1)]);
            }
        }
        self.stack = stack;
        goes_on
    }

    /// Finds the boxes of nodes with several pieces below them, from a node down; the upright box of the node. Goes
    /// down log N levels.
    fn mix(&mut self, node: usize, pieces: &Pieces, window: &Range<usize>) -> OrientedBox {
        let own = clip(self.range(node), window);
        if own.is_empty() {
            return OrientedBox::EMPTY;
        }
        if let Some(piece) = pieces.whole(&own) {
            return self.nodes[node].bounds.moved(&pieces.motions[piece]).upright();
        }
        self.n_looked += 1;
        let bounds = if node >= self.n_leaves {
            let (from, to) = (own.start.max(1), own.end);
            let moved = |edge: usize| moved(&self.edges[edge], &pieces.motions[pieces.of(edge)]);
            let ends = (from..to).map(moved).flat_map(|edge| [edge.a, edge.b]);
            if from < to { OrientedBox::of_points(ends, DVec2::X) } else { OrientedBox::EMPTY }
        } else {
            self.hand_down(node);
            let (first, second) =
                (self.mix(2 * node, pieces, window), self.mix(2 * node + 1, pieces, window));
            first.joined_upright(&second)
        };
        self.mixed[node] = bounds;
        bounds
    }

    /// Which of two nodes to look into: one of many pieces, else the larger one.
    fn is_first_opened(
        &self,
        (a, piece_a): (usize, Option<usize>),
        (b, piece_b): (usize, Option<usize>),
    ) -> bool {
        if a >= self.n_leaves || b >= self.n_leaves {
            return a < self.n_leaves;
        }
        match (piece_a, piece_b) {
            (None, Some(_)) => true,
            (Some(_), None) => false,
            _ => self.nodes[a].bounds.size() >= self.nodes[b].bounds.size(),
        }
    }

    fn each_near_in_blocks(
        &mut self,
        pieces: &Pieces,
        (of_a, of_b): (Range<usize>, Range<usize>),
        margin_mm: f64,
        visit: &mut impl FnMut(&Pair) -> bool,
    ) -> bool {
        let is_same = of_a == of_b;
        let mut others = [(Segment { a: DVec2::ZERO, b: DVec2::ZERO }, 0); BLOCK];
        for (other, edge) in others.iter_mut().zip(of_b.clone()) {
            let piece = pieces.of(edge);
            *other = (moved(&self.edges[edge], &pieces.motions[piece]), piece);
        }
        for edge in of_a.start.max(1)..of_a.end {
            let piece = pieces.of(edge);
            let after = moved(&self.edges[edge], &pieces.motions[piece]);
            let from = if is_same { edge + 1 } else { of_b.start.max(1) };
            for other in from..of_b.end {
                let (other_after, other_piece) = others[other - of_b.start];
                self.n_looked += 1;
                if pieces.move_together(piece, other_piece) || are_apart(&after, &other_after, margin_mm) {
                    continue;
                }
                let pair = Pair {
                    edges: (edge, other),
                    before: [self.edges[edge], self.edges[other]],
                    after: [after, other_after],
                };
                if !visit(&pair) {
                    return false;
                }
            }
        }
        true
    }
}

#[inline]
fn clip(range: Range<usize>, window: &Range<usize>) -> Range<usize> {
    range.start.max(window.start)..range.end.min(window.end)
}

/// An edge after a motion.
#[inline]
pub(crate) fn moved(edge: &Segment, motion: &Similarity) -> Segment {
    Segment { a: motion.of(edge.a), b: motion.of(edge.b) }
}

/// Whether the upright boxes of two edges are farther apart than the margin.
#[inline]
fn are_apart(s: &Segment, t: &Segment, margin: f64) -> bool {
    let low = s.a.min(s.b).max(t.a.min(t.b));
    let high = s.a.max(s.b).min(t.a.max(t.b));
    low.x > high.x + margin || low.y > high.y + margin
}
