//! How many pairs of drawn tubes overlap.
//!
//! **Input** the tree with radii, positions. **Output** `Overlaps`: pairs that do, pairs that rounding may put on
//! either side, and the scale of radii at which none does. **Definition** as documented for the column `overlaps`: an edge is a capsule of its mean radius; two
//! edges without a common node overlap if their capsules do and if the path along the tree between their near ends is
//! longer than r_e + r_f and than twice the junction disc of the node at which they part. The disc of tubes r_i, r_j at
//! the gap g has the radius √(r_i² + r_j² + 2 r_i r_j cos g) / sin g for g ≤ 90°, r_i + r_j above, and no more than the
//! shorter of their two branches.
//! **Steps** each edge asks a tree of boxes for later edges whose boxes meet its own; of those, distance, path, disc.
//! **Cost** O((N + pairs) log N), at most 20 million pairs.

use espalier_geom::math;
use espalier_geom::plane::{Segment, segment_distance};
use espalier_model::{Branches, Tree};
use glam::DVec2;

use crate::boxes::{Box2, Boxes};
use crate::kinship::Kinship;

/// The most pairs whose boxes meet that are looked at.
const MOST_PAIRS: usize = 20_000_000;
/// Comparisons nearer than this share are left open.
const OPEN: f64 = 1e-9;

/// What was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Overlaps {
    /// Pairs that overlap beyond doubt.
    pub(crate) certain: usize,
    /// Pairs that are too near to the border to tell.
    pub(crate) open: usize,
    /// Whether all pairs were looked at.
    pub(crate) is_complete: bool,
    /// The least distance over the sum of radii, at most 1: of the pairs that overlap and of the open ones, and of
    /// the former alone.
    pub(crate) scale: [f64; 2],
}

/// Counts the overlapping pairs.
pub(crate) fn count(tree: &Tree, branches: &Branches, positions: &[DVec2]) -> Overlaps {
    let tubes = Tubes::new(tree, branches, positions);
    let mut boxes = Boxes::new(tree.n_nodes(), |edge| tubes.bounds(edge));
    let (mut found, mut n_pairs) = (Overlaps { certain: 0, open: 0, is_complete: true, scale: [1.0; 2] }, 0);
    let mut later = Vec::new();
    for edge in 1..tree.n_nodes() {
        boxes.later_meeting(edge, &tubes.bounds(edge), &mut later);
        n_pairs += later.len();
        if n_pairs > MOST_PAIRS {
            found.is_complete = false;
            return found;
        }
        for &other in &later {
            let verdict = tubes.overlap(edge, other);
            if verdict == Some(false) {
                continue;
            }
            let scale = tubes.distance(edge, other) / tubes.reach(edge, other);
            found.scale[0] = found.scale[0].min(scale);
            if verdict == Some(true) {
                found.certain += 1;
                found.scale[1] = found.scale[1].min(scale);
            } else {
                found.open += 1;
            }
        }
    }
    found
}

struct Tubes<'a> {
    tree: &'a Tree,
    branches: &'a Branches,
    positions: &'a [DVec2],
    radius: Vec<f64>,
    /// Path in the plane from the root to each node.
    path: Vec<f64>,
    kinship: Kinship<'a>,
}

impl<'a> Tubes<'a> {
    fn new(tree: &'a Tree, branches: &'a Branches, positions: &'a [DVec2]) -> Self {
        let (nodes, n_nodes) = (tree.nodes(), tree.n_nodes());
        let (mut radius, mut path) = (vec![0.0; n_nodes], vec![0.0; n_nodes]);
        for (node, parent) in tree.edges() {
            radius[node] = f64::midpoint(nodes[node].radius_mm, nodes[parent].radius_mm);
            path[node] = path[parent] + (positions[node] - positions[parent]).length();
        }
        Self { tree, branches, positions, radius, path, kinship: Kinship::new(tree) }
    }

    fn segment(&self, node: usize) -> Segment {
        Segment { a: self.positions[self.kinship.parent(node)], b: self.positions[node] }
    }

    fn bounds(&self, node: usize) -> Box2 {
        let Segment { a, b } = self.segment(node);
        Box2::around(a, b, self.radius[node])
    }

    /// The distance between the centrelines of two edges.
    fn distance(&self, a: usize, b: usize) -> f64 {
        segment_distance(&self.segment(a), &self.segment(b))
    }

    /// The sum of their radii.
    fn reach(&self, a: usize, b: usize) -> f64 {
        self.radius[a] + self.radius[b]
    }

    /// Whether edges a < b overlap; `None` if rounding decides.
    fn overlap(&self, a: usize, b: usize) -> Option<bool> {
        if self.kinship.are_neighbours(a, b) {
            return Some(false);
        }
        let reach = self.reach(a, b);
        let is_near = is_less(self.distance(a, b), reach);
        if is_near == Some(false) {
            return Some(false);
        }
        let (near_a, near_b, parting) = self.kinship.near_ends(a, b);
        let between = self.path[near_a] + self.path[near_b] - 2.0 * self.path[parting];
        let is_far = is_less(reach.max(2.0 * self.disc(parting, a, b)), between);
        match (is_near, is_far) {
            (_, Some(false)) => Some(false),
            (Some(true), Some(true)) => Some(true),
            _ => None,
        }
    }

    /// The junction disc at `parting` between the tubes that lead to two edges.
    fn disc(&self, parting: usize, a: usize, b: usize) -> f64 {
        let (arm_a, arm_b) = (self.arm(parting, a), self.arm(parting, b));
        let direction = |arm: usize| {
            let tip = if arm == parting { self.kinship.parent(parting) } else { arm };
            self.positions[tip] - self.positions[parting]
        };
        let (u, v) = (direction(arm_a), direction(arm_b));
        let (r_i, r_j) = (self.radius[arm_a], self.radius[arm_b]);
        let (sin, cos) = math::sin_cos(math::atan2((u.x * v.y - u.y * v.x).abs(), u.dot(v)));
        let disc = if cos > 0.0 {
            (r_i * r_i + r_j * r_j + 2.0 * r_i * r_j * cos).sqrt() / sin.max(1e-9)
        } else {
            r_i + r_j
        };
        disc.min(self.branch_length(arm_a)).min(self.branch_length(arm_b))
    }

    /// The child of a node below which an edge lies; the node itself for its own edge and all that is not below it.
    fn arm(&self, node: usize, edge: usize) -> usize {
        let children = self.tree.children(node);
        let nearest =
            children.partition_point(|&child| child <= edge).checked_sub(1).map(|idx| children[idx]);
        nearest.filter(|&child| self.tree.subtree(child).contains(&edge)).unwrap_or(node)
    }

    fn branch_length(&self, node: usize) -> f64 {
        self.branches.of_node(node).map_or(0.0, |branch| {
            let branch = &self.branches.list()[branch];
            self.path[branch.nodes.end - 1] - self.path[branch.hub]
        })
    }
}

/// Whether a < b; `None` if they are too near to each other.
fn is_less(a: f64, b: f64) -> Option<bool> {
    ((a - b).abs() > OPEN * a.abs().max(b.abs())).then_some(a < b)
}
