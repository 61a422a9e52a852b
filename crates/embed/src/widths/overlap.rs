//! Overlaps: where the drawn tubes, not only their centrelines, run into each other.
//!
//! **Input** positions and radii. **Output** the pairs of edges that overlap.
//! **Definition** an edge is drawn as a capsule of its mean radius. Two edges overlap if they have no node in
//! common, their capsules do (distance < r_e + r_f), and this is not the plain thickness of the organ about the
//! place where they part: the path along the tree between their near ends is longer than r_e + r_f, and longer
//! than twice the junction disc at the node where they part.
//! **Junction disc** for tubes r_i, r_j that part at the gap g: radius √(r_i² + r_j² + 2 r_i r_j cos g) / sin g
//! for g ≤ 90°, r_i + r_j above, but never more than the shorter of the two branches: edges are often shorter
//! than the organ is thick.
//! **Steps** 1. Pairs whose boxes, grown by the radius, meet. 2. Distance of centrelines. 3. Lowest common ancestor by a
//! sparse table over the preorder. 4. Path and disc.
//! **Guarantees** exact up to 20 million pairs whose boxes meet, of which a million may meet; a lower bound beyond.
//! **Cost** O(N log N + boxes that meet), see `boxes`.

use std::f64::consts::FRAC_PI_2;

use espalier_geom::math;
use espalier_geom::plane::{Segment, segment_distance};
use glam::DVec2;

use crate::boxes::{self, EdgeBox};
use crate::paths::Ancestors;
use crate::problem::Problem;
use crate::separation::are_apart;

/// The most pairs that are looked at, and of those that meet: a tree whose radii are in another unit than its positions
/// has billions, and the projection of a bushy one has millions.
const MOST_PAIRS: u64 = 20_000_000;
const MOST_MEETINGS: u64 = 1_000_000;

/// Two edges whose capsules meet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Meeting {
    /// Their distance, in mm.
    pub(super) distance_mm: f64,
    /// The sum of their radii.
    pub(super) reach_mm: f64,
    /// The path along the tree between their near ends.
    pub(super) between_mm: f64,
    /// The junction disc where they part, as the gap makes it.
    pub(super) disc_mm: f64,
    /// The shorter of the two branches there.
    pub(super) branch_mm: f64,
}

impl Meeting {
    /// Whether they overlap as defined above.
    pub(super) fn is_overlap(&self) -> bool {
        self.between_mm > self.reach_mm && self.between_mm > 2.0 * self.disc_mm.min(self.branch_mm)
    }
}

/// Visits the pairs of edges without a common node whose capsules meet; false if there were too many to look at all.
pub(super) fn each_meeting(problem: &Problem, positions: &[DVec2], mut visit: impl FnMut(&Meeting)) -> bool {
    let tubes = Tubes::new(problem, positions);
    let (mut n_pairs, mut n_meetings) = (0, 0);
    let tube_box = |node: usize| {
        let (Segment { a, b }, parent) = (tubes.segment(node), problem.parent[node] as usize);
        EdgeBox::around((a, b), tubes.radius[node], (node, parent))
    };
    boxes::each_meeting((1..positions.len()).map(tube_box).collect(), |a, b| {
        n_pairs += 1;
        if let Some(meeting) = tubes.meeting(a, b) {
            n_meetings += 1;
            visit(&meeting);
        }
        n_pairs < MOST_PAIRS && n_meetings < MOST_MEETINGS
    })
}

/// The tubes of a layout.
pub(super) struct Tubes<'a> {
    problem: &'a Problem<'a>,
    positions: &'a [DVec2],
    radius: Vec<f64>,
    /// Path from the root to each node.
    path: Vec<f64>,
    ancestors: Ancestors,
}

impl<'a> Tubes<'a> {
    pub(super) fn new(problem: &'a Problem, positions: &'a [DVec2]) -> Self {
        let n_nodes = positions.len();
        let nodes = problem.tree.nodes();
        let (mut radius, mut path) = (vec![0.0; n_nodes], vec![0.0; n_nodes]);
        for node in 1..n_nodes {
            let parent = problem.parent[node] as usize;
            radius[node] = 0.5 * (nodes[node].radius_mm + nodes[parent].radius_mm);
            path[node] = path[parent] + positions[node].distance(positions[parent]);
        }
        Self { problem, positions, radius, path, ancestors: Ancestors::new(&problem.parent) }
    }

    fn segment(&self, node: usize) -> Segment {
        Segment { a: self.positions[self.problem.parent[node] as usize], b: self.positions[node] }
    }

    /// Half the width of an edge.
    pub(super) fn radius_mm(&self, edge: usize) -> f64 {
        self.radius[edge]
    }

    /// Edges a < b, if they have no common node and their capsules meet.
    fn meeting(&self, a: usize, b: usize) -> Option<Meeting> {
        let (parent_a, parent_b) = (self.problem.parent[a] as usize, self.problem.parent[b] as usize);
        if parent_b == a || parent_a == parent_b {
            return None;
        }
        let (s, t, reach_mm) = (self.segment(a), self.segment(b), self.radius[a] + self.radius[b]);
        if are_apart(&s, &t, reach_mm) {
            return None;
        }
        let distance_mm = segment_distance(&s, &t);
        (distance_mm < reach_mm).then(|| self.relation(a, b, distance_mm))
    }

    /// What the tree says of edges a < b without a common node.
    fn relation(&self, a: usize, b: usize, distance_mm: f64) -> Meeting {
        let (parent_a, parent_b) = (self.problem.parent[a] as usize, self.problem.parent[b] as usize);
        let is_below = self.problem.tree.subtree(a).contains(&b);
        let parting = if is_below { a } else { self.ancestors.lowest_common(parent_a, parent_b) };
        let near_a = if is_below { self.path[a] } else { self.path[parent_a] };
        let between_mm = (near_a - self.path[parting]) + (self.path[parent_b] - self.path[parting]);
        let (disc_mm, branch_mm) = self.junction_disc(parting, a, b);
        Meeting { distance_mm, reach_mm: self.radius[a] + self.radius[b], between_mm, disc_mm, branch_mm }
    }

    /// Whether edges a < b may not overlap, being far enough from where they part.
    pub(super) fn must_part(&self, a: usize, b: usize) -> bool {
        self.relation(a, b, 0.0).is_overlap()
    }

    /// The length in the plane of the branch to which a node belongs; that of the root, which has none, is 0.
    fn branch_length(&self, node: usize) -> f64 {
        let branches = &self.problem.branches;
        branches.of_node(node).map_or(0.0, |branch| {
            let branch = &branches.list()[branch];
            self.path[branch.end()] - self.path[branch.hub]
        })
    }

    /// The radius of the disc about `parting` inside which the tubes towards `a` and `b` overlap anyway, and the
    /// length of the shorter branch, which it does not exceed.
    fn junction_disc(&self, parting: usize, a: usize, b: usize) -> (f64, f64) {
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
        (disc_radius(gap, r_a, r_b), self.branch_length(arm_a).min(self.branch_length(arm_b)))
    }
}

/// How far from a fork tubes at the gap `gap_rad` run into each other.
pub(super) fn disc_radius(gap_rad: f64, r_a: f64, r_b: f64) -> f64 {
    if gap_rad < FRAC_PI_2 {
        let (sin, cos) = math::sin_cos(gap_rad);
        (r_a * r_a + r_b * r_b + 2.0 * r_a * r_b * cos).sqrt() / sin.max(1e-9)
    } else {
        r_a + r_b
    }
}
