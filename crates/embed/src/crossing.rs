//! The swarm's crossing count: strict, fast, and free to stop early.
//!
//! **Input** positions as two flat arrays. **Output** the number of pairs of edges that meet, or that it is above
//! a limit. **Notation** a run is 8 edges next to each other in preorder, hence mostly a piece of a chain.
//! **Steps** 1. Box of each edge and each run. 2. Sort runs by their left border and sweep. 3. Where two run boxes
//! meet, box against box, then segment against segment.
//! **Guarantees** strict: edges that come nearer than 1e-6 of the median edge length count as meeting, and
//! siblings within 1e-6 rad, so that what has no crossing here has none after rounding, in the exact check.
//! A parent and its child never meet: r_a ≥ −0.97 keeps them apart. Same count for any limit that is not reached.
//! **Differs from the source** [Hu2022] checks coarse, then fine, over all pairs on a GPU.
//! **Cost** O(N log N + boxes that meet) time; no allocation after the first call.

use crate::problem::Problem;

/// Edges in a run: chains are contiguous, so a run's box is small, and 8 boxes fill one or two vector registers.
const RUN: usize = 8;
/// The tolerance as a share of the median edge length, and the least angle between siblings in rad.
const TOLERANCE: f64 = 1e-6;

/// What a particle's check needs; one per thread.
#[derive(Default)]
pub(crate) struct Scratch {
    /// Boxes of edges, grown by the tolerance; entry v − 1 is the edge above node v.
    edges: Boxes,
    /// Boxes of runs.
    runs: Boxes,
    /// Runs by left border.
    order: Vec<u32>,
}

#[derive(Default)]
struct Boxes {
    x_low: Vec<f64>,
    x_high: Vec<f64>,
    y_low: Vec<f64>,
    y_high: Vec<f64>,
}

impl Boxes {
    fn resize(&mut self, len: usize) {
        for side in [&mut self.x_low, &mut self.x_high, &mut self.y_low, &mut self.y_high] {
            side.resize(len, 0.0);
        }
    }

    fn meet(&self, a: usize, other: &Self, b: usize) -> bool {
        self.x_low[a] <= other.x_high[b]
            && other.x_low[b] <= self.x_high[a]
            && self.y_low[a] <= other.y_high[b]
            && other.y_low[b] <= self.y_high[a]
    }
}

/// The number of meeting pairs, or any number above `limit` if there are more than that.
pub(crate) fn count(problem: &Problem, x: &[f64], y: &[f64], limit: usize, scratch: &mut Scratch) -> usize {
    if x.len() < 3 {
        return 0;
    }
    let check = Check { problem, x, y, tolerance: TOLERANCE * problem.scale_mm };
    check.fill_boxes(scratch);
    let Scratch { edges, runs, order } = scratch;
    order
        .sort_unstable_by(|&a, &b| runs.x_low[a as usize].total_cmp(&runs.x_low[b as usize]).then(a.cmp(&b)));

    let mut n_met = 0;
    for (place, &run) in order.iter().enumerate() {
        let run = run as usize;
        n_met += check.within_run(edges, run);
        for &other in &order[place + 1..] {
            let other = other as usize;
            if runs.x_low[other] > runs.x_high[run] {
                break;
            }
            if runs.meet(run, runs, other) {
                n_met += check.between_runs(edges, runs, run.min(other), run.max(other));
            }
            if n_met > limit {
                return n_met;
            }
        }
        if n_met > limit {
            return n_met;
        }
    }
    n_met
}

struct Check<'a> {
    problem: &'a Problem<'a>,
    x: &'a [f64],
    y: &'a [f64],
    tolerance: f64,
}

