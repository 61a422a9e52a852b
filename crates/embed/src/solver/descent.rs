//! Coordinate descent: ratios go towards 0, a few at a time, as far as other branches allow.
//!
//! **Input** a shape without crossings, the separation, a budget. **Output** a shape without crossings and of no higher
//! loss.
//! **Notation** deviation: a turn less its target turn (see `deviation`).
//! **Steps** sweep by sweep, the most expensive ratio first:
//! 1. The ratio alone goes to q times itself, the lowest q first.
//! 2. Joints along the path above and below share its deviation: their sum is kept, so what is beyond keeps its
//!    heading. A sum of squares is least where each takes its part.
//!
//! A ratio whose last move met a certain pair of edges asks that pair first: most moves that fail do so on the pair
//! on which they failed before.
//! **Guarantees** no crossing, the loss never rises, ratios in range; sweeps in a fixed order, the budget counted.
//! **Source** ours. **Cost** about log² N and what is near for each move tried.

use super::deviation::{deviation, ratio_of, softness};
use super::joint::Change;
use super::linkage::Linkage;
use super::shape::Shape;
use super::work::Work;
use crate::problem::Problem;
use crate::separation::Separation;

/// What a ratio is tried at, as shares of its value.
const SHARES: [f64; 5] = [0.0, 0.35, 0.7, 0.9, 0.97];

/// How many joints share a deviation.
const SHARERS: [usize; 5] = [32, 16, 8, 4, 2];
/// How far they go towards equal shares.
const STEPS: [f64; 4] = [1.0, 0.5, 0.2, 0.07];
/// A sweep that gains less than this share of the loss is the last.
const LEAST_GAIN: f64 = 0.005;
/// A loss that is nothing.
const LEAST_LOSS: f64 = 1e-18;

/// Lowers the loss of a shape without crossings until little is gained or the budget is spent.
pub(crate) fn descend(problem: &Problem, separation: &Separation, shape: &mut Shape, work: &mut Work) {
    let mut descent = Descent::new(problem, separation, shape.clone());
    let mut loss = shape.loss(problem);
    while !work.is_spent() && loss > LEAST_LOSS {
        descent.sweep(work);
        let now = descent.linkage.shape.loss(problem);
        if loss - now < LEAST_GAIN * loss {
            break;
        }
        loss = now;
        descent.linkage.refresh();
    }
    let found = descent.linkage.shape;
    if crossing_free(problem, &found) {
        *shape = found;
    }
}

fn crossing_free(problem: &Problem, shape: &Shape) -> bool {
    crate::certify::certify(problem.tree, &shape.positions(problem)).holds()
}

/// A ratio.
#[derive(Clone, Copy, Debug)]
enum Joint {
    Angle(usize),
    Length(usize),
}

struct Descent<'a> {
    problem: &'a Problem<'a>,
    linkage: Linkage<'a>,
    change: Change,
    path: Vec<usize>,
    /// The pair that was last in the way of each joint; angles, then lengths.
    in_the_way: Vec<(u32, u32)>,
    /// What a move has to gain to be worth a try.
    need: f64,
}

impl<'a> Descent<'a> {
    fn new(problem: &'a Problem<'a>, separation: &'a Separation, shape: Shape) -> Self {
        let n_joints = shape.angle_ratio.len() + shape.length_ratio.len();
        Self {
            problem,
            linkage: Linkage::new(problem, separation, shape),
            change: Change::default(),
            path: Vec::new(),
            in_the_way: vec![(0, 0); n_joints],
            need: 0.0,
        }
    }

    fn sweep(&mut self, work: &mut Work) {
        self.need = LEAST_GAIN * self.linkage.shape.loss(self.problem) / self.in_the_way.len() as f64;
        let mut joints: Vec<(f64, Joint)> = (1..self.problem.n_nodes())
            .map(|node| (self.linkage.angle_loss(node), Joint::Angle(node)))
            .chain(
                (0..self.problem.branches.list().len())
                    .map(|s| (self.linkage.length_loss(s), Joint::Length(s))),
            )
            .filter(|(loss, joint)| *loss > self.need && self.is_free(*joint))
            .collect();
        joints.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (_, joint) in joints {
            if work.is_spent() {
                return;
            }
            self.lower(joint, work);
            if let Joint::Angle(node) = joint {
                self.share(node, work);
            }
        }
    }

