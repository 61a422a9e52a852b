//! The swarm's crossing count: strict, fast, and free to stop early.
//!
//! **Input** positions as two flat arrays. **Output** the number of pairs of edges that meet, or that it is above
//! a limit. **Notation** a run is 8 edges next to each other in preorder, hence mostly a piece of a chain.
//! **Steps** 1. Box of each edge, in single precision and rounded outwards, so that a run's boxes fill vector
//! registers; box of each run. 2. Sort runs by their left border and sweep. 3. Where two run boxes meet: which
//! edges of one reach the other, which of those boxes meet, then segment against segment in double precision. 4. Runs
//! of edges that all come from one node are left out of 3: of those, in the order of their angles, neighbours.
//! **Guarantees** strict: edges that come nearer than 1e-6 of the median edge length count as meeting, and
//! siblings within 1e-6 rad, so that what has no crossing here has none after rounding, in the exact check.
//! A parent and its child never meet: r_a ≥ −0.97 keeps them apart. Same count for any limit that is not reached.
//! **Differs from the source** [Hu2022] checks coarse, then fine, over all pairs on a GPU.
//! **Cost** O(N log N + boxes that meet) time; no allocation after the first call.

use std::f64::consts::{PI, TAU};

use espalier_geom::math;
use glam::DVec2;

use crate::problem::Problem;
use crate::runs::{Lanes, MIXED, RUN, UprightBox, is_same_fan};

/// The tolerance as a share of the median edge length, and the least angle between siblings in rad.
pub(crate) const TOLERANCE: f64 = 1e-6;
/// Edges from one node whose directions differ by more do not meet.
const SAME_DIRECTION_RAD: f64 = 2.0 * TOLERANCE;
/// What a particle's check needs; one per thread.
#[derive(Default)]
pub(crate) struct Scratch {
    /// The boxes of each run's edges in median edge lengths, grown by half the tolerance; lane i of run k is the edge
    /// above node 8 k + i + 1.
    lanes: Vec<Lanes>,
    /// The boxes of runs, by left border.
    runs: Vec<RunBox>,
}

#[derive(Clone, Copy)]
struct RunBox {
    bounds: UprightBox,
    run: u32,
    /// The node from which all edges of the run come, or `MIXED`.
    hub: u32,
}

/// Whether no pair of edges meets.
pub(crate) fn is_planar(problem: &Problem, positions: &[DVec2]) -> bool {
    count_at(problem, positions, 0) == 0
}

/// As [`count`], of points.
pub(crate) fn count_at(problem: &Problem, positions: &[DVec2], limit: usize) -> usize {
    let (x, y): (Vec<f64>, Vec<f64>) = positions.iter().map(|p| (p.x, p.y)).unzip();
    count(problem, &x, &y, limit, &mut Scratch::default())
}