impl Check<'_> {
    fn fill_boxes(&self, scratch: &mut Scratch) {
        let n_edges = self.x.len() - 1;
        let n_runs = n_edges.div_ceil(RUN);
        scratch.edges.resize(n_edges);
        scratch.runs.resize(n_runs);
        let grow = 0.5 * self.tolerance;
        for edge in 0..n_edges {
            let (node, parent) = (edge + 1, self.problem.parent[edge + 1] as usize);
            scratch.edges.x_low[edge] = self.x[node].min(self.x[parent]) - grow;
            scratch.edges.x_high[edge] = self.x[node].max(self.x[parent]) + grow;
            scratch.edges.y_low[edge] = self.y[node].min(self.y[parent]) - grow;
            scratch.edges.y_high[edge] = self.y[node].max(self.y[parent]) + grow;
        }
        let least = |sides: &[f64]| sides.iter().fold(f64::INFINITY, |least, &side| least.min(side));
        let most = |sides: &[f64]| sides.iter().fold(f64::NEG_INFINITY, |most, &side| most.max(side));
        for run in 0..n_runs {
            let range = run * RUN..n_edges.min((run + 1) * RUN);
            scratch.runs.x_low[run] = least(&scratch.edges.x_low[range.clone()]);
            scratch.runs.x_high[run] = most(&scratch.edges.x_high[range.clone()]);
            scratch.runs.y_low[run] = least(&scratch.edges.y_low[range.clone()]);
            scratch.runs.y_high[run] = most(&scratch.edges.y_high[range]);
        }
        scratch.order.clear();
        scratch.order.extend(0..n_runs as u32);
    }

    fn within_run(&self, edges: &Boxes, run: usize) -> usize {
        let range = run * RUN..(self.x.len() - 1).min((run + 1) * RUN);
        let mut n_met = 0;
        for first in range.clone() {
            for second in first + 1..range.end {
                n_met += usize::from(edges.meet(first, edges, second) && self.pair_meets(first, second));
            }
        }
        n_met
    }

    fn between_runs(&self, edges: &Boxes, runs: &Boxes, run: usize, other: usize) -> usize {
        let n_edges = self.x.len() - 1;
        let others = other * RUN..n_edges.min((other + 1) * RUN);
        let mut n_met = 0;
        for first in run * RUN..(run + 1) * RUN {
            if !edges.meet(first, runs, other) {
                continue;
            }
            for second in others.clone() {
                n_met += usize::from(edges.meet(first, edges, second) && self.pair_meets(first, second));
            }
        }
        n_met
    }

    /// Whether two edges, `first` before `second` in preorder, have a point in common that they should not have.
    fn pair_meets(&self, first: usize, second: usize) -> bool {
        let (a, b) = (first + 1, second + 1);
        let (parent_a, parent_b) = (self.problem.parent[a] as usize, self.problem.parent[b] as usize);
        if parent_b == a {
            return false;
        }
        let edge_a = [self.x[parent_a], self.y[parent_a], self.x[a], self.y[a]];
        let edge_b = [self.x[parent_b], self.y[parent_b], self.x[b], self.y[b]];
        if parent_a == parent_b {
            siblings_overlap(edge_a, edge_b)
        } else {
            segments_meet(edge_a, edge_b, self.tolerance)
        }
    }
}

/// Whether two edges from one hub point the same way to within the tolerance.
fn siblings_overlap([hub_x, hub_y, ax, ay]: [f64; 4], [_, _, bx, by]: [f64; 4]) -> bool {
    let (ux, uy, vx, vy) = (ax - hub_x, ay - hub_y, bx - hub_x, by - hub_y);
    let (cross, dot) = (ux * vy - uy * vx, ux * vx + uy * vy);
    dot >= 0.0 && cross.abs() <= TOLERANCE * dot
}

/// Whether two segments cross or come nearer than the tolerance.
fn segments_meet(s: [f64; 4], t: [f64; 4], tolerance: f64) -> bool {
    let (t_from, t_to, t_margin) = sides(s, t, tolerance);
    if (t_from > t_margin && t_to > t_margin) || (t_from < -t_margin && t_to < -t_margin) {
        return false;
    }
    let (s_from, s_to, s_margin) = sides(t, s, tolerance);
    if (s_from > s_margin && s_to > s_margin) || (s_from < -s_margin && s_to < -s_margin) {
        return false;
    }
    let is_proper = t_from * t_to < 0.0 && s_from * s_to < 0.0;
    is_proper || ends_near(s, t, tolerance) || ends_near(t, s, tolerance)
}

/// Twice the areas of (s, either end of t), and what the tolerance makes of them.
fn sides([ax, ay, bx, by]: [f64; 4], [cx, cy, dx, dy]: [f64; 4], tolerance: f64) -> (f64, f64, f64) {
    let (ux, uy) = (bx - ax, by - ay);
    let from = ux * (cy - ay) - uy * (cx - ax);
    let to = ux * (dy - ay) - uy * (dx - ax);
    // |u|₁ ≥ |u|: the margin errs on the strict side and needs no root.
    (from, to, tolerance * (ux.abs() + uy.abs()))
}

/// Whether an end of `t` is nearer than the tolerance to `s`.
fn ends_near([ax, ay, bx, by]: [f64; 4], [cx, cy, dx, dy]: [f64; 4], tolerance: f64) -> bool {
    let (ux, uy) = (bx - ax, by - ay);
    let length_squared = (ux * ux + uy * uy).max(f64::MIN_POSITIVE);
    let is_near = |px: f64, py: f64| {
        let along = (((px - ax) * ux + (py - ay) * uy) / length_squared).clamp(0.0, 1.0);
        let (off_x, off_y) = (px - ax - along * ux, py - ay - along * uy);
        off_x * off_x + off_y * off_y <= tolerance * tolerance
    };
    is_near(cx, cy) || is_near(dx, dy)
}
