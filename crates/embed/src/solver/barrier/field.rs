//! The energy with its barrier, and the gradient by every ratio, in one walk up and down the tree.
//!
//! **Input** ratios x: r_l of each segment, then r_a of each node. **Output** E + μ Σ b(u), u = (d − floor) / width
//! for each pair of edges; its gradient; the diagonal of its Gauss–Newton matrix; which pairs meet.
//! **Notation** S(v), T(v): force and torque about the origin, summed over the subtree of v, a range of the
//! preorder. **Steps** 1. Turns, headings, positions. 2. Each pair adds its force to the four ends. 3. Sums over
//! subtrees from the last node to the first. The turn at v rotates its subtree about its parent p: T(v) − p × S(v).
//! A segment's length moves what is below each of its edges: Σ l u · S. 4. Curvature: a pair counts for the nodes
//! on the path between its edges only, so it is taken off again where the paths part.
//! **Guarantees** the gradient is exact; at r_a = 0, where the turn has two slopes, it is that of the side to which
//! the energy falls.
//! **Cost** O(N + pairs), no allocation after the first time.

use std::f64::consts::{PI, TAU};

use espalier_geom::angle::wrap;
use espalier_geom::math;
use glam::DVec2;

use super::super::work::Work;
use super::contact::{Contact, Ends, are_apart, barrier};
use super::pairs::{Pair, PairList, Spacing};
use crate::paths::Paths;
use crate::problem::Problem;
use crate::ratio;

/// Edges with a common node meet within this angle, as in `separation`.
const FOLDED_RAD: f64 = 1e-6;

/// What an evaluation finds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Value {
    /// E: length, angle and placement terms; infinite if edges meet.
    pub(super) loss: f64,
    /// E + μ Σ b; infinite if edges meet.
    pub(super) total: f64,
}

/// The six sums from which the curvature by a rotation about any point follows, and by a shift along any line.
type Moments = [f64; 6];

fn ends(problem: &Problem, positions: &[DVec2], pair: &Pair) -> Ends {
    let of = |edge: u32| (positions[problem.parent[edge as usize] as usize], positions[edge as usize]);
    (of(pair.first), of(pair.second))
}

/// The energy as a function of the ratios.
pub(super) struct Field<'a, S> {
    pub(super) problem: &'a Problem<'a>,
    paths: &'a Paths,
    spacing: S,
    /// μ.
    strength: f64,
    pairs: PairList,
    /// Pairs that met in the last evaluation.
    pub(super) met: Vec<(u32, u32)>,
    pub(super) positions: Vec<DVec2>,
    turn: Vec<f64>,
    heading: Vec<f64>,
    unit: Vec<DVec2>,
    force: Vec<DVec2>,
    /// dE/dh of the placement term.
    heading_force: Vec<f64>,
    torque: Vec<f64>,
    moments: Vec<Moments>,
    order: Vec<u32>,
    pub(super) n_evaluations: u64,
}

impl<'a, S: Spacing> Field<'a, S> {
    pub(super) fn new(problem: &'a Problem<'a>, paths: &'a Paths, spacing: S, strength: f64) -> Self {
        let n_nodes = problem.n_nodes();
        Self {
            problem,
            paths,
            spacing,
            strength,
            pairs: PairList::new(problem),
            met: Vec::new(),
            positions: vec![DVec2::ZERO; n_nodes],
            turn: vec![0.0; n_nodes],
            heading: vec![0.0; n_nodes],
            unit: vec![DVec2::ZERO; n_nodes],
            force: vec![DVec2::ZERO; n_nodes],
            heading_force: vec![0.0; n_nodes],
            torque: vec![0.0; n_nodes],
            moments: vec![[0.0; 6]; n_nodes],
            order: Vec::new(),
            n_evaluations: 0,
        }
    }

    /// The number of segments: x is that many length ratios, then an angle ratio for each node.
    pub(super) fn n_lengths(&self) -> usize {
        self.problem.branches.list().len()
    }

    /// The number of pairs now listed.
    pub(super) fn n_pairs(&self) -> usize {
        self.pairs.pairs.len()
    }

