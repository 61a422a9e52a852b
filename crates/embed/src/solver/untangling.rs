//! Untangling from the tips to the root: from the targets themselves to a layout without crossings near them.
//!
//! **Input** the problem, the cone, the separation, a budget. **Output** a shape without crossings.
//! **Notation** a *leg* is the path from one edge of a crossing pair up to where the paths of both part. A turn of any
//! node on a leg moves the two edges against each other.
//! **Steps** segments from the last to the first, so that all below a segment is untangled before it; only edges in
//! its subtree count. While a pair crosses:
//! 1. *Bend*: a run of nodes on a leg turns by an angle that they share; many runs and angles, the cheapest first,
//!    until one leaves fewer crossings.
//! 2. Where none does, two ways out, each followed by a descent in what is below the segment; the better one stays.
//!    - *Retreat*: a subtree of a leg shrinks, or becomes a narrow fan; the cheapest way that leaves fewer crossings.
//!    - *Blend*: ratios on the legs go a part of the way to those of the cone; then those of the smaller child's
//!      subtree, of the fork's, at last of all below the segment.
//!
//! A budget that is spent gives the cone.
//! **Guarantees** no crossing where nothing is pinned: a subtree whose ratios are the cone's has none, and the last
//! blend makes it so. Near the targets where they cross little. Pinned ratios stay.
//! **Source** ours. **Cost** some hundred moves for each crossing met.

use std::ops::Range;

use super::descent::descend_within;
use super::deviation::{deviation, ratio_of, softness};
use super::linkage::{Linkage, Rule};
use super::shape::Shape;
use super::work::Work;
use crate::problem::Problem;
use crate::ratio;
use crate::separation::Separation;

/// How many nodes share a turn.
const RUNS: [usize; 5] = [1, 4, 16, 64, 256];
/// Where runs of one length are tried on a leg, at most.
const MAX_PLACES: usize = 12;
/// Turns that are tried, in rad, to both sides.
const TURNS_RAD: [f64; 9] = [0.01, 0.025, 0.06, 0.13, 0.25, 0.5, 1.0, 1.8, 3.0];
/// Crossing pairs of which bends are tried before a blend is made.
const MAX_PAIRS: usize = 8;
/// How many pairs that were in the way are asked first.
const MEMORY: usize = 16;
/// The budget of the bends at a fork, for each edge below it, and of each way out with its descent.
const WORK_PER_EDGE: u64 = 5000;
/// Forks with few edges may take as much as if they had so many more.
const FEW_EDGES: u64 = 100;
/// Shares of the way to the cone, in this order.
const BLENDS: [f64; 5] = [0.05, 0.12, 0.3, 0.6, 1.0];

/// How a subtree gets out of the way.
#[derive(Clone, Copy, Debug)]
enum Retreat {
    /// All its lengths by a factor.
    Shrink(f64),
    /// The cone's turns below its first edge, narrowed, and that edge turned.
    Fan { width: f64, turn_rad: f64 },
}

/// What is tried.
const RETREATS: [Retreat; 14] = [
    Retreat::Shrink(0.7),
    Retreat::Shrink(0.5),
    Retreat::Shrink(0.25),
    Retreat::Shrink(0.1),
    Retreat::Fan { width: 1.0, turn_rad: 0.0 },
    Retreat::Fan { width: 1.0, turn_rad: 0.6 },
    Retreat::Fan { width: 1.0, turn_rad: -0.6 },
    Retreat::Fan { width: 0.2, turn_rad: 0.0 },
    Retreat::Fan { width: 0.2, turn_rad: 0.3 },
    Retreat::Fan { width: 0.2, turn_rad: -0.3 },
    Retreat::Fan { width: 0.2, turn_rad: 0.8 },
    Retreat::Fan { width: 0.2, turn_rad: -0.8 },
    Retreat::Fan { width: 0.2, turn_rad: 1.6 },
    Retreat::Fan { width: 0.2, turn_rad: -1.6 },
];

