//! What stays the same during the search: the tree, the size of each bend, the angles in space, the headings aimed at.
//!
//! **Input** the problem. **Output** `Setting`. **Cost** O(N log N).

use std::f64::consts::PI;
use std::ops::Range;

use espalier_geom::angle::between;
use espalier_geom::math;
use espalier_geom::plane::{Segment, segment_distance};
use espalier_model::TargetKind;
use glam::DVec2;

use super::conflicts::Fault;
use crate::problem::Problem;
use crate::separation::Separation;
use crate::{siblings, targets};

/// All pairs of siblings have a say up to this many children, neighbours in the list of children above.
const MOST_SIBLINGS_IN_PAIRS: usize = 6;
/// A search may change single sides at forks of at most this many children.
pub(super) const MOST_SIBLINGS_FLIPPED: usize = 8;

/// The edges behind the root that keep its back free: edge numbers from `n_nodes` on.
pub(super) const N_RAYS: usize = 2;

/// The frozen side of the search.
pub(super) struct Setting<'p> {
    pub(super) problem: &'p Problem<'p>,
    pub(super) separation: Separation,
    /// |θ − π| of each node before siblings were moved apart.
    pub(super) bend_rad: Vec<f64>,
    /// Sides of the given targets.
    pub(super) first_side: Vec<f64>,
    /// p e^{iH} of each edge: its share in the placement, towards its heading in the global view.
    pub(super) aim: Vec<DVec2>,
    /// Whether the space behind the root is kept free.
    pub(super) keeps_out: bool,
    /// The longest distance from the root, in mm.
    pub(super) radius_mm: f64,
    sibling_angle_rad: Vec<f64>,
    first_sibling_pair: Vec<u32>,
}

impl<'p> Setting<'p> {
    pub(super) fn new(problem: &'p Problem<'p>, clearance: f64, keeps_out: bool) -> Self {
        let n_nodes = problem.n_nodes();
        let tree = problem.tree;
        let is_exact = problem.targets.kind.unmirrored() == TargetKind::Intrinsic;
        let bend = |node: usize| match problem.parent[node] as usize {
            parent if parent != 0 && is_exact => PI - targets::interior_angle(tree, node, parent),
            _ => problem.bend[node],
        };
        let (mut sibling_angle_rad, mut first_sibling_pair) = (Vec::new(), vec![0]);
        for node in 0..n_nodes {
            let (children, hub) = (tree.children(node), tree.position_mm(node));
            let ahead = |child: usize| tree.position_mm(children[child]) - hub;
            each_sibling_pair(children.len(), |a, b| sibling_angle_rad.push(between(ahead(a), ahead(b))));
            first_sibling_pair.push(sibling_angle_rad.len() as u32);
        }
        let extent = (0..n_nodes).map(|node| tree.position_mm(node).distance(tree.position_mm(0)));
        Self {
            problem,
            separation: Separation::new(problem, clearance),
            bend_rad: (0..n_nodes).map(bend).collect(),
            first_side: problem.side.clone(),
            aim: aims(problem),
            keeps_out: keeps_out && tree.children(0).len() == 1,
            radius_mm: extent.fold(0.0, f64::max),
            sibling_angle_rad,
            first_sibling_pair,
        }
    }

    pub(super) fn n_nodes(&self) -> usize {
        self.problem.n_nodes()
    }

    /// Edges by their lower nodes, and the rays.
    pub(super) fn n_edges(&self) -> usize {
        self.n_nodes() + N_RAYS
    }

    pub(super) fn parent(&self, node: usize) -> usize {
        self.problem.parent[node] as usize
    }

    /// The nodes of a segment.
    pub(super) fn segment(&self, segment: usize) -> Range<usize> {
        self.problem.branches.list()[segment].nodes.clone()
    }

    /// The nodes of the segment of a node that is not the root.
    pub(super) fn segment_of(&self, node: usize) -> Range<usize> {
        self.segment(self.problem.branch[node] as usize)
    }

    /// The nodes below a node and itself.
    pub(super) fn subtree(&self, node: usize) -> Range<usize> {
        self.problem.tree.subtree(node)
    }

    /// Whether a turn and the one before it are both inside one segment, where they form one arc or a zigzag.
    pub(super) fn continues_arc(&self, node: usize) -> bool {
        node >= 3 && node >= self.segment_of(node).start + 2
    }

