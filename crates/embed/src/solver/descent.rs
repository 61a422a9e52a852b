//! Coordinate descent: ratios go towards 0, a few at a time, as far as other branches allow.
//!
//! **Input** a shape without crossings, the separation, a budget. **Output** a shape without crossings and of no higher
//! energy.
//! **Notation** deviation: a turn less its target turn (see `deviation`).
//! **Steps** sweep by sweep, the ratio first that could gain most:
//! 1. It goes towards the value that is best for it alone, in closed form since Eq. 4 and the placement term are
//!    squares; all the way first, then to where a share q of the way is left.
//! 2. Joints along the path above and below share its deviation: their sum is kept, so what is beyond keeps its
//!    heading. A sum of squares is least where each takes its part.
//!
//! A ratio whose last move met a certain pair of edges asks that pair first: most moves that fail do so on the pair
//! on which they failed before.
//! **Guarantees** no crossing, no higher energy (Eq. 4 with the placement term), ratios in range; sweeps in a fixed
//! order, the budget counted. A layout that meets its targets stays, unless placement is more than a tie-break.
//! **Source** ours. **Cost** about log² N and what is near for each move tried.

use std::ops::Range;

use super::deviation::{deviation, ratio_of, softness};
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
    let mut linkage = Linkage::new(problem, separation, shape.clone()).with_placement();
    descend_within(problem, &mut linkage, &(1..problem.n_nodes()), work);
    if crossing_free(problem, &linkage.shape) {
        *shape = linkage.shape;
    }
}

