//! The placement term while whole subtrees turn.
//!
//! **Input** headings; ranges of the preorder that turn. **Output** by how much a turn lowers the term, in log N.
//! **Notation** p cost of a node's placement, *off* its heading less that in the global view, after the rotation that
//! suits all best. The term is Σ p off²; a range that turns by δ changes it by 2 δ Σ p off + δ² Σ p.
//! **Steps** prefix sums of p; prefix sums of p off as they were at the last look, and two Fenwick trees with the turns
//! since then: at i the sum has grown by P(i) Σ δ − Σ δ P(start) over the turns that start before i.
//! **Guarantees** exact for the rotation, and the whole turns in *off*, of the last look. The rotation of `energy` is
//! that of the greatest Σ p cos(off), not of the least term, so a look may find the term a little higher.
//! **Source** ours; the term is that of `energy`. The trees are those of [Fenwick1994].
//! **Cost** O(N) to look, O(log N) to ask or to turn.

use std::ops::Range;

use espalier_geom::angle::wrap;
use espalier_geom::math;

use crate::problem::Problem;

/// The placement term of a layout.
pub(crate) struct Placement {
    /// Σ p over the nodes before each.
    cost_before: Vec<f64>,
    /// Σ p off over the nodes before each, at the last look.
    moment_before: Vec<f64>,
    /// Turns by where they start (and end, negative), and those times `cost_before` there.
    turns: Vec<[f64; 2]>,
    /// Σ p off².
    pub(crate) total: f64,
}

impl Placement {
    pub(crate) fn of(problem: &Problem, heading_rad: &[f64]) -> Self {
        let n_nodes = problem.n_nodes();
        let mut placement = Self {
            cost_before: vec![0.0; n_nodes + 1],
            moment_before: vec![0.0; n_nodes + 1],
            turns: vec![[0.0; 2]; n_nodes + 2],
            total: 0.0,
        };
        placement.look(problem, heading_rad);
        placement
    }

    /// Starts anew from headings.
    pub(crate) fn look(&mut self, problem: &Problem, heading_rad: &[f64]) {
        let rotation = best_rotation(problem, heading_rad);
        self.turns.fill([0.0; 2]);
        self.total = 0.0;
        for (node, &cost) in problem.placement_cost.iter().enumerate() {
            let off = wrap(heading_rad[node] + rotation - problem.targets.heading_rad[node]);
            self.cost_before[node + 1] = self.cost_before[node] + cost;
            self.moment_before[node + 1] = self.moment_before[node] + cost * off;
            self.total += cost * (off * off);
        }
    }

    /// By how much the term falls if a range turns.
    pub(crate) fn gain(&self, range: &Range<usize>, turn_rad: f64) -> f64 {
        if turn_rad == 0.0 {
            return 0.0;
        }
        let (moment, cost) = self.sums(range);
        -turn_rad * (2.0 * moment + turn_rad * cost)
    }

    /// Σ p off and Σ p over a range.
    pub(crate) fn sums(&self, range: &Range<usize>) -> (f64, f64) {
        let cost = self.cost_before[range.end] - self.cost_before[range.start];
        (self.moment(range.end) - self.moment(range.start), cost)
    }

    /// Turns a range.
    pub(crate) fn turn(&mut self, range: &Range<usize>, turn_rad: f64) {
        self.add(range.start, turn_rad);
        self.add(range.end, -turn_rad);
    }

    /// Σ p off over the nodes before one.
    fn moment(&self, node: usize) -> f64 {
        let (mut turn, mut offset, mut at) = (0.0, 0.0, node + 1);
        while at > 0 {
            turn += self.turns[at][0];
            offset += self.turns[at][1];
            at &= at - 1;
        }
        self.moment_before[node] + self.cost_before[node] * turn - offset
    }

    fn add(&mut self, node: usize, turn_rad: f64) {
        let mut at = node + 1;
        while at < self.turns.len() {
            self.turns[at][0] += turn_rad;
            self.turns[at][1] += turn_rad * self.cost_before[node];
            at += at & at.wrapping_neg();
        }
    }
}

/// The rotation of the whole for which Σ p cos(off) is largest.
fn best_rotation(problem: &Problem, heading_rad: &[f64]) -> f64 {
    let (mut cos_sum, mut sin_sum) = (0.0, 0.0);
    for (node, &heading_rad) in heading_rad.iter().enumerate().skip(1) {
        let (sin, cos) = math::sin_cos(heading_rad);
        cos_sum += problem.placement_cos[node] * cos + problem.placement_sin[node] * sin;
        sin_sum += problem.placement_sin[node] * cos - problem.placement_cos[node] * sin;
    }
    math::atan2(sin_sum, cos_sum)
}