    fn is_free(&self, joint: Joint) -> bool {
        match joint {
            Joint::Angle(node) => self.problem.free_angle[node],
            Joint::Length(segment) => self.problem.free_length[segment],
        }
    }

    /// Brings one ratio towards 0.
    fn lower(&mut self, joint: Joint, work: &mut Work) {
        for share in SHARES {
            self.change.clear();
            let key = match joint {
                Joint::Angle(node) => {
                    self.change.angles.push((node, share * self.linkage.shape.angle_ratio[node]));
                    node
                }
                Joint::Length(segment) => {
                    self.change.lengths.push((segment, share * self.linkage.shape.length_ratio[segment]));
                    self.problem.n_nodes() + segment
                }
            };
            if self.make_if_clear(key, work) {
                return;
            }
        }
    }

    /// Shares the deviation of a node with others on its path.
    fn share(&mut self, node: usize, work: &mut Work) {
        // A path of fewer joints than asked for has been tried.
        let mut n_tried = usize::MAX;
        for n_joints in SHARERS {
            self.find_path(node, n_joints);
            if self.path.len() == std::mem::replace(&mut n_tried, self.path.len()) {
                continue;
            }
            for step in STEPS {
                if self.set_shares(step) && self.make_if_clear(node, work) {
                    return;
                }
            }
        }
    }

    /// The joints around a node on the path through it: half of them from the node upwards, the others below it,
    /// towards the larger subtree.
    fn find_path(&mut self, node: usize, n_joints: usize) {
        let Self { problem, path, .. } = self;
        let is_joint = |node: usize| problem.parent[node] != 0 && problem.free_angle[node];
        let n_below = |child: &usize| (problem.tree.subtree(*child).len(), *child);
        path.clear();
        let mut at = node;
        while path.len() < n_joints.div_ceil(2) && is_joint(at) {
            path.push(at);
            at = problem.parent[at] as usize;
        }
        at = node;
        while path.len() < n_joints
            && let Some(next) = problem.tree.children(at).iter().copied().max_by_key(n_below)
            && problem.free_angle[next]
        {
            path.push(next);
            at = next;
        }
    }

    /// The change by which the joints of the path go towards equal shares of their deviation; whether it is in range.
    fn set_shares(&mut self, step: f64) -> bool {
        let Self { problem, linkage, change, path, .. } = self;
        let old = |node: usize| deviation(problem, node, linkage.shape.angle_ratio[node]);
        let total: f64 = path.iter().map(|&node| old(node)).sum();
        let all: f64 = path.iter().map(|&node| softness(problem, node, total)).sum();
        change.clear();
        for &node in path.iter() {
            let new = (1.0 - step) * old(node) + step * total * (softness(problem, node, total) / all);
            let Some(ratio) = ratio_of(problem, node, new) else { return false };
            change.angles.push((node, ratio));
        }
        true
    }

    /// Makes the change if it gains enough and is clear; `key` names the joint that it is for.
    fn make_if_clear(&mut self, key: usize, work: &mut Work) -> bool {
        let (a, b) = self.in_the_way[key];
        work.spend(1);
        if self.linkage.gain(&self.change) <= self.need {
            return false;
        }
        if (a, b) != (0, 0) && !self.linkage.allows((a as usize, b as usize), &self.change) {
            return false;
        }
        match self.linkage.try_change(&self.change, work) {
            Ok(()) => {
                self.linkage.make(&self.change);
                true
            }
            Err((a, b)) => {
                self.in_the_way[key] = (a as u32, b as u32);
                false
            }
        }
    }
}
