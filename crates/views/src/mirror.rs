//! Which of its two sides each local plane shows.
//!
//! The metric does not tell v from −v, so each local plane has a free mirror; together the mirrors decide where
//! the parts of the tree come to lie when their angles are strung together.
//!
//! **Input** a [`ViewHierarchy`] whose planes face the global view's camera. **Output** the same, mirrors chosen.
//! **Notation** h, P, τ as in `headings`; C the chain's edges as the global view shows them, each turned back by the
//! turns before it, and summed: the chain's cost at first heading h is Σ |P| − C · (cos h, sin h).
//! **Steps** of the closed loop, which minimises Σ conf · l (1 − cos(h − H)) over all mirrors:
//! 1. Branch by branch from the tips: the least cost of the branch and all below, for each of 64 first headings and
//!    either side of its plane; headings between them are interpolated. The same for each fork.
//! 2. The root's heading and side of least cost.
//! 3. Branch by branch from the root, with exact headings: the side of less cost, the costs below it included.
//!
//! **Guarantees** an equal choice keeps the side that faces the global camera; no recursion.
//! **Source** ours; [Hu2022] leaves the mirror open.
//! **Why not** decide each set in preorder by its own edges alone: a fork then goes by its children's first edges,
//! which are short, and what is below cannot mend it. `heading_mismatch` on four trees of 135, 4332,
//! 9.5 k and 10 k nodes: 0.11, 0.29, 0.46, 0.28 that way; 0.11, 0.19, 0.29, 0.17 this way; 0.18–0.90 without a choice.
//! **Cost** O(64 · N) time, 64 numbers per branch.

use std::f64::consts::TAU;

use espalier_geom::{angle, math};
use espalier_model::{Branch, Branches, LocalPlane, Tree, View, ViewHierarchy};
use glam::DVec2;

use crate::headings::{edges_seen_mm, heading_at_root_rad, turn_rad};
use crate::params::Mirror;

/// Headings for which costs are kept, 5.6° apart: a cost is smooth but for its kinks, so interpolation is near.
const N_HEADINGS: usize = 64;
/// A share of the length that the global view shows: costs that differ by less are equal.
const EQUALLY_GOOD: f64 = 1e-12;
/// As it is, and turned over.
const SIDES: [f64; 2] = [1.0, -1.0];

/// Chooses the mirror of each plane.
pub(crate) fn choose_mirrors(tree: &Tree, branches: &Branches, views: &mut ViewHierarchy, rule: Mirror) {
    match rule {
        Mirror::Global => {}
        Mirror::Parent => face_parents(branches, views),
        Mirror::ClosedLoop => close_loop(tree, branches, views),
    }
}

/// Turns each plane to the side of the plane before it on the way from the root.
fn face_parents(branches: &Branches, views: &mut ViewHierarchy) {
    for (chain, branch) in views.chains.iter_mut().zip(branches.list()) {
        let above = views.forks[branch.hub].map_or(views.global, |fork| fork.view);
        turn_towards(chain, &above);
        if let Some(fork) = &mut views.forks[branch.end()] {
            turn_towards(fork, &chain.view);
        }
    }
}

fn turn_towards(plane: &mut LocalPlane, other: &View) {
    if plane.view.towards_camera.dot(other.towards_camera) < 0.0 {
        turn_over(plane);
    }
}

/// Shows the other side: left and right change places, up stays.
fn turn_over(plane: &mut LocalPlane) {
    plane.view.towards_camera = -plane.view.towards_camera;
    plane.is_mirrored = !plane.is_mirrored;
}

/// A cost by heading.
struct Costs([f64; N_HEADINGS]);

impl Costs {
    const NONE: Self = Self([0.0; N_HEADINGS]);

    fn of(cost: impl Fn(f64) -> f64) -> Self {
        Self(std::array::from_fn(|i| cost(i as f64 * TAU / N_HEADINGS as f64)))
    }

    fn at(&self, heading_rad: f64) -> f64 {
        let place = angle::wrap_positive(heading_rad) * (N_HEADINGS as f64 / TAU);
        let (i, between) = (place as usize, place.fract());
        self.0[i % N_HEADINGS] * (1.0 - between) + self.0[(i + 1) % N_HEADINGS] * between
    }
}

/// A chain, its plane as it is: what its cost depends on.
struct Chain {
    /// C for either side of the plane, as a share.
    turned_back: [DVec2; 2],
    /// Σ |P|, as a share.
    length_seen: f64,
    /// Σ τ: how far the last edge is turned from the first.
    turn_rad: f64,
    /// The fork at its end.
    fork: Fork,
}

impl Chain {
    fn of(tree: &Tree, branch: &Branch, plane: &LocalPlane, seen: &[DVec2], fork: Fork) -> Self {
        let mut chain = Self { turned_back: [DVec2::ZERO; 2], length_seen: 0.0, turn_rad: 0.0, fork };
        for node in branch.nodes.clone() {
            if node > branch.nodes.start {
                chain.turn_rad += turn_rad(tree, &plane.view, node);
            }
            for (turned_back, side) in chain.turned_back.iter_mut().zip(SIDES) {
                *turned_back += math::unit_vector(-side * chain.turn_rad).rotate(seen[node]);
            }
            chain.length_seen += seen[node].length();
        }
        chain
    }