    /// E + μ Σ b at x.
    pub(super) fn value(&mut self, x: &[f64], work: &mut Work) -> Value {
        self.n_evaluations += 1;
        self.place(x);
        work.spend(self.problem.n_nodes());
        self.met.clear();
        self.find_folds();
        let is_stale = self.pairs.is_stale(&self.positions);
        if is_stale {
            // Most trial steps end in a crossing, and need no list.
            self.pairs.find_met((self.problem, &self.spacing, &self.positions), &mut self.met, work);
        }
        if !self.met.is_empty() {
            return Value { loss: f64::INFINITY, total: f64::INFINITY };
        }
        if is_stale {
            self.pairs.rebuild(self.problem, &mut self.spacing, &self.positions, work);
        } else {
            let (problem, positions) = (self.problem, &self.positions);
            self.pairs.push(|pair| ends(problem, positions, pair));
        }
        work.spend(self.pairs.pairs.len());
        let barrier = self.push_apart();
        if !self.met.is_empty() {
            return Value { loss: f64::INFINITY, total: f64::INFINITY };
        }
        let loss = self.loss(x);
        Value { loss, total: loss + self.strength * barrier }
    }

    /// E at x, where the last evaluation was.
    pub(super) fn loss(&mut self, x: &[f64]) -> f64 {
        self.ratio_loss(x) + self.placement()
    }

    fn place(&mut self, x: &[f64]) {
        let problem = self.problem;
        let (length_ratio, angle_ratio) = x.split_at(problem.branches.list().len());
        for node in 1..problem.n_nodes() {
            let parent = problem.parent[node] as usize;
            let bend = ratio::embedded_bend(problem.bend[node], angle_ratio[node]);
            self.turn[node] = problem.side[node] * bend;
            self.heading[node] = self.heading[parent] + self.turn[node];
            self.unit[node] = math::unit_vector(self.heading[node]);
            let stretch = 1.0 + length_ratio[problem.branch[node] as usize];
            let length_mm = problem.targets.length_mm[node] * stretch;
            self.positions[node] = self.positions[parent] + self.unit[node] * length_mm;
        }
    }

    fn ratio_loss(&self, x: &[f64]) -> f64 {
        let problem = self.problem;
        let (length_ratio, angle_ratio) = x.split_at(self.n_lengths());
        (1..problem.n_nodes())
            .map(|node| {
                let (r_l, r_a) = (length_ratio[problem.branch[node] as usize], angle_ratio[node]);
                problem.length_cost[node] * (r_l * r_l) + problem.angle_cost[node] * (r_a * r_a)
            })
            .sum()
    }

    /// The placement term as in `energy`, and its derivative by each heading.
    fn placement(&mut self) -> f64 {
        let problem = self.problem;
        let (mut cos_sum, mut sin_sum) = (0.0, 0.0);
        for node in 1..problem.n_nodes() {
            let (to, unit) =
                (DVec2::new(problem.placement_cos[node], problem.placement_sin[node]), self.unit[node]);
            cos_sum += to.dot(unit);
            sin_sum += unit.perp_dot(to);
        }
        let rotation = if cos_sum == 0.0 && sin_sum == 0.0 { 0.0 } else { math::atan2(sin_sum, cos_sum) };
        let (mut loss, mut slope_sum, mut agreement) = (0.0, 0.0, 0.0);
        for node in 1..problem.n_nodes() {
            let cost = problem.placement_cost[node];
            let off = wrap(self.heading[node] + rotation - problem.targets.heading_rad[node]);
            loss += cost * (off * off);
            self.heading_force[node] = 2.0 * cost * off;
            slope_sum += 2.0 * cost * off;
            agreement += cost * math::cos(off);
        }
        // The rotation is where Σ p sin(off) = 0, so it turns back by p cos(off) / Σ p cos(off) with a heading.
        if agreement > 0.0 {
            for node in 1..problem.n_nodes() {
                let off = self.heading[node] + rotation - problem.targets.heading_rad[node];
                let share = problem.placement_cost[node] * math::cos(off) / agreement;
                self.heading_force[node] -= slope_sum * share;
            }
        }
        loss
    }

