//! Which of its two sides each local plane shows.
//!
//! The metric does not tell v from −v, so each local plane has a free mirror; together they decide where the
//! parts of the tree come to lie when their angles are strung together.
//!
//! **Input** a [`ViewHierarchy`] whose planes face the global view's camera. **Output** the same, mirrors chosen.
//! **Notation** for each node: h the heading of its edge in the picture so far, H its heading in the global view,
//! P its edge as the global view shows it; τ = θ − π its turn, θ as in section 3.2.1.
//! **Steps** of the closed loop, branch by branch in preorder:
//! 1. A fork, its incoming heading known: try h = h_parent ± τ for all its children.
//! 2. A chain, its first heading known: try h = h_parent ± τ all the way.
//! 3. Keep the side of less Σ conf · l (1 − cos(h − H)), which is Σ |P| − P · (cos h, sin h), conf = |P| / l.
//!
//! The magnitude of τ is the exact bend in space, its sign is what the plane shows. At a root with several
//! children there is no incoming heading: the set is rotated to where that sum is least, each side on its own.
//! **Guarantees** an equal choice keeps the side that faces the global camera; no recursion.
//! **Source** ours; [Hu2022] leaves the mirror open. Against "as the parent's plane" and "as the global view's",
//! measured as [`heading_mismatch`].
//! **Cost** O(N).

use espalier_geom::{angle, math};
use espalier_model::{Branches, LocalPlane, Tree, View, ViewHierarchy};
use glam::DVec2;

use crate::params::Mirror;

/// A share of the length concerned: costs that differ by less are equal.
const EQUALLY_GOOD: f64 = 1e-12;

/// Chooses the mirror of each plane.
pub(crate) fn choose_mirrors(tree: &Tree, branches: &Branches, views: &mut ViewHierarchy, rule: Mirror) {
    match rule {
        Mirror::Global => {}
        Mirror::Parent => face_parents(branches, views),
        Mirror::ClosedLoop => {
            string_together(tree, branches, views, Sides::Best);
        }
    }
}

/// Σ conf · l (1 − cos(h − H)) / Σ conf · l over all edges, for the mirrors as they are: 0 if the angles strung
/// together reproduce the global view, 1 on average for headings at random, 2 at worst.
pub(crate) fn heading_mismatch(tree: &Tree, branches: &Branches, views: &ViewHierarchy) -> f64 {
    let strung = string_together(tree, branches, &mut views.clone(), Sides::AsTheyAre);
    let total: f64 = strung.seen.iter().map(|edge| edge.length()).sum();
    let cost: f64 =
        (1..tree.n_nodes()).map(|node| cost_of(strung.seen[node], strung.heading_rad[node])).sum();
    if total > 0.0 { cost / total } else { 0.0 }
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

/// Which sides the stringing may show.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Sides {
    AsTheyAre,
    Best,
}

/// The tree strung together from its angles.
struct Strung {
    /// P by node: its edge as the global view shows it, in mm; none for the root.
    seen: Vec<DVec2>,
    /// h by node: the heading of its edge; 0 for the root.
    heading_rad: Vec<f64>,
}

fn string_together(tree: &Tree, branches: &Branches, views: &mut ViewHierarchy, sides: Sides) -> Strung {
    let edge_seen = |node: usize| {
        let edge = tree.parent(node).map(|parent| tree.position_mm(node) - tree.position_mm(parent));
        edge.map_or(DVec2::ZERO, |edge| views.global.project(edge))
    };
    let seen = (0..tree.n_nodes()).map(edge_seen).collect();
    let mut strung = Strung { seen, heading_rad: vec![0.0; tree.n_nodes()] };

    // The root: a single child heads as the global view shows it.
    if let Some(plane) = &mut views.forks[0] {
        let headings = headings_about_root(tree, plane, &strung.seen);
        strung.settle(tree.children(0), headings, plane, sides);
    } else if let [child] = *tree.children(0) {
        strung.heading_rad[child] = angle::heading(strung.seen[child]);
    }

    for (plane, branch) in views.chains.iter_mut().zip(branches.list()) {
        // The chain: its first heading was settled by the fork above.
        let nodes: Vec<usize> = branch.nodes.clone().skip(1).collect();
        let mut headings = [strung.heading_rad[branch.nodes.start]; 2];
        let along = nodes.iter().map(|&node| {
            let turn = turn_rad(tree, &plane.view, node);
            headings = [headings[0] + turn, headings[1] - turn];
            headings
        });
        let along = along.collect();
        strung.settle(&nodes, along, plane, sides);

        // The fork at its end.
        if let Some(plane) = &mut views.forks[branch.end()] {
            let incoming = strung.heading_rad[branch.end()];
            let children = tree.children(branch.end());
            let turns = children.iter().map(|&child| turn_rad(tree, &plane.view, child));
            let headings = turns.map(|turn| [incoming + turn, incoming - turn]).collect();
            strung.settle(children, headings, plane, sides);
        }
    }
    strung
}

impl Strung {
    /// Settles the headings of a set: as its plane shows them (first), or mirrored (second), with its plane.
    fn settle(&mut self, nodes: &[usize], headings: Vec<[f64; 2]>, plane: &mut LocalPlane, sides: Sides) {
        let (mut cost, mut weight) = ([0.0; 2], 0.0);
        for (&node, heading) in nodes.iter().zip(&headings) {
            weight += self.seen[node].length();
            cost[0] += cost_of(self.seen[node], heading[0]);
            cost[1] += cost_of(self.seen[node], heading[1]);
        }
        let is_turned = sides == Sides::Best && cost[1] < cost[0] - EQUALLY_GOOD * weight;
        if is_turned {
            turn_over(plane);
        }
        for (&node, heading) in nodes.iter().zip(headings) {
            self.heading_rad[node] = heading[usize::from(is_turned)];
        }
    }
}

/// conf · l (1 − cos(h − H)).
fn cost_of(seen: DVec2, heading_rad: f64) -> f64 {
    seen.length() - seen.dot(math::unit_vector(heading_rad))
}

/// The turn τ = θ − π at the parent of `node`: the exact bend in space, positive to the left in the view.
fn turn_rad(tree: &Tree, view: &View, node: usize) -> f64 {
    let edge =
        |node: usize| tree.parent(node).map(|parent| tree.position_mm(node) - tree.position_mm(parent));
    let (Some(outgoing), Some(incoming)) = (edge(node), tree.parent(node).and_then(edge)) else { return 0.0 };
    let bend = angle::between(incoming, outgoing);
    let is_left = view.project(incoming).perp_dot(view.project(outgoing)) > 0.0;
    if is_left { bend } else { -bend }
}

/// The headings of the root's children on either side of the fork's plane, each rotated to its least cost.
fn headings_about_root(tree: &Tree, plane: &LocalPlane, seen: &[DVec2]) -> Vec<[f64; 2]> {
    let children = tree.children(0);
    let heading_in_plane =
        |&child: &usize| angle::heading(plane.view.project(tree.position_mm(child) - tree.position_mm(0)));
    let headings: Vec<f64> = children.iter().map(heading_in_plane).collect();
    // Σ |P| − P · (cos(h + ρ), sin(h + ρ)) is least where ρ is the argument of Σ P turned back by h.
    let rotation = |sign: f64| {
        let turned_back = children.iter().zip(&headings);
        let sum: DVec2 =
            turned_back.map(|(&child, h)| math::unit_vector(-sign * h).rotate(seen[child])).sum();
        angle::heading(sum)
    };
    let rotations = [rotation(1.0), rotation(-1.0)];
    headings.iter().map(|h| [rotations[0] + h, rotations[1] - h]).collect()
}