    /// The price of a zigzag at a node whose side has changed against that of the turn before.
    pub(super) fn zigzag_rad(&self, node: usize) -> f64 {
        self.bend_rad[node].min(self.bend_rad[node - 1])
    }

    /// Moves the turns of siblings apart, which are given on the sides that are given.
    pub(super) fn separate(&self, children: &[usize], side: &[f64], turn_rad: &mut Vec<f64>) {
        turn_rad.clear();
        turn_rad.extend(children.iter().zip(side).map(|(&child, side)| PI + side * self.bend_rad[child]));
        let order: Vec<usize> = (0..children.len()).collect();
        let view = turn_rad.clone();
        siblings::separate(&order, &view, turn_rad);
        let (low, high) = (siblings::MARGIN_RAD - PI, PI - siblings::MARGIN_RAD);
        turn_rad.iter_mut().for_each(|angle| *angle = (*angle - PI).clamp(low, high));
    }

    /// How far the angles between the children of a node are from those in space, in rad: the sum for one child
    /// more than there are pairs to choose freely.
    pub(super) fn sibling_error_rad(&self, node: usize, turn_rad: impl Fn(usize) -> f64) -> f64 {
        let n_children = self.problem.tree.children(node).len();
        let first = self.first_sibling_pair[node] as usize;
        let n_pairs = self.first_sibling_pair[node + 1] as usize - first;
        if n_pairs == 0 {
            return 0.0;
        }
        let (mut pair_idx, mut sum) = (first, 0.0);
        each_sibling_pair(n_children, |a, b| {
            let apart = (turn_rad(a) - turn_rad(b)).abs();
            sum += (apart.min(2.0 * PI - apart) - self.sibling_angle_rad[pair_idx]).abs();
            pair_idx += 1;
        });
        sum * (n_children - 1) as f64 / n_pairs as f64
    }

    /// What is wrong with two edges, if anything.
    pub(super) fn fault(&self, a: (usize, Segment), b: (usize, Segment)) -> Option<Fault> {
        let n_nodes = self.n_nodes();
        let (first, last) = (a.0.min(b.0), a.0.max(b.0));
        if last >= n_nodes {
            let is_apart = first >= n_nodes || self.parent(first) == 0 || !properly_cross(&a.1, &b.1);
            return if is_apart { None } else { Some(Fault::KeepOut) };
        }
        let parent = self.parent(last);
        if parent == first || parent == self.parent(first) {
            return None;
        }
        if properly_cross(&a.1, &b.1) {
            return Some(Fault::Crossing);
        }
        let distance_mm = segment_distance(&a.1, &b.1);
        if distance_mm < self.separation.tolerance_mm() {
            Some(Fault::Crossing)
        } else if distance_mm < self.separation.clearance_mm
            && distance_mm < self.separation.required_mm(first, last)
        {
            Some(Fault::Near)
        } else {
            None
        }
    }

    /// Edges farther apart than this have no fault.
    pub(super) fn reach_mm(&self) -> f64 {
        self.separation.clearance_mm.max(self.separation.tolerance_mm())
    }
}

/// Shares of Σ conf² l, 0 if the view shows nothing.
fn aims(problem: &Problem) -> Vec<DVec2> {
    let targets = &problem.targets;
    let weight = |node: usize| targets.confidence[node] * targets.confidence[node] * targets.length_mm[node];
    let total: f64 = (0..problem.n_nodes()).map(weight).sum();
    let share = |node: usize| if total > 0.0 { weight(node) / total } else { 0.0 };
    (0..problem.n_nodes()).map(|node| math::unit_vector(targets.heading_rad[node]) * share(node)).collect()
}

fn each_sibling_pair(n_children: usize, mut visit: impl FnMut(usize, usize)) {
    if n_children <= MOST_SIBLINGS_IN_PAIRS {
        for a in 0..n_children {
            (a + 1..n_children).for_each(|b| visit(a, b));
        }
    } else {
        (1..n_children).for_each(|b| visit(b - 1, b));
    }
}

/// Whether each segment has its ends on both sides of the other, as far as plain arithmetic can tell: what it cannot
/// tell is nearer than the tolerance.
fn properly_cross(s: &Segment, t: &Segment) -> bool {
    let (along_s, along_t) = (s.b - s.a, t.b - t.a);
    let (to_a, to_b) = (t.a - s.a, t.b - s.a);
    along_s.perp_dot(to_a) * along_s.perp_dot(to_b) < 0.0
        && along_t.perp_dot(-to_a) * along_t.perp_dot(s.b - t.a) < 0.0
}