    /// Notes edges with a common node that lie on each other.
    fn find_folds(&mut self) {
        let problem = self.problem;
        for parent in 0..problem.n_nodes() {
            let children = problem.tree.children(parent);
            if parent != 0 {
                let folded = children.iter().filter(|&&child| PI - self.turn[child].abs() <= FOLDED_RAD);
                self.met.extend(folded.map(|&child| (parent as u32, child as u32)));
            }
            if children.len() < 2 {
                continue;
            }
            self.order.clear();
            self.order.extend(children.iter().map(|&child| child as u32));
            let turn = &self.turn;
            let wrapped = |child: u32| wrap(turn[child as usize]);
            self.order.sort_unstable_by(|&a, &b| wrapped(a).total_cmp(&wrapped(b)).then(a.cmp(&b)));
            for idx in 0..self.order.len() {
                let (a, b) = (self.order[idx], self.order[(idx + 1) % self.order.len()]);
                let apart = wrapped(b) - wrapped(a) + if idx + 1 == self.order.len() { TAU } else { 0.0 };
                if apart <= FOLDED_RAD {
                    self.met.push((a.min(b), a.max(b)));
                }
            }
        }
    }

    /// Σ b over the pairs, which have been pushed, and the forces on their ends.
    fn push_apart(&mut self) -> f64 {
        let Self { problem, pairs, force, met, .. } = self;
        force.fill(DVec2::ZERO);
        let mut sum = 0.0;
        for (push, pair) in pairs.pushes.iter().zip(&pairs.pairs) {
            if push.value == 0.0 {
                continue;
            }
            if push.value == f64::INFINITY {
                met.push((pair.first, pair.second));
                continue;
            }
            sum += push.value;
            let (a, b) = (pair.first as usize, pair.second as usize);
            force[problem.parent[a] as usize] += push.on_first * (1.0 - push.along_first);
            force[a] += push.on_first * push.along_first;
            force[problem.parent[b] as usize] -= push.on_first * (1.0 - push.along_second);
            force[b] -= push.on_first * push.along_second;
        }
        sum
    }

    /// The gradient of the last evaluation, which was at x.
    pub(super) fn gradient(&mut self, x: &[f64], gradient: &mut [f64]) {
        let problem = self.problem;
        let n_lengths = self.n_lengths();
        gradient.fill(0.0);
        let (length_gradient, angle_gradient) = gradient.split_at_mut(n_lengths);
        for node in 0..problem.n_nodes() {
            self.torque[node] = self.positions[node].perp_dot(self.force[node]);
        }
        for node in (1..problem.n_nodes()).rev() {
            let (parent, segment) = (problem.parent[node] as usize, problem.branch[node] as usize);
            let (force, torque, turn_force) = (self.force[node], self.torque[node], self.heading_force[node]);
            let by_turn = self.strength * (torque - self.positions[parent].perp_dot(force)) + turn_force;
            let r_a = x[n_lengths + node];
            angle_gradient[node] = 2.0 * problem.angle_cost[node] * r_a
                + problem.side[node]
                    * by_turn
                    * bend_slope(problem.bend[node], r_a, problem.side[node] * by_turn);
            length_gradient[segment] += 2.0 * problem.length_cost[node] * x[segment]
                + self.strength * problem.targets.length_mm[node] * self.unit[node].dot(force);
            self.force[parent] += force;
            self.torque[parent] += torque;
            self.heading_force[parent] += turn_force;
        }
        self.heading_force[0] = 0.0;
    }

    /// The diagonal of the Gauss–Newton matrix at the places of the last evaluation, which was at x.
    pub(super) fn curvature(&mut self, x: &[f64], diagonal: &mut [f64]) {
        let problem = self.problem;
        let n_lengths = self.n_lengths();
        self.sum_moments();
        diagonal.fill(0.0);
        for node in 1..problem.n_nodes() {
            let (parent, segment) = (problem.parent[node] as usize, problem.branch[node] as usize);
            let moments = &self.moments[node];
            let slope = bend_slope(problem.bend[node], x[n_lengths + node], -1.0);
            diagonal[n_lengths + node] = 2.0 * problem.angle_cost[node]
                + slope
                    * slope
                    * (2.0 * problem.placement_cost[node]
                        + self.strength * by_rotation(moments, self.positions[parent]));
            diagonal[segment] += 2.0 * problem.length_cost[node];
        }
        for (segment, branch) in problem.branches.list().iter().enumerate() {
            let chord = (self.positions[branch.end()] - self.positions[branch.hub]) / (1.0 + x[segment]);
            diagonal[segment] += self.strength * by_shift(&self.moments[branch.nodes.start], chord);
        }
    }