    /// The cost of the chain at its first heading on either side of its plane, and of all below.
    fn costs(&self, heading_rad: f64, fork: &Costs) -> [f64; 2] {
        let heading = math::unit_vector(heading_rad);
        [0, 1].map(|side| {
            let last_rad = heading_rad + SIDES[side] * self.turn_rad;
            self.length_seen - self.turned_back[side].dot(heading) + fork.at(last_rad)
        })
    }
}

/// A fork, its plane as it is: the branches that hang from it with their turns; none at a tip. At the root, where
/// there is nothing to turn from, their headings.
struct Fork(Vec<(usize, f64)>);

impl Fork {
    fn of(tree: &Tree, branches: &Branches, node: usize, turn_of: impl Fn(usize) -> f64) -> Self {
        let children = tree.children(node).iter();
        Self(children.filter_map(|&child| Some((branches.of_node(child)?, turn_of(child)))).collect())
    }

    /// The cost of all below the fork at the heading that leads to it, on either side of its plane.
    fn costs(&self, heading_rad: f64, below: &[Costs]) -> [f64; 2] {
        SIDES.map(|side| {
            self.0.iter().map(|&(branch, turn)| below[branch].at(heading_rad + side * turn)).sum()
        })
    }
}

fn close_loop(tree: &Tree, branches: &Branches, views: &mut ViewHierarchy) {
    // As shares of the length seen, so that costs have no unit.
    let mut seen = edges_seen_mm(tree, &views.global);
    let total_mm: f64 = seen.iter().map(|edge| edge.length()).sum();
    seen.iter_mut().for_each(|edge| *edge /= total_mm.max(f64::MIN_POSITIVE));
    let chain_of = |(branch, plane): (&Branch, &LocalPlane)| {
        let fork_view = views.forks[branch.end()].map_or(plane.view, |fork| fork.view);
        let fork = Fork::of(tree, branches, branch.end(), |child| turn_rad(tree, &fork_view, child));
        Chain::of(tree, branch, plane, &seen, fork)
    };
    let chains: Vec<Chain> = branches.list().iter().zip(&views.chains).map(chain_of).collect();
    let root = Fork::of(tree, branches, 0, |child| heading_at_root_rad(tree, views, child));

    let (below, at_end) = least_costs(&chains);
    let mut heading_rad = vec![0.0; chains.len()];
    place_children(&root, best_rotations(&root, &below), views.forks[0].as_mut(), &mut heading_rad);
    for (i, chain) in chains.iter().enumerate() {
        let side = settle(Some(&mut views.chains[i]), chain.costs(heading_rad[i], &at_end[i]));
        let last_rad = heading_rad[i] + SIDES[side] * chain.turn_rad;
        let costs = chain.fork.costs(last_rad, &below).map(|cost| (cost, last_rad));
        place_children(&chain.fork, costs, views.forks[branches.list()[i].end()].as_mut(), &mut heading_rad);
    }
}

/// From the tips: the least cost of each branch and all below by its first heading, and of the fork at its end by
/// its last.
fn least_costs(chains: &[Chain]) -> (Vec<Costs>, Vec<Costs>) {
    let none = || chains.iter().map(|_| Costs::NONE).collect();
    let (mut below, mut at_end): (Vec<Costs>, Vec<Costs>) = (none(), none());
    let least = |costs: [f64; 2]| costs[0].min(costs[1]);
    for (i, chain) in chains.iter().enumerate().rev() {
        at_end[i] = Costs::of(|heading| least(chain.fork.costs(heading, &below)));
        below[i] = Costs::of(|heading| least(chain.costs(heading, &at_end[i])));
    }
    (below, at_end)
}

/// For either side of the root's plane the least cost over all rotations of the whole, and that rotation.
fn best_rotations(root: &Fork, below: &[Costs]) -> [(f64, f64); 2] {
    [0, 1].map(|side| {
        let rotations = (0..N_HEADINGS).map(|i| i as f64 * TAU / N_HEADINGS as f64);
        let costs = rotations.map(|rotation| (root.costs(rotation, below)[side], rotation));
        // The first of equal ones.
        costs.fold((f64::INFINITY, 0.0), |best, next| if next.0 < best.0 { next } else { best })
    })
}

/// Settles the side of a fork, given for either side its cost and the heading to turn from, and heads its branches.
fn place_children(
    fork: &Fork,
    costs_and_headings: [(f64, f64); 2],
    plane: Option<&mut LocalPlane>,
    heading_rad: &mut [f64],
) {
    let side = settle(plane, costs_and_headings.map(|(cost, _)| cost));
    for &(branch, turn) in &fork.0 {
        heading_rad[branch] = costs_and_headings[side].1 + SIDES[side] * turn;
    }
}

/// The side of less cost; the plane, if there is one, is turned over to it.
fn settle(plane: Option<&mut LocalPlane>, costs: [f64; 2]) -> usize {
    let is_better_turned = costs[1] < costs[0] - EQUALLY_GOOD;
    match plane {
        Some(plane) if is_better_turned => {
            turn_over(plane);
            1
        }
        _ => 0,
    }
}
