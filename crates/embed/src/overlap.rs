//! Overlaps: where the drawn tubes, not only their centrelines, run into each other.
//!
//! **Input** positions and radii. **Output** the number of pairs of edges that overlap.
//! **Definition** an edge is drawn as a capsule of its mean radius. Two edges overlap if they have no node in
//! common, their capsules do (distance < r_e + r_f), and this is not the plain thickness of the organ about the
//! place where they part: the path along the tree between their near ends is longer than r_e + r_f, and longer
//! than twice the junction disc at the node where they part.
//! **Junction disc** for tubes r_i, r_j that part at the gap g: radius √(r_i² + r_j² + 2 r_i r_j cos g) / sin g
//! for g ≤ 90°, r_i + r_j above, but never more than the shorter of the two branches: edges are often shorter
//! than the organ is thick.
//! **Steps** 1. Sweep over boxes grown by the radius. 2. Distance of centrelines. 3. Lowest common ancestor by a
//! sparse table over the preorder. 4. Path and disc.
//! **Guarantees** exact up to 20 million pairs whose boxes meet, a lower bound beyond.
//! **Cost** O(N log N + boxes that meet).

use espalier_geom::math;
use espalier_geom::plane::{Segment, segment_distance};
use glam::DVec2;

use crate::paths::Ancestors;
use crate::problem::Problem;

/// The most pairs that are looked at: a tree whose radii are in another unit than its positions has billions.
const MOST_PAIRS: u64 = 20_000_000;

/// What was found.
pub(crate) struct Overlaps {
    /// The number of overlapping pairs of edges.
    pub(crate) count: usize,
    /// Whether all pairs were looked at; if not, the count is a lower bound.
    pub(crate) is_complete: bool,
}

/// Counts the overlapping pairs of edges.
pub(crate) fn count(problem: &Problem, positions: &[DVec2]) -> Overlaps {
    let tubes = Tubes::new(problem, positions);
    let mut order: Vec<usize> = (1..positions.len()).collect();
    order.sort_by(|&a, &b| tubes.low[a].x.total_cmp(&tubes.low[b].x).then(a.cmp(&b)));
    let (mut count, mut n_pairs) = (0, 0_u64);
    for (place, &a) in order.iter().enumerate() {
        for &b in order[place + 1..].iter().take_while(|&&b| tubes.low[b].x <= tubes.high[a].x) {
            if tubes.low[b].y > tubes.high[a].y || tubes.low[a].y > tubes.high[b].y {
                continue;
            }
            n_pairs += 1;
            if n_pairs > MOST_PAIRS {
                return Overlaps { count, is_complete: false };
            }
            count += usize::from(tubes.overlap(a.min(b), a.max(b)));
        }
    }
    Overlaps { count, is_complete: true }
}

struct Tubes<'a> {
    problem: &'a Problem<'a>,
    positions: &'a [DVec2],
    radius: Vec<f64>,
    low: Vec<DVec2>,
    high: Vec<DVec2>,
    /// Path from the root to each node.
    path: Vec<f64>,
    ancestors: Ancestors,
}

impl<'a> Tubes<'a> {
    fn new(problem: &'a Problem, positions: &'a [DVec2]) -> Self {
        let n_nodes = positions.len();
        let nodes = problem.tree.nodes();
        let (mut radius, mut path) = (vec![0.0; n_nodes], vec![0.0; n_nodes]);
        let (mut low, mut high) = (vec![DVec2::ZERO; n_nodes], vec![DVec2::ZERO; n_nodes]);
        for node in 1..n_nodes {
            let parent = problem.parent[node] as usize;
            radius[node] = 0.5 * (nodes[node].radius_mm + nodes[parent].radius_mm);
            path[node] = path[parent] + positions[node].distance(positions[parent]);
            low[node] = positions[node].min(positions[parent]) - radius[node];
            high[node] = positions[node].max(positions[parent]) + radius[node];
        }
        Self { problem, positions, radius, low, high, path, ancestors: Ancestors::new(&problem.parent) }
    }

    fn segment(&self, node: usize) -> Segment {
        Segment { a: self.positions[self.problem.parent[node] as usize], b: self.positions[node] }
    }

    /// Whether edges a < b overlap as defined above.
    fn overlap(&self, a: usize, b: usize) -> bool {
        let (parent_a, parent_b) = (self.problem.parent[a] as usize, self.problem.parent[b] as usize);
        if parent_b == a || parent_a == parent_b {
            return false;
        }
        let reach = self.radius[a] + self.radius[b];
        if segment_distance(&self.segment(a), &self.segment(b)) >= reach {
            return false;
        }
        let is_below = self.problem.tree.subtree(a).contains(&b);
        let parting = if is_below { a } else { self.ancestors.lowest_common(parent_a, parent_b) };
        let near_a = if is_below { self.path[a] } else { self.path[parent_a] };
        let between = (near_a - self.path[parting]) + (self.path[parent_b] - self.path[parting]);
        between > reach && between > 2.0 * self.junction_disc(parting, a, b)
    }

    /// The length in the plane of the branch to which a node belongs; that of the root, which has none, is 0.
    fn branch_length(&self, node: usize) -> f64 {
        let branches = &self.problem.branches;
        branches.of_node(node).map_or(0.0, |branch| {
            let branch = &branches.list()[branch];
            self.path[branch.end()] - self.path[branch.hub]
        })
    }

    /// The radius of the disc about `parting` inside which the tubes towards `a` and `b` overlap anyway.
    fn junction_disc(&self, parting: usize, a: usize, b: usize) -> f64 {
        let towards = |node: usize| {
            let children = self.problem.tree.children(parting);
            let first_after = children.partition_point(|&child| child <= node);
            if self.problem.tree.subtree(parting).contains(&node) && node != parting {
                children[first_after - 1]
            } else {
                parting
            }
        };
        let (arm_a, arm_b) = (towards(a), towards(b));
        let tip = |arm: usize| if arm == parting { self.problem.parent[arm] as usize } else { arm };
        let (to_a, to_b) = (
            self.positions[tip(arm_a)] - self.positions[parting],
            self.positions[tip(arm_b)] - self.positions[parting],
        );
        let (r_a, r_b) = (self.radius[arm_a], self.radius[arm_b]);
        let gap = math::atan2(to_a.perp_dot(to_b).abs(), to_a.dot(to_b));
        let disc = if gap < std::f64::consts::FRAC_PI_2 {
            let (sin, cos) = math::sin_cos(gap);
            (r_a * r_a + r_b * r_b + 2.0 * r_a * r_b * cos).sqrt() / sin.max(1e-9)
        } else {
            r_a + r_b
        };
        disc.min(self.branch_length(arm_a)).min(self.branch_length(arm_b))
    }
}