    fn sum_moments(&mut self) {
        self.moments.fill([0.0; 6]);
        let Self { problem, paths, pairs, positions, moments, .. } = self;
        for pair in &pairs.pairs {
            let (a, b) = (pair.first as usize, pair.second as usize);
            let (p, q) = ends(problem, positions, pair);
            if are_apart(p, q, pair.bounds.floor_mm + pair.bounds.width_mm) {
                continue;
            }
            let contact = Contact::between(p, q);
            let u = (contact.distance - pair.bounds.floor_mm) / pair.bounds.width_mm;
            if u <= 0.0 || u >= 1.0 {
                continue;
            }
            let stiffness = barrier(u).2 / (pair.bounds.width_mm * pair.bounds.width_mm);
            let on_first = moments_of(stiffness, p.0.lerp(p.1, contact.along_first), contact.normal);
            let on_second = moments_of(stiffness, q.0.lerp(q.1, contact.along_second), contact.normal);
            let parting = paths.parting(a, b);
            for k in 0..6 {
                moments[b][k] += on_second[k];
                // Where one edge lies below the other, both move with the upper.
                if parting == a {
                    moments[a][k] -= on_second[k];
                } else {
                    moments[a][k] += on_first[k];
                    moments[parting][k] -= on_first[k] + on_second[k];
                }
            }
        }
        for node in (1..problem.n_nodes()).rev() {
            let sums = moments[node];
            let parent = &mut moments[problem.parent[node] as usize];
            parent.iter_mut().zip(sums).for_each(|(parent, sum)| *parent += sum);
        }
    }

    /// Which ratios move a pair that met against each other: marks the nodes on the paths between them.
    pub(super) fn mark_paths(&self, on_path: &mut [i32]) {
        on_path.fill(0);
        for &(a, b) in &self.met {
            let (a, b) = (a as usize, b as usize);
            let parting = self.paths.parting(a, b);
            on_path[b] += 1;
            // Above the parting nothing moves them against each other.
            if parting == a {
                on_path[self.problem.parent[a] as usize] -= 1;
            } else {
                on_path[a] += 1;
                on_path[parting] -= 2;
            }
        }
        for node in (1..on_path.len()).rev() {
            on_path[self.problem.parent[node] as usize] += on_path[node];
        }
    }
}

/// The slope of the bend by r_a; at 0 that of the side to which the energy falls, if it changes by `by_bend`.
fn bend_slope(bend_rad: f64, r_a: f64, by_bend: f64) -> f64 {
    // More bend is a smaller ratio: where bending lowers the energy, r_a goes below 0.
    let is_folding = r_a < 0.0 || (r_a == 0.0 && by_bend < 0.0);
    if is_folding { bend_rad - PI } else { -bend_rad }
}

/// A rotation about p moves a point c across a normal n by n × … = (n_y c_x − n_x c_y) − (n_y p_x − n_x p_y).
fn moments_of(stiffness: f64, point: DVec2, normal: DVec2) -> Moments {
    let across = normal.y * point.x - normal.x * point.y;
    let DVec2 { x, y } = normal;
    [across * across, across * x, across * y, x * x, x * y, y * y].map(|moment| stiffness * moment)
}

fn by_rotation(moments: &Moments, about: DVec2) -> f64 {
    let [aa, ax, ay, xx, xy, yy] = *moments;
    let DVec2 { x, y } = about;
    (aa - 2.0 * (ay * x - ax * y) + yy * x * x - 2.0 * xy * x * y + xx * y * y).max(0.0)
}

fn by_shift(moments: &Moments, shift: DVec2) -> f64 {
    let [.., xx, xy, yy] = *moments;
    (xx * shift.x * shift.x + 2.0 * xy * shift.x * shift.y + yy * shift.y * shift.y).max(0.0)
}