/// A shape without crossings near the targets; `cone` is the shape to fall back on.
pub(crate) fn untangle(problem: &Problem, separation: &Separation, cone: &Shape, work: &mut Work) -> Shape {
    let linkage = Linkage::new(problem, separation, Shape::targets(problem));
    let mut untangling = Untangling {
        problem,
        cone,
        linkage,
        obstacles: Vec::new(),
        crossings: Vec::new(),
        window: 0..0,
        recent: Vec::new(),
    };
    for segment in (0..problem.branches.list().len()).rev() {
        untangling.untangle_segment(segment, work);
        if work.is_spent() {
            // What is left would be blended to the cone in ever larger parts.
            return cone.clone();
        }
    }
    untangling.untangle_root(work);
    untangling.linkage.shape
}

struct Untangling<'a> {
    problem: &'a Problem<'a>,
    cone: &'a Shape,
    linkage: Linkage<'a>,
    obstacles: Vec<(u32, u32)>,
    /// The pairs that cross, of the edges that count.
    crossings: Vec<(u32, u32)>,
    /// The edges that count.
    window: Range<usize>,
    /// Pairs that were in the way lately.
    recent: Vec<(u32, u32)>,
}

impl Untangling<'_> {
    fn untangle_segment(&mut self, segment: usize, work: &mut Work) {
        let nodes = self.problem.branches.list()[segment].nodes.clone();
        self.window = self.problem.tree.subtree(nodes.start);
        let children = self.problem.tree.children(nodes.end - 1);
        let starts = std::iter::once(nodes.start).chain(children.iter().copied());
        self.crossings = self.linkage.crossings(&self.window, (starts, 1), work);
        self.resolve(work);
    }

    fn untangle_root(&mut self, work: &mut Work) {
        self.window = 1..self.problem.n_nodes();
        let starts = self.problem.tree.children(0).iter().copied();
        self.crossings = self.linkage.crossings(&self.window, (starts, 0), work);
        self.resolve(work);
    }

    fn resolve(&mut self, work: &mut Work) {
        self.recent.clear();
        let mut bends = self.part_of(work);
        while !self.crossings.is_empty() && !bends.is_spent() && self.bend(&mut bends) {}
        work.add(bends);
        if self.crossings.is_empty() {
            return;
        }

        // Both ways out, and what a descent makes of them: which is better is not known before.
        let stuck = (self.linkage.shape.clone(), self.crossings.clone());
        work.spend(2 * self.problem.n_nodes());
        let retreated = self.leave(&Self::retreat, work).then(|| self.linkage.shape.clone());
        self.linkage.set_shape(stuck.0);
        self.crossings = stuck.1;
        let has_blended = self.leave(&Self::blend, work);
        if let Some(retreated) = retreated {
            let loss = |shape: &Shape| shape.loss(self.problem);
            work.spend(self.problem.n_nodes());
            if !has_blended || loss(&retreated) < loss(&self.linkage.shape) {
                self.linkage.set_shape(retreated);
                self.crossings.clear();
            }
        }
    }

    /// Goes one way until nothing crosses, and descends from there; whether nothing crosses.
    fn leave(&mut self, step: &dyn Fn(&mut Self, &mut Work) -> bool, work: &mut Work) -> bool {
        let mut part = self.part_of(work);
        while !self.crossings.is_empty() && step(self, &mut part) {}
        if self.crossings.is_empty() {
            descend_within(self.problem, &mut self.linkage, &self.window, &mut part);
        }
        work.add(part);
        self.crossings.is_empty()
    }

    /// What the edges that count may take of the budget at once.
    fn part_of(&self, work: &Work) -> Work {
        let left = work.limit.saturating_sub(work.done);
        Work::up_to(left.min(WORK_PER_EDGE * (self.window.len() as u64 + FEW_EDGES)))
    }

    /// Turns a run of nodes on a leg so that fewer pairs cross; whether any does.
    fn bend(&mut self, work: &mut Work) -> bool {
        for idx in 0..self.crossings.len().min(MAX_PAIRS) {
            let (a, b) = self.crossings[idx];
            let legs = self.legs(a as usize, b as usize);
            let mut bends = Vec::new();
            for (leg_idx, leg) in legs.iter().enumerate() {
                for n_nodes in RUNS.into_iter().filter(|&n_nodes| n_nodes <= leg.len()) {
                    let n_places = (leg.len() - n_nodes + 1).min(MAX_PLACES);
                    for place in 0..n_places {
                        let start = place * (leg.len() - n_nodes) / (n_places - 1).max(1);
                        let run = &leg[start..start + n_nodes];
                        for turn in TURNS_RAD.into_iter().flat_map(|turn| [turn, -turn]) {
                            work.spend(run.len());
                            if self.set_bend(run, turn) {
                                let loss = -self.linkage.loss_gain();
                                bends.push((loss, leg_idx, start..start + n_nodes, turn));
                            }
                        }
                    }
                }
            }
            bends.sort_by(|a, b| a.0.total_cmp(&b.0));
            for (_, leg, run, turn) in bends {
                if work.is_spent() {
                    return false;
                }
                self.set_bend(&legs[leg][run], turn);
                if self.make_if_fewer(Rule::Clearance, work) {
                    return true;
                }
            }
        }
        false
    }

    /// The nodes that turn one edge of a pair against the other, from each edge upwards.
    fn legs(&self, a: usize, b: usize) -> [Vec<usize>; 2] {
        let parting = self.linkage.parting(a, b);
        let leg = |edge: usize| {
            let above = |&node: &usize| Some(self.problem.parent[node] as usize);
            std::iter::successors(Some(edge), above).take_while(|&node| node != parting).collect()
        };
        [leg(a), leg(b)]
    }

    /// The change by which nodes turn by an angle in all, each by its part; whether it is in range.
    fn set_bend(&mut self, run: &[usize], turn_rad: f64) -> bool {
        self.linkage.change.clear();
        let problem = self.problem;
        if run.iter().any(|&node| !problem.free_angle[node]) {
            return false;
        }
        let all: f64 = run.iter().map(|&node| softness(problem, node, turn_rad)).sum();
        for &node in run {
            let old = deviation(problem, node, self.linkage.shape.angle_ratio[node]);
            let new = old + turn_rad * (softness(problem, node, turn_rad) / all);
            let Some(ratio) = ratio_of(problem, node, new) else { return false };
            self.linkage.change.angles.push((node, ratio));
        }
        true
    }

    /// Makes a subtree small or narrow so that fewer pairs cross, the cheapest way first; whether any does.
    fn retreat(&mut self, work: &mut Work) -> bool {
        let mut ways = Vec::new();
        for top in self.subtrees_of_crossings() {
            for way in RETREATS {
                let is_in_range = self.set_retreat(top, way);
                work.spend(self.linkage.change.n_ratios());
                if is_in_range {
                    ways.push((-self.linkage.loss_gain(), top, way));
                }
            }
        }
        ways.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (_, top, way) in ways {
            if work.is_spent() {
                return false;
            }
            self.set_retreat(top, way);
            if self.make_if_fewer(Rule::Crossings, work) {
                return true;
            }
        }
        false
    }

    /// The first nodes of the segments on the legs of the first crossing pairs.
    fn subtrees_of_crossings(&self) -> Vec<usize> {
        let starts_segment = |&node: &usize| {
            let hub = self.problem.parent[node] as usize;
            hub == 0 || self.problem.tree.children(hub).len() > 1
        };
        let mut tops: Vec<usize> = Vec::new();
        for &(a, b) in self.crossings.iter().take(MAX_PAIRS) {
            tops.extend(self.legs(a as usize, b as usize).into_iter().flatten().filter(starts_segment));
        }
        tops.sort_unstable();
        tops.dedup();
        tops
    }

    /// The change by which a subtree gets out of the way; whether it is in range.
    fn set_retreat(&mut self, top: usize, way: Retreat) -> bool {
        let (problem, linkage) = (self.problem, &mut self.linkage);
        let range = problem.tree.subtree(top);
        linkage.change.clear();
        match way {
            Retreat::Shrink(scale) => {
                let segments = problem.branch[top] as usize..problem.branch[range.end - 1] as usize + 1;
                for segment in segments.filter(|&segment| problem.free_length[segment]) {
                    let length = scale * (1.0 + linkage.shape.length_ratio[segment]);
                    linkage.change.lengths.push((segment, (length - 1.0).max(ratio::LENGTH_RANGE.0)));
                }
            }
            Retreat::Fan { width, turn_rad } => {
                let old = deviation(problem, top, linkage.shape.angle_ratio[top]);
                let Some(ratio) = ratio_of(problem, top, old + turn_rad) else { return false };
                linkage.change.angles.push((top, ratio));
                for node in range.skip(1) {
                    let (target, side) = (problem.bend[node], problem.side[node]);
                    let bend = ratio::embedded_bend(target, self.cone.angle_ratio[node]);
                    let Some(ratio) = ratio_of(problem, node, side * (width * bend - target)) else {
                        return false;
                    };
                    linkage.change.angles.push((node, ratio));
                }
            }
        }
        linkage.change.angles.iter().all(|&(node, _)| problem.free_angle[node])
    }

    /// Goes a part of the way to the cone.
    fn blend(&mut self, work: &mut Work) -> bool {
        let mut on_legs: Vec<usize> = Vec::new();
        for &(a, b) in &self.crossings {
            on_legs.extend(self.legs(a as usize, b as usize).into_iter().flatten());
        }
        work.spend(on_legs.len());
        on_legs.sort_unstable();
        on_legs.dedup();
        let (a, b) = self.crossings[0];
        let parting = self.linkage.parting(a as usize, b as usize);
        let [first, second] = self.legs(a as usize, b as usize).map(|leg| leg.last().copied());
        let smaller =
            [first, second].into_iter().flatten().min_by_key(|&c| self.problem.tree.subtree(c).len());
        let of_smaller = smaller.map_or(0..0, |child| self.problem.tree.subtree(child));
        let of_fork = parting + 1..self.problem.tree.subtree(parting).end;
        let sets = [on_legs, of_smaller.collect(), of_fork.collect(), self.window.clone().collect()];
        for nodes in sets {
            for share in BLENDS {
                work.spend(nodes.len());
                self.set_blend(&nodes, share);
                if self.make_if_fewer(Rule::Crossings, work) {
                    return true;
                }
            }
        }
        false
    }

    fn set_blend(&mut self, nodes: &[usize], share: f64) {
        self.linkage.change.clear();
        for &node in nodes {
            let (old, cone) = (self.linkage.shape.angle_ratio[node], self.cone.angle_ratio[node]);
            // The cone's own bits at the end of the way, so that the last blend is the cone.
            let ratio = if share < 1.0 { old + share * (cone - old) } else { cone };
            if ratio != old && self.problem.free_angle[node] {
                self.linkage.change.angles.push((node, ratio));
            }
        }
    }

    /// Makes the change if it leaves fewer crossings.
    fn make_if_fewer(&mut self, rule: Rule, work: &mut Work) -> bool {
        self.linkage.cut();
        work.spend(self.linkage.change.n_ratios() + self.crossings.len() + self.recent.len());
        let is_kept = |&(a, b): &(u32, u32)| !self.linkage.parts_pair(a as usize, b as usize);
        let n_kept = self.crossings.iter().filter(|&pair| is_kept(pair)).count();
        let Some(most) = (self.crossings.len() - 1).checked_sub(n_kept) else { return false };
        if rule == Rule::Clearance && self.recent_in_the_way(most) > most {
            return false;
        }
        self.linkage.obstacles(rule, (&self.window, most), &mut self.obstacles, work);
        if self.obstacles.len() > most {
            self.remember();
            return false;
        }
        let linkage = &self.linkage;
        self.crossings.retain(|&(a, b)| !linkage.parts_pair(a as usize, b as usize));
        self.crossings.append(&mut self.obstacles);
        self.crossings.sort_unstable();
        self.linkage.make();
        true
    }

    /// How many of the pairs that were in the way lately are so again, up to one more than a limit.
    fn recent_in_the_way(&mut self, limit: usize) -> usize {
        let mut n_found = 0;
        for &(a, b) in &self.recent {
            n_found += usize::from(!self.linkage.allows((a as usize, b as usize)));
            if n_found > limit {
                break;
            }
        }
        n_found
    }

    fn remember(&mut self) {
        for &pair in &self.obstacles {
            if !self.recent.contains(&pair) {
                self.recent.push(pair);
            }
        }
        let n_too_many = self.recent.len().saturating_sub(MEMORY);
        self.recent.drain(..n_too_many);
    }
}
