//! Whether targets are what they say.
//!
//! **Input** the tree, its views, the targets. **Output** checks.
//! **Steps** 1. Lengths are those in space. 2. Headings and confidences are those of the global view. 3. `intrinsic`:
//! the size of each angle is that in space, at least 0.02 rad from a fold; where siblings had to be kept apart, an
//! angle may be another if a sibling is no farther than the gap, or if it stands at the 0.02 rad.
//! **Source** [Hu2022] section 3.2.1. **Cost** O(N).

use std::f64::consts::{PI, TAU};

use espalier_geom::math;
use espalier_model::{TargetKind, Targets, Tree, ViewHierarchy};

use crate::check::Check;
use crate::flat::interior_angle;

/// Far above rounding in doubles.
const TOLERANCE: f64 = 1e-9;
/// How far targets keep from 0 and 2π.
const MARGIN_RAD: f64 = 0.02;
/// The widest gap asked for between siblings.
const GAP_RAD: f64 = 0.05;

/// Checks targets; `pinned` nodes have an angle of the user's.
pub(crate) fn check(tree: &Tree, views: Option<&ViewHierarchy>, targets: &Targets) -> Vec<Check> {
    let length = tree.edges().find(|&(node, _)| {
        let length_mm = tree.edge_length_mm(node);
        (targets.length_mm[node] - length_mm).abs() > TOLERANCE * length_mm
    });
    let says = |node: usize| format!("node {node}: {:.9}", targets.length_mm[node]);
    let mut checks =
        vec![Check::unless("target lengths", "those in space", length.map(|(node, _)| says(node)))];
    if let Some(views) = views {
        let stray =
            tree.edges().find_map(|(node, parent)| stray_heading(tree, views, targets, (node, parent)));
        checks.push(Check::unless("target headings", "those of the global view", stray));
    }
    if matches!(targets.kind, TargetKind::Intrinsic | TargetKind::IntrinsicMirrored) {
        let stray = tree.edges().find_map(|(node, parent)| stray_angle(tree, targets, (node, parent)));
        checks.push(Check::unless("target angles", "those in space", stray));
    }
    checks
}

fn stray_heading(
    tree: &Tree,
    views: &ViewHierarchy,
    targets: &Targets,
    (node, parent): (usize, usize),
) -> Option<String> {
    let edge = tree.position_mm(node) - tree.position_mm(parent);
    let seen = views.global.project(edge);
    let confidence = (math::hypot(seen.x, seen.y) / edge.length()).min(1.0);
    let off = math::atan2(seen.y, seen.x) - targets.heading_rad[node];
    // 1 − cos needs no wrapping; a heading that cannot be seen may be any.
    let is_off = confidence > TOLERANCE && 1.0 - math::cos(off) > TOLERANCE;
    let stated = targets.confidence[node];
    (is_off || (stated - confidence).abs() > TOLERANCE)
        .then(|| format!("node {node}: off by {off:.9} rad, confidence {confidence:.9} not {stated:.9}"))
}

fn stray_angle(tree: &Tree, targets: &Targets, (node, parent): (usize, usize)) -> Option<String> {
    let in_space = interior_angle(tree, node)?;
    let target = targets.angle_rad[node];
    let size = target.min(TAU - target);
    let is_met = (size - in_space.max(MARGIN_RAD)).abs() <= TOLERANCE;
    if is_met {
        return None;
    }
    let siblings = tree.children(parent);
    let gap = GAP_RAD.min(PI / (siblings.len() as f64 + 1.0)) * (1.0 + TOLERANCE);
    let is_crowded = size <= MARGIN_RAD * (1.0 + TOLERANCE)
        || siblings.iter().any(|&other| other != node && (targets.angle_rad[other] - target).abs() <= gap);
    let is_fork = siblings.len() > 1;
    (!(is_fork && is_crowded)).then(|| format!("node {node}: {size:.9} rad, in space {in_space:.9}"))
}
