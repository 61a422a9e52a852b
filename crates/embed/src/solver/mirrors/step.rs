//! A change of sides, and what a layout costs.
//!
//! **Notation** a part is a range of the preorder with an isometry; part 0 is all that is in no other part, and does not
//! move.

use std::ops::Range;

use super::conflicts::Fault;
use super::isometry::Isometry;

/// A part of the tree and where it goes.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub(super) range: Range<usize>,
    pub(super) isometry: Isometry,
}

/// The new turn of a node whose parent is in another part.
#[derive(Clone, Debug)]
pub(super) struct NewTurn {
    pub(super) node: usize,
    pub(super) turn_rad: f64,
    pub(super) side: f64,
}

/// A change of sides.
#[derive(Clone, Debug, Default)]
pub(super) struct Step {
    pub(super) parts: Vec<Part>,
    pub(super) turns: Vec<NewTurn>,
    /// By how much the sibling error grows.
    pub(super) siblings_rad: f64,
    /// By how much the zigzags grow.
    pub(super) zigzags_rad: f64,
}

impl Step {
    pub(super) fn clear(&mut self) {
        self.parts.clear();
        self.turns.clear();
        (self.siblings_rad, self.zigzags_rad) = (0.0, 0.0);
    }

    /// The part of an edge.
    pub(super) fn part_of(&self, edge: usize) -> usize {
        self.parts.iter().position(|part| part.range.contains(&edge)).map_or(0, |idx| idx + 1)
    }

    /// The ranges of a part.
    pub(super) fn ranges_of(&self, part: usize, n_edges: usize, ranges: &mut Vec<Range<usize>>) {
        ranges.clear();
        if part > 0 {
            ranges.push(self.parts[part - 1].range.clone());
            return;
        }
        let mut start = 0;
        for Part { range, .. } in &self.parts {
            ranges.push(start..range.start);
            start = range.end;
        }
        ranges.push(start..n_edges);
    }
}

/// What a layout costs beside its crossings, part by part.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Terms {
    pub(crate) crossings: usize,
    pub(crate) near: usize,
    pub(crate) kept_out: usize,
    /// 1 − |Σ p e^{i(h − H)}|, in [0, 1].
    pub(crate) placement: f64,
    pub(crate) siblings_rad: f64,
    pub(crate) zigzags_rad: f64,
}

/// The price of each term; a crossing costs 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prices {
    pub(super) near: f64,
    pub(super) kept_out: f64,
    pub(super) placement: f64,
    pub(super) siblings: f64,
    pub(super) zigzags: f64,
}

impl Prices {
    pub(super) fn of(&self, fault: Fault) -> f64 {
        match fault {
            Fault::Crossing => 1.0,
            Fault::Near => self.near,
            Fault::KeepOut => self.kept_out,
        }
    }

    pub(super) fn cost(&self, terms: &Terms) -> f64 {
        terms.crossings as f64
            + self.near * terms.near as f64
            + self.kept_out * terms.kept_out as f64
            + self.placement * terms.placement
            + self.siblings * terms.siblings_rad
            + self.zigzags * terms.zigzags_rad
    }
}
