//! A tree of boxes over the edges in preorder: neighbours in preorder are neighbours in the plane, mostly.
//!
//! **Input** a box per edge. **Output** the edges whose boxes meet a given one.
//! **Cost** O(N) to make; to ask, about O(log N + edges found) for layouts of trees.

use glam::DVec2;

/// An upright box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Box2 {
    pub(crate) low: DVec2,
    pub(crate) high: DVec2,
}

impl Box2 {
    const NOTHING: Self = Self { low: DVec2::INFINITY, high: DVec2::NEG_INFINITY };

    /// The box around a segment, grown by a margin.
    pub(crate) fn around(a: DVec2, b: DVec2, margin: f64) -> Self {
        Self { low: a.min(b) - margin, high: a.max(b) + margin }
    }

    fn meets(&self, other: &Self) -> bool {
        self.low.cmple(other.high).all() && other.low.cmple(self.high).all()
    }
}

/// Boxes of 1, 2, 4 … edges.
pub(crate) struct Boxes {
    levels: Vec<Vec<Box2>>,
    stack: Vec<(usize, usize)>,
}

impl Boxes {
    /// The boxes of the edges of nodes 1, 2 …; the root has no edge.
    pub(crate) fn new(n_nodes: usize, of_edge: impl Fn(usize) -> Box2) -> Self {
        let own = |node: usize| if node == 0 { Box2::NOTHING } else { of_edge(node) };
        let mut levels = vec![(0..n_nodes).map(own).collect::<Vec<Box2>>()];
        while levels[levels.len() - 1].len() > 1 {
            let join = |pair: &[Box2]| {
                pair.iter().fold(Box2::NOTHING, |all, one| Box2 {
                    low: all.low.min(one.low),
                    high: all.high.max(one.high),
                })
            };
            let next = levels[levels.len() - 1].chunks(2).map(join).collect();
            levels.push(next);
        }
        Self { levels, stack: Vec::new() }
    }

    /// The edges after `edge` whose boxes meet a box, in preorder.
    pub(crate) fn later_meeting(&mut self, edge: usize, asked: &Box2, found: &mut Vec<usize>) {
        found.clear();
        self.stack.push((self.levels.len() - 1, 0));
        while let Some((level, idx)) = self.stack.pop() {
            let last = ((idx + 1) << level) - 1;
            if last <= edge || !asked.meets(&self.levels[level][idx]) {
                continue;
            }
            if level == 0 {
                found.push(idx);
                continue;
            }
            let children = [2 * idx + 1, 2 * idx].into_iter();
            let n_below = self.levels[level - 1].len();
            self.stack.extend(children.filter(|&child| child < n_below).map(|child| (level - 1, child)));
        }
    }
}
