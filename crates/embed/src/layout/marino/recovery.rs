//! Turning subtrees back to what the view shows, without a crossing on the way.
//!
//! **Input** a layout without crossings, by headings; Δ of every node. **Output** headings, and how Δ fell.
//! **Steps** breadth-first sweeps over the nodes: turn the whole subtree of a node about its parent by κ Δ; not, if an
//! edge that moved would meet one that did not. Until all |Δ| are small, a sweep changes nothing, or the sweeps or
//! the work are at their limit.
//! **Guarantees** no crossing after any step. Σ |Δ| never rises: a turn changes its own Δ only, towards 0.
//! **Source** [Marino2015]. **Differs from the source** κ, the bounds and the order of the sweeps are ours.
//! **Cost** a few hundred pairs of circles per step (see `circles`), N steps per sweep, 60 to 130 sweeps; bounded by
//! work, so that above some 10,000 nodes, and on large stars, the recovery is cut short, which the row then says.

use espalier_geom::math;
use glam::DVec2;

use super::circles::{Circles, Motion};
use crate::place;
use crate::problem::Problem;
use crate::prospect::Prospect;
use crate::solver::Work;

/// κ, the share of Δ that one step takes. Small steps let siblings make way for each other.
const KAPPA: f64 = 0.1;
/// Below this a step takes all of Δ, rad.
const SNAP_RAD: f64 = 1e-3;
/// The recovery ends when no |Δ| is larger, rad.
const DONE_RAD: f64 = 1e-4;
/// The most sweeps; phantoms and neurons take 60 to 130.
const MAX_SWEEPS: usize = 400;
/// The most work, in pairs of circles: 4 to 8 s. A neuron of 10,000 nodes takes nearly all of it, one of 50,000 and a
/// chain of 100,000 end after some 20 sweeps, with an eighth of what they could gain still to go.
const MAX_WORK: u64 = 600_000_000;
/// The same where angles as in space would cross all over: there is no layout for the view to be like.
const MAX_WORK_CROWDED: u64 = 10_000_000;
/// The most work per step, on average over all steps and one more for each node. Neurons take 300 to 700; the children
/// of a star all meet at its middle, so that a star of 10,000 would take 20,000.
const MAX_WORK_PER_STEP: u64 = 1_000;

/// A layout after its recovery.
pub(super) struct Recovered {
    /// The heading of each edge.
    pub(super) heading_rad: Vec<f64>,
    /// Σ |Δ| before the first sweep and after each.
    pub(super) residual_rad: Vec<f64>,
    /// Steps tried.
    pub(super) n_tried: u64,
    /// Whether the limit of work ended it.
    pub(super) is_cut: bool,
}

/// Recovers the turns of a layout; `off_rad` is Δ of every node.
pub(super) fn recover(problem: &Problem, heading_rad: &[f64], mut off_rad: Vec<f64>) -> Recovered {
    let n_nodes = heading_rad.len() as u64;
    let mut turn_rad: Vec<f64> = (0..heading_rad.len())
        .map(|node| heading_rad[node] - heading_rad[problem.parent[node] as usize])
        .collect();
    let mut circles = Circles::new(problem, &place::from_headings(problem, heading_rad));
    let is_crowded = Prospect::of(problem) == Prospect::Crowded;
    let mut work = Work::up_to(if is_crowded { MAX_WORK_CROWDED } else { MAX_WORK });
    let order = breadth_first(problem);
    let mut residual_rad = vec![residual(&off_rad)];
    let mut n_tried = 0;
    let is_spent =
        |work: &Work, n_tried: u64| work.is_spent() || work.done > MAX_WORK_PER_STEP * (n_tried + n_nodes);

    for _ in 0..MAX_SWEEPS {
        let mut n_taken = 0;
        for &node in &order {
            if off_rad[node] == 0.0 || is_spent(&work, n_tried) {
                continue;
            }
            let is_last = off_rad[node].abs() < SNAP_RAD;
            let step_rad = if is_last { off_rad[node] } else { KAPPA * off_rad[node] };
            n_tried += 1;
            if step(problem, &mut circles, (node, step_rad), &mut work) {
                turn_rad[node] += step_rad;
                off_rad[node] -= step_rad;
                n_taken += 1;
            }
        }
        residual_rad.push(residual(&off_rad));
        let is_done = off_rad.iter().all(|off| off.abs() < DONE_RAD);
        if is_done || n_taken == 0 || is_spent(&work, n_tried) {
            break;
        }
    }
    let is_cut = is_spent(&work, n_tried);
    Recovered { heading_rad: headings(problem, &turn_rad), residual_rad, n_tried, is_cut }
}

/// Turns a subtree, unless something would cross; whether it did.
fn step(problem: &Problem, circles: &mut Circles, (node, step_rad): (usize, f64), work: &mut Work) -> bool {
    let pivot = match problem.parent[node] as usize {
        0 => DVec2::ZERO,
        parent => circles.position(parent),
    };
    let motion = Motion::about(pivot, math::unit_vector(step_rad));
    let moved = problem.tree.subtree(node);
    let is_free = !circles.would_meet(moved.clone(), motion, work);
    if is_free {
        circles.apply(moved, motion);
    }
    is_free
}

fn residual(off_rad: &[f64]) -> f64 {
    off_rad.iter().map(|off| off.abs()).sum()
}

fn headings(problem: &Problem, turn_rad: &[f64]) -> Vec<f64> {
    let mut heading_rad = vec![0.0; turn_rad.len()];
    for node in 1..turn_rad.len() {
        heading_rad[node] = heading_rad[problem.parent[node] as usize] + turn_rad[node];
    }
    heading_rad
}

/// All nodes but the root, near ones first.
fn breadth_first(problem: &Problem) -> Vec<usize> {
    let mut order: Vec<usize> = Vec::with_capacity(problem.n_nodes());
    order.extend_from_slice(problem.tree.children(0));
    let mut idx = 0;
    while idx < order.len() {
        order.extend_from_slice(problem.tree.children(order[idx]));
        idx += 1;
    }
    order
}
