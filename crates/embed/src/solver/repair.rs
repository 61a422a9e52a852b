//! Repair: crossings taken out of a layout of which a part is pinned, and the rest optimised around it.
//!
//! **Input** the problem with its pins, the layout as a shape. **Output** a shape that keeps the pins, free of
//! crossings if one was found; the work.
//! **Steps** 1. If the layout crosses: untangle it, as near to itself as can be (its own turns are the targets); if
//! that leaves crossings, untangle the targets around the pins. 2. Descent and barrier in turn, as in the schedule of
//! the solver.
//! **Guarantees** pinned ratios stay 0. A layout without crossings never gets a higher loss.
//! **Source** ours; [Hu2022] section 3.3 says what is kept and what is recalculated.

use super::shape::Shape;
use super::work::Work;
use super::{Descents, Run, untangling};
use crate::certify::certify;
use crate::layout::cone;
use crate::params::Params;
use crate::pins;
use crate::problem::Problem;
use crate::ratio;
use crate::separation::Separation;

/// Work of the untangling for a node, times the effort: some searches for each crossing of a small tree.
const WORK_PER_NODE: f64 = 3e5;
/// In a large tree no more than this, and so much for a node: an edit that cannot be freed shall end soon too.
const WORK_LARGE: f64 = 1e8;
const WORK_PER_NODE_LARGE: f64 = 2e4;

/// A repaired layout.
pub(crate) struct Repaired {
    pub(crate) shape: Shape,
    /// Units of work.
    pub(crate) work: u64,
    /// Whether more work could have lowered the energy further.
    pub(crate) is_spent: bool,
}

/// Takes the crossings out of `start`, and lowers the loss of what may move.
pub(crate) fn repair(problem: &Problem, start: Shape, params: &Params) -> Repaired {
    let n_nodes = problem.n_nodes() as f64;
    let limit = (WORK_PER_NODE * n_nodes).min(WORK_LARGE + WORK_PER_NODE_LARGE * n_nodes);
    let mut work = Work::up_to((params.solver.effort * limit) as u64);
    let mut shape = start;
    if n_crossings(problem, &shape) > 0 {
        shape = untangled(problem, shape, params, &mut work);
    }
    let mut run = Run::new(problem, &params.solver, shape);
    // As in the schedule: where nothing is lost there is nothing to do.
    if run.shape.loss(problem) > 0.0 && n_crossings(problem, &run.shape) == 0 {
        run.improve(&Separation::new(problem, params.solver.clearance), Descents::BetweenBarriers);
    }
    Repaired { work: work.done + run.work.done, is_spent: run.work.is_spent(), shape: run.shape }
}

/// The start untangled; where that fails, whatever crosses least.
fn untangled(problem: &Problem, start: Shape, params: &Params, work: &mut Work) -> Shape {
    let near = untangled_near(problem, &start, params, work);
    if n_crossings(problem, &near) == 0 {
        return near;
    }
    let anew = untangled_targets(problem, params, work);
    let mut tried = [anew, near, start];
    tried.sort_by_key(|shape| n_crossings(problem, shape));
    let [best, ..] = tried;
    best
}

/// Untangled with the start's own turns and lengths as targets.
fn untangled_near(problem: &Problem, start: &Shape, params: &Params, work: &mut Work) -> Shape {
    let held = pins::held(problem, start);
    let found = untangled_targets(&held, params, work);
    let mut shape = start.clone();
    for node in
        (1..problem.n_nodes()).filter(|&node| problem.free_angle[node] && found.angle_ratio[node] != 0.0)
    {
        let ratio = ratio::angle_ratio(problem.targets.angle_rad[node], found.turn_rad(&held, node));
        shape.angle_ratio[node] = in_range(ratio, ratio::ANGLE_RANGE);
    }
    for (ratio, change) in shape.length_ratio.iter_mut().zip(&found.length_ratio) {
        *ratio = in_range((1.0 + *ratio) * (1.0 + change) - 1.0, ratio::LENGTH_RANGE);
    }
    shape
}

fn in_range(ratio: f64, (low, high): (f64, f64)) -> f64 {
    ratio.clamp(low, high)
}

fn untangled_targets(problem: &Problem, params: &Params, work: &mut Work) -> Shape {
    let separation = Separation::new(problem, params.solver.clearance);
    let mut cone = Shape::from_headings(problem, &cone::headings(problem));
    for node in 1..problem.n_nodes() {
        if !problem.free_angle[node] {
            cone.angle_ratio[node] = 0.0;
        }
    }
    untangling::untangle(problem, &separation, &cone, work)
}

fn n_crossings(problem: &Problem, shape: &Shape) -> usize {
    certify(problem.tree, &shape.positions(problem)).crossings
}
