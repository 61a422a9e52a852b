//! The energy of a layout by parts.
//!
//! **Input** ratios that have been checked, what was measured in the plane, targets, weights. **Output** the parts.
//! **Notation** M branches, L the tree's length, h heading, H heading in the global view, p = w_g (M/L) conf² l.
//! **Steps** 1. Length and angle: for each branch the mean of w r². 2. Side: for each branch w_s times the mean of
//! 2/π · min(a, π − a, b, π − b) over turns to the other side, a the target's bend and b the layout's. 3. Placement:
//! Σ p wrap(h + φ − H)², φ the direction of Σ p e^{i(H − h)}, by which Σ p cos(h + φ − H) is largest.
//! **Source** [Hu2022] Eq. 4; side and placement terms are ours. **Cost** O(N).

use std::f64::consts::{FRAC_PI_2, PI};

use espalier_geom::math;
use espalier_model::{Branches, Energy, Targets, Tree};
use glam::DVec2;

use crate::flat::Flat;
use crate::weights::NodeWeights;

/// A layout that is scored.
pub(crate) struct Scored<'a> {
    pub(crate) tree: &'a Tree,
    pub(crate) branches: &'a Branches,
    pub(crate) targets: &'a Targets,
    pub(crate) flat: &'a Flat,
    pub(crate) length_ratio: &'a [f64],
    pub(crate) angle_ratio: &'a [f64],
}

/// The parts of the energy, that of crossings aside.
pub(crate) fn energy(scored: &Scored<'_>, weights: &NodeWeights) -> Energy {
    let square = |ratio: f64| ratio * ratio;
    let length = |node: usize| Some(weights.length[node] * square(scored.length_ratio[node]));
    let angle = |node: usize| {
        let has_angle = scored.flat.angle_rad[node].is_some();
        has_angle.then(|| weights.angle[node] * square(scored.angle_ratio[node]))
    };
    let side = |node: usize| {
        let embedded = scored.flat.angle_rad[node]?;
        let is_met = scored.angle_ratio[node] == 0.0;
        let target = scored.targets.angle_rad[node];
        Some(if is_met { 0.0 } else { weights.side * switched(target - PI, embedded - PI) })
    };
    Energy {
        length: sum_of_means(scored.branches, length),
        angle: sum_of_means(scored.branches, angle),
        side: sum_of_means(scored.branches, side),
        placement: placement(scored, weights.placement),
        crossing: 0.0,
    }
}

/// Σ over branches of the mean of what their nodes have.
fn sum_of_means(branches: &Branches, of: impl Fn(usize) -> Option<f64>) -> f64 {
    let mean = |nodes: std::ops::Range<usize>| {
        let (sum, count) =
            nodes.filter_map(&of).fold((0.0, 0.0), |(sum, n), value| (sum + value, n + 1.0_f64));
        sum / count.max(1.0)
    };
    branches.list().iter().map(|branch| mean(branch.nodes.clone())).sum()
}

/// How far a turn is on the other side of its target.
fn switched(target_rad: f64, turn_rad: f64) -> f64 {
    let (a, b) = (target_rad.abs(), turn_rad.abs());
    if target_rad * turn_rad < 0.0 { a.min(PI - a).min(b).min(PI - b).max(0.0) / FRAC_PI_2 } else { 0.0 }
}

fn placement(Scored { tree, branches, targets, flat, .. }: &Scored<'_>, weight: f64) -> f64 {
    let length_mm: f64 = (0..tree.n_nodes()).map(|node| tree.edge_length_mm(node)).sum();
    let per_mm = weight * branches.list().len() as f64 / length_mm;
    let mut agreement = DVec2::ZERO;
    let mut terms = Vec::with_capacity(tree.n_nodes());
    for (node, _) in tree.edges() {
        let cost = per_mm * targets.confidence[node] * targets.confidence[node] * targets.length_mm[node];
        // e^{i(H − h)}: by how much the edge would have to turn.
        let missing = turned_back(math::unit_vector(targets.heading_rad[node]), flat.direction[node]);
        agreement += cost * missing;
        terms.push((cost, missing));
    }
    if agreement == DVec2::ZERO {
        agreement = DVec2::X;
    }
    let off = |missing: DVec2| {
        let rest = turned_back(missing, agreement);
        math::atan2(rest.y, rest.x)
    };
    terms.iter().map(|&(cost, missing)| cost * (off(missing) * off(missing))).sum()
}

/// a / b as complex numbers, but for the length of b.
fn turned_back(a: DVec2, b: DVec2) -> DVec2 {
    DVec2::new(a.x * b.x + a.y * b.y, a.y * b.x - a.x * b.y)
}
