//! What an embedding says of its tubes at their widths, held against tree and layout.
//!
//! **Input** the tree, the embedding, the overlaps found. **Output** a check per number of `widths`.
//! **Definition** as documented in `embedding.json`: `radius_scale` is the least distance over the sum of radii among
//! pairs that overlap. Available is the disc that exact lengths cannot leave: the longest path from the root and the
//! largest width. Needed is the area of capsules that cannot merge in any layout: along each branch, the first edge
//! that is clear of the junction discs at both ends (those of the two thickest tubes there at 20°) and of the one
//! picked before it (twice the sum of their radii). **Cost** O(N).

use std::f64::consts::PI;

use espalier_geom::math;
use espalier_model::{Branch, Branches, Embedding, Tree, WidthMode};

use crate::check::Check;
use crate::overlaps::Overlaps;

/// The narrowest gap of a fork, in degrees.
const NARROWEST_DEG: f64 = 20.0;
/// Share by which areas may differ.
const ROUNDING: f64 = 1e-9;

/// Checks `widths`.
pub(crate) fn check(
    (tree, branches): (&Tree, &Branches),
    embedding: &Embedding,
    found: &Overlaps,
) -> Vec<Check> {
    let widths = &embedding.widths;
    let organ = Organ::new(tree, embedding);
    let (needed, available) = (organ.needed_mm2(branches), organ.available_mm2());
    let mut checks = vec![
        Check::near("widths: area needed", widths.area_needed_mm2, needed, ROUNDING * needed),
        Check::near("widths: area available", widths.area_available_mm2, available, ROUNDING * available),
        check_length_scale(embedding),
    ];
    if found.is_complete && widths.is_complete {
        let counts = found.certain..=found.certain + found.open;
        let counted = if counts.contains(&widths.overlaps) { widths.overlaps } else { found.certain };
        checks.push(Check::same("widths: overlaps", widths.overlaps, counted));
        checks.push(check_radius_scale(widths.radius_scale, found.scale));
    } else {
        let why = "too many tubes overlap to count them";
        checks.push(Check::untested("widths: overlaps", widths.overlaps, why));
        checks.push(Check::untested("widths: radius scale", widths.radius_scale, why));
    }
    checks
}

/// Between the scale that all open pairs ask for and the one that none does.
fn check_radius_scale(stated: f64, [least, most]: [f64; 2]) -> Check {
    let name = "widths: radius scale";
    let is_between = stated >= least * (1.0 - ROUNDING) && stated <= most * (1.0 + ROUNDING);
    Check::near(name, stated, if is_between { stated } else { most }, ROUNDING * most)
}

/// Only stretching scales lengths; what was stretched has no overlap left.
fn check_length_scale(embedding: &Embedding) -> Check {
    let widths = &embedding.widths;
    let may_scale = widths.mode == WidthMode::Stretch;
    let fault = if !may_scale && widths.length_scale != 1.0 {
        Some("only stretching scales lengths".to_owned())
    } else if widths.length_scale < 1.0 {
        Some("lengths are never made shorter".to_owned())
    } else if widths.length_scale > 1.0 && widths.overlaps > 0 {
        Some(format!("{} overlaps are left after stretching", widths.overlaps))
    } else {
        None
    };
    Check::unless("widths: length scale", format!("{:.6}", widths.length_scale), fault)
}

/// The tree as tubes of exact lengths.
struct Organ<'a> {
    tree: &'a Tree,
    length: &'a [f64],
    /// Half the width of each edge; none at the root.
    radius: Vec<f64>,
    /// Path from the root to each node.
    depth: Vec<f64>,
}

impl<'a> Organ<'a> {
    fn new(tree: &'a Tree, embedding: &'a Embedding) -> Self {
        let (nodes, length) = (tree.nodes(), &embedding.targets.length_mm[..]);
        let (mut radius, mut depth) = (vec![0.0; nodes.len()], vec![0.0; nodes.len()]);
        for (node, parent) in tree.edges() {
            radius[node] = f64::midpoint(nodes[node].radius_mm, nodes[parent].radius_mm);
            depth[node] = depth[parent] + length[node];
        }
        Self { tree, length, radius, depth }
    }

    fn available_mm2(&self) -> f64 {
        let most = |values: &[f64]| values.iter().fold(0.0, |a: f64, &b| a.max(b));
        let reach = most(&self.depth) + most(&self.radius);
        PI * reach * reach
    }

    fn needed_mm2(&self, branches: &Branches) -> f64 {
        branches.list().iter().map(|branch| self.needed_along(branch)).sum()
    }

    fn needed_along(&self, branch: &Branch) -> f64 {
        let (hub, end) = (branch.hub, branch.end());
        let ends_free = self.tree.children(end).is_empty();
        let (first, last) = (
            self.depth[hub] + self.merging(hub),
            self.depth[end] - if ends_free { 0.0 } else { self.merging(end) },
        );
        let (mut needed, mut free_from, mut before) = (0.0, first, None);
        for node in branch.nodes.clone() {
            let (radius, to) = (self.radius[node], self.depth[node]);
            let from = to - self.length[node];
            let apart = before.map_or(0.0, |before: f64| 2.0 * (before + radius));
            let clears_hub = from >= free_from + apart && from >= self.depth[hub] + radius;
            let clears_end = to <= last && (ends_free || to <= self.depth[end] - radius);
            if radius > 0.0 && clears_hub && clears_end {
                needed += PI * radius * radius + 2.0 * radius * self.length[node];
                (free_from, before) = (to, Some(radius));
            }
        }
        needed
    }

    /// The largest junction disc at a node; of a tip none.
    fn merging(&self, node: usize) -> f64 {
        let children = self.tree.children(node);
        if children.is_empty() {
            return 0.0;
        }
        let own = (node > 0).then_some(node);
        let mut widths: Vec<f64> =
            children.iter().copied().chain(own).map(|edge| self.radius[edge]).collect();
        widths.sort_by(|a, b| b.total_cmp(a));
        let (r, s) = (widths[0], widths.get(1).copied().unwrap_or(0.0));
        let (sin, cos) = math::sin_cos(NARROWEST_DEG.to_radians());
        (r * r + s * s + 2.0 * r * s * cos).sqrt() / sin
    }
}