/// The number of meeting pairs, or any number above `limit` if there are more than that.
pub(crate) fn count(problem: &Problem, x: &[f64], y: &[f64], limit: usize, scratch: &mut Scratch) -> usize {
    if x.len() < 3 {
        return 0;
    }
    let check = Check { problem, x, y, tolerance: TOLERANCE * problem.scale_mm };
    check.fill_boxes(scratch);
    let Scratch { lanes, runs } = scratch;
    runs.sort_unstable_by(|a, b| a.bounds.x_low.total_cmp(&b.bounds.x_low).then(a.run.cmp(&b.run)));

    let mut n_met = 0;
    for (place, &RunBox { bounds, run, hub }) in runs.iter().enumerate() {
        n_met += check.within_run(lanes, run as usize);
        for other in runs[place + 1..].iter().take_while(|other| other.bounds.x_low <= bounds.x_high) {
            let is_apart = other.bounds.y_low > bounds.y_high || bounds.y_low > other.bounds.y_high;
            if !(is_apart || is_same_fan(hub, other.hub)) {
                n_met += check.between_runs(lanes, run as usize, other);
                if n_met > limit {
                    return n_met;
                }
            }
        }
        if n_met > limit {
            return n_met;
        }
    }
    n_met + check.between_fans(runs, limit.saturating_sub(n_met))
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
        let per_mm = 1.0 / self.problem.scale_mm;
        scratch.lanes.clear();
        scratch.lanes.resize(n_runs, Lanes::EMPTY);
        scratch.runs.clear();
        for (run, lanes) in scratch.lanes.iter_mut().enumerate() {
            let mut all = UprightBox::EMPTY;
            for lane in 0..RUN.min(n_edges - run * RUN) {
                let node = run * RUN + lane + 1;
                let parent = self.problem.parent[node] as usize;
                let of = |node: usize| (self.x[node] * per_mm, self.y[node] * per_mm);
                let bounds = UprightBox::around(of(node), of(parent), 0.5 * TOLERANCE);
                lanes.set(lane, bounds);
                all = all.joined(&bounds);
            }
            let edges = run * RUN + 1..(run * RUN + RUN).min(n_edges) + 1;
            let hub = self.problem.parent[edges.start];
            let is_fan = self.problem.parent[edges].iter().all(|&parent| parent == hub);
            scratch.runs.push(RunBox { bounds: all, run: run as u32, hub: if is_fan { hub } else { MIXED } });
        }
    }

    /// How many edges of different runs from one hub point the same way, up to one more than a limit.
    ///
    /// All boxes at the middle of a star meet, but in the order of their angles only neighbours can.
    fn between_fans(&self, runs: &[RunBox], limit: usize) -> usize {
        let mut fans: Vec<(u32, u32)> =
            runs.iter().filter(|run| run.hub != MIXED).map(|run| (run.hub, run.run)).collect();
        fans.sort_unstable();
        let mut n_met = 0;
        for fan in fans.chunk_by(|a, b| a.0 == b.0).filter(|fan| fan.len() > 1) {
            let (hub, n_edges) = (fan[0].0 as usize, self.x.len() - 1);
            let edges = |run: usize| run * RUN..(run * RUN + RUN).min(n_edges);
            let edges = fan.iter().flat_map(|&(_, run)| edges(run as usize));
            let angle =
                |edge: usize| math::atan2(self.y[edge + 1] - self.y[hub], self.x[edge + 1] - self.x[hub]);
            let mut order: Vec<(f64, usize)> = edges.map(|edge| (angle(edge), edge)).collect();
            order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            // The first ones follow the last ones.
            let n_after = order.partition_point(|&(angle, _)| angle <= SAME_DIRECTION_RAD - PI);
            let n_edges = order.len();
            order.extend_from_within(..n_after);
            order[n_edges..].iter_mut().for_each(|(angle, _)| *angle += TAU);
            for (place, &(angle, edge)) in order[..n_edges].iter().enumerate() {
                let near =
                    order[place + 1..].iter().take_while(|other| other.0 <= angle + SAME_DIRECTION_RAD);
                let is_met = |&&(_, other): &&(f64, usize)| {
                    edge / RUN != other / RUN && self.pair_meets(edge.min(other), edge.max(other))
                };
                n_met += near.filter(is_met).count();
                if n_met > limit {
                    return n_met;
                }
            }
        }
        n_met
    }

    fn within_run(&self, lanes: &[Lanes], run: usize) -> usize {
        let boxes = &lanes[run];
        let mut n_met = 0;
        for lane in 0..RUN - 1 {
            // Only lanes after this one.
            let met = boxes.meeting(boxes.get(lane)) & (!1 << lane);
            n_met += self.pairs_meeting(run * RUN + lane, run * RUN, met);
        }
        n_met
    }

    fn between_runs(&self, lanes: &[Lanes], run: usize, other: &RunBox) -> usize {
        let (boxes, other_boxes) = (&lanes[run], &lanes[other.run as usize]);
        let mut reaching = boxes.meeting(other.bounds);
        let mut n_met = 0;
        while reaching != 0 {
            let lane = reaching.trailing_zeros() as usize;
            reaching &= reaching - 1;
            let met = other_boxes.meeting(boxes.get(lane));
            n_met += self.pairs_meeting(run * RUN + lane, other.run as usize * RUN, met);
        }
        n_met
    }

    /// How many of the edges `start + lane`, for the lanes whose bit is set, meet an edge.
    #[inline]
    fn pairs_meeting(&self, edge: usize, start: usize, mut lanes: u32) -> usize {
        let mut n_met = 0;
        while lanes != 0 {
            let other = start + lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            n_met += usize::from(self.pair_meets(edge.min(other), edge.max(other)));
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
            neighbours_overlap(edge_a, edge_b)
        } else {
            segments_meet(edge_a, edge_b, self.tolerance)
        }
    }
}

/// Whether two edges from one hub point the same way to within the tolerance.
pub(crate) fn neighbours_overlap([hub_x, hub_y, ax, ay]: [f64; 4], [_, _, bx, by]: [f64; 4]) -> bool {
    let (ux, uy, vx, vy) = (ax - hub_x, ay - hub_y, bx - hub_x, by - hub_y);
    let (cross, dot) = (ux * vy - uy * vx, ux * vx + uy * vy);
    dot >= 0.0 && cross.abs() <= TOLERANCE * dot
}

/// Whether two segments cross or come nearer than the tolerance.
pub(crate) fn segments_meet(s: [f64; 4], t: [f64; 4], tolerance: f64) -> bool {
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