/// As [`descend`], for a range of the preorder that is a subtree or everything: the rest does not count.
pub(crate) fn descend_within<'a>(
    problem: &'a Problem<'a>,
    linkage: &mut Linkage<'a>,
    window: &Range<usize>,
    work: &mut Work,
) {
    let mut descent = Descent::new(problem, linkage, window.clone());
    let mut energy = descent.energy();
    while !work.is_spent() && descent.excess() > LEAST_LOSS {
        // Nothing of the size of the whole tree where only a subtree counts: there energies fall at each change.
        let before = descent.linkage.placement.is_some().then(|| descent.linkage.shape.clone());
        descent.sweep(work);
        if before.is_some() {
            work.spend(problem.n_nodes());
            descent.linkage.refresh();
        }
        let now = descent.energy();
        if now > energy
            && let Some(before) = before
        {
            // The sweep lowered the energy for the rotation that there was, and the rotation has changed.
            descent.linkage.set_shape(before);
            break;
        }
        if energy - now < LEAST_GAIN * descent.excess() {
            break;
        }
        energy = now;
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

struct Descent<'a, 'b> {
    problem: &'a Problem<'a>,
    linkage: &'b mut Linkage<'a>,
    /// The edges that count.
    window: Range<usize>,
    /// The segments in it.
    segments: Range<usize>,
    path: Vec<usize>,
    /// The pair that was last in the way of each joint that counts; angles, then lengths.
    in_the_way: Vec<(u32, u32)>,
    /// What a move has to gain to be worth a try.
    need: f64,
}

impl<'a, 'b> Descent<'a, 'b> {
    fn new(problem: &'a Problem<'a>, linkage: &'b mut Linkage<'a>, window: Range<usize>) -> Self {
        // Segments are in preorder too.
        let segment = |node: usize| problem.branch[node] as usize;
        let segments =
            if window.is_empty() { 0..0 } else { segment(window.start)..segment(window.end - 1) + 1 };
        let in_the_way = vec![(0, 0); window.len() + segments.len()];
        Self { problem, linkage, window, segments, path: Vec::new(), in_the_way, need: 0.0 }
    }

    fn loss(&self) -> f64 {
        let angles = self.window.clone().map(|node| self.linkage.angle_loss(node));
        let lengths = self.segments.clone().map(|segment| self.linkage.length_loss(segment));
        angles.sum::<f64>() + lengths.sum::<f64>()
    }

    fn energy(&self) -> f64 {
        self.loss() + self.linkage.placement.as_ref().map_or(0.0, |placement| placement.total)
    }

    /// What there is to lower: the loss, and the placement term where that counts as much.
    fn excess(&self) -> f64 {
        if self.problem.trades_placement { self.energy() } else { self.loss() }
    }

    fn sweep(&mut self, work: &mut Work) {
        self.need = LEAST_GAIN * self.excess() / (self.window.len() + self.segments.len()) as f64;
        let angles = self.window.clone().map(Joint::Angle);
        let lengths = self.segments.clone().map(Joint::Length);
        let mut joints: Vec<(f64, Joint)> = angles
            .chain(lengths)
            .map(|joint| (self.most_gain(joint), joint))
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

    /// What a joint can gain if nothing is in its way.
    fn most_gain(&self, joint: Joint) -> f64 {
        match joint {
            Joint::Angle(node) => {
                let (old, best) = self.deviations(node);
                let placement = self.linkage.placement.as_ref();
                let gain = placement.map_or(0.0, |p| p.gain(&self.problem.tree.subtree(node), best - old));
                let softness = softness(self.problem, node, best).max(1e-12);
                self.linkage.angle_loss(node) - best * best / softness + gain
            }
            Joint::Length(segment) => self.linkage.length_loss(segment),
        }
    }

    fn is_free(&self, joint: Joint) -> bool {
        match joint {
            Joint::Angle(node) => self.problem.free_angle[node],
            Joint::Length(segment) => self.problem.free_length[segment],
        }
    }

    /// Brings one ratio towards the value that would be best for it alone.
    fn lower(&mut self, joint: Joint, work: &mut Work) {
        for share in SHARES {
            self.linkage.change.clear();
            let key = match joint {
                Joint::Angle(node) => {
                    let (old, best) = self.deviations(node);
                    let new = best + share * (old - best);
                    let Some(ratio) = ratio_of(self.problem, node, new) else { continue };
                    self.linkage.change.angles.push((node, ratio));
                    node - self.window.start
                }
                Joint::Length(segment) => {
                    self.linkage
                        .change
                        .lengths
                        .push((segment, share * self.linkage.shape.length_ratio[segment]));
                    self.window.len() + segment - self.segments.start
                }
            };
            if self.make_if_clear(key, work) {
                return;
            }
        }
    }

    /// The deviation of a node, and that at which its own cost and the placement term are least together.
    fn deviations(&self, node: usize) -> (f64, f64) {
        let old = deviation(self.problem, node, self.linkage.shape.angle_ratio[node]);
        let Some(placement) = &self.linkage.placement else { return (old, 0.0) };
        let (moment, cost) = placement.sums(&self.problem.tree.subtree(node));
        // stiffness · deviation² + 2 moment · turn + cost · turn², and deviation = old + turn.
        let best_on = |side: f64| {
            let stiffness = 1.0 / softness(self.problem, node, side).max(1e-12);
            (cost * old - moment) / (stiffness + cost)
        };
        // The sign of the best one is that of the numerator on both sides.
        let sign = cost * old - moment;
        (old, if sign == 0.0 { 0.0 } else { best_on(sign) })
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
                if self.set_shares(step) && self.make_if_clear(node - self.window.start, work) {
                    return;
                }
            }
        }
    }

    /// The joints around a node on the path through it: half of them from the node upwards, the others below it,
    /// towards the larger subtree.
    fn find_path(&mut self, node: usize, n_joints: usize) {
        let Self { problem, path, window, .. } = self;
        let is_joint =
            |node: usize| problem.parent[node] != 0 && problem.free_angle[node] && window.contains(&node);
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
        let Self { problem, linkage, path, .. } = self;
        let old = |node: usize| deviation(problem, node, linkage.shape.angle_ratio[node]);
        let total: f64 = path.iter().map(|&node| old(node)).sum();
        let all: f64 = path.iter().map(|&node| softness(problem, node, total)).sum();
        linkage.change.clear();
        for &node in path.iter() {
            let new = (1.0 - step) * old(node) + step * total * (softness(problem, node, total) / all);
            let Some(ratio) = ratio_of(problem, node, new) else { return false };
            linkage.change.angles.push((node, ratio));
        }
        true
    }

    /// Makes the change if it gains enough and is clear; `key` is the place of its joint in `in_the_way`.
    fn make_if_clear(&mut self, key: usize, work: &mut Work) -> bool {
        let (a, b) = self.in_the_way[key];
        work.spend(self.linkage.change.n_ratios());
        self.linkage.cut();
        if self.linkage.gain() <= self.need {
            return false;
        }
        if (a, b) != (0, 0) && !self.linkage.allows((a as usize, b as usize)) {
            return false;
        }
        match self.linkage.is_clear(&self.window, work) {
            Ok(()) => {
                self.linkage.make();
                true
            }
            Err((a, b)) => {
                self.in_the_way[key] = (a as u32, b as u32);
                false
            }
        }
    }
}
