//! The frozen problem: a tree, its targets and weights as flat arrays, the same for every method.
//!
//! **Input** tree, targets, params. **Output** `Problem`. **Notation** N nodes, M segments (branches), L the
//! tree's length; arrays have one entry per node, that of the root is 0.
//! **Guarantees** with `w_crossing = "auto"` one crossing costs more than any layout without crossings: length
//! ratios are in (−1, 1], angle ratios in [−1, 2], headings at most π off, so E ≤ M (w_l + 4 w_a + w_s + π² w_g), of
//! weights that differ the largest.
//! **Source** [Hu2022] section 3.2.2.
//! **Differs from the source** its largest angle loss is 1, because its layouts never change the side of a turn;
//! baselines do, and shall be scored by the same energy.

use std::f64::consts::PI;

use espalier_geom::math;
use espalier_model::{Branches, Targets, Tree};

use crate::choices::CrossingWeight;
use crate::params::Params;
use crate::ratio;
use crate::weights::Weights;

/// Up to this weight w_g decides between layouts of like angles and no more: one that meets all targets is final.
const TIE_BREAK: f64 = 0.01;

/// A tree with targets and weights.
#[derive(Clone)]
pub(crate) struct Problem<'a> {
    /// The tree.
    pub(crate) tree: &'a Tree,
    /// Its branches: the paper's segments.
    pub(crate) branches: Branches,
    /// What to aim at.
    pub(crate) targets: Targets,
    /// The parent of each node; the root is its own.
    pub(crate) parent: Vec<u32>,
    /// The branch of each node; 0 for the root, which has none.
    pub(crate) branch: Vec<u32>,
    /// |θ − π| of each node.
    pub(crate) bend: Vec<f64>,
    /// −1 where the target turns right, 1 where left.
    pub(crate) side: Vec<f64>,
    /// Whether the angle ratio of each node may be chosen. Not that of the root, which has none, nor one that a
    /// manual edit has pinned: there the target is the pinned turn, at no cost, and the ratio stays 0.
    pub(crate) free_angle: Vec<bool>,
    /// Whether the length ratio of each segment may be chosen. A pinned one stays 0, as above.
    pub(crate) free_length: Vec<bool>,
    /// What r_l² costs: the node's w_l over the number of edges of its branch.
    pub(crate) length_cost: Vec<f64>,
    /// What r_a² costs: the node's w_a over the number of angles of its branch; 0 for children of the root.
    pub(crate) angle_cost: Vec<f64>,
    /// What it costs to turn to the other side, by how far: w_s over the number of angles of the branch; 0 for
    /// children of the root.
    pub(crate) side_cost: Vec<f64>,
    /// What (h − H)² costs: w_g (M/L) conf² l.
    pub(crate) placement_cost: Vec<f64>,
    /// cos H and sin H, each times the placement cost, to find the best rotation.
    pub(crate) placement_cos: Vec<f64>,
    /// As `placement_cos`, of the sine.
    pub(crate) placement_sin: Vec<f64>,
    /// w_X.
    pub(crate) crossing_weight: f64,
    /// w_s.
    pub(crate) w_side: f64,
    /// Whether exact lengths and angles may give way to headings: w_g is more than a tie-break.
    pub(crate) trades_placement: bool,
    /// The typical edge length, in mm: the scale of the swarm's tolerance.
    pub(crate) scale_mm: f64,
    /// Whether nothing that was tried brings the tree near its targets (see `prospect`).
    pub(crate) is_crowded: bool,
}

impl<'a> Problem<'a> {
    pub(crate) fn new(tree: &'a Tree, branches: Branches, targets: Targets, params: &Params) -> Self {
        let n_nodes = tree.n_nodes();
        let parent: Vec<u32> = (0..n_nodes).map(|node| tree.parent(node).unwrap_or(0) as u32).collect();
        let branch = (0..n_nodes).map(|node| branches.of_node(node).unwrap_or(0) as u32).collect();
        let n_segments = branches.list().len() as f64;
        let length_mm = tree.length_mm();

        let weights = Weights::new(tree, &branches, params);
        let mut length_cost = vec![0.0; n_nodes];
        let (mut angle_cost, mut side_cost) = (length_cost.clone(), length_cost.clone());
        for segment in branches.list() {
            let n_angles = segment.nodes.clone().filter(|&node| parent[node] != 0).count();
            for node in segment.nodes.clone() {
                length_cost[node] = weights.length[node] / segment.nodes.len() as f64;
                if parent[node] != 0 {
                    angle_cost[node] = weights.angle[node] / n_angles as f64;
                    side_cost[node] = params.w_side / n_angles as f64;
                }
            }
        }

        let mut placement_cost = vec![0.0; n_nodes];
        let (mut placement_cos, mut placement_sin) = (placement_cost.clone(), placement_cost.clone());
        for node in 1..n_nodes {
            let confidence = targets.confidence[node];
            let cost = params.w_placement * n_segments / length_mm
                * (confidence * confidence * targets.length_mm[node]);
            let (sin, cos) = math::sin_cos(targets.heading_rad[node]);
            placement_cost[node] = cost;
            (placement_cos[node], placement_sin[node]) = (cost * cos, cost * sin);
        }

        let crossing_weight = match params.w_crossing {
            CrossingWeight::Fixed(weight) => weight,
            CrossingWeight::Auto => {
                let (w_length, w_angle) = weights.largest();
                let largest = w_length + 4.0 * w_angle + params.w_side + PI * PI * params.w_placement;
                // A tree without weights still has crossings to avoid.
                1.5 * (n_segments * largest).max(1.0)
            }
        };
        let bend = targets.angle_rad.iter().map(|&angle| zero_if_nan(ratio::target_bend(angle))).collect();
        let side = targets.angle_rad.iter().map(|&angle| ratio::side_sign(angle)).collect();
        let scale_mm = median_length(&targets.length_mm[1..]);
        let free_angle = (0..n_nodes).map(|node| node > 0).collect();
        let free_length = vec![true; branches.list().len()];
        Self {
            tree,
            branches,
            targets,
            parent,
            branch,
            bend,
            side,
            free_angle,
            free_length,
            length_cost,
            angle_cost,
            side_cost,
            placement_cost,
            placement_cos,
            placement_sin,
            crossing_weight,
            w_side: params.w_side,
            trades_placement: params.w_placement > TIE_BREAK,
            scale_mm,
            is_crowded: false,
        }
    }

    /// N.
    pub(crate) fn n_nodes(&self) -> usize {
        self.parent.len()
    }

    /// The size of the problem for budgets: N, but of long chains with few forks only what their branches deserve.
    pub(crate) fn n_joints(&self) -> usize {
        self.n_nodes().min(500 + 20 * self.branches.list().len())
    }

    /// Whether the tree is next to all chain: its turns are too many for its budgets to look at each.
    pub(crate) fn is_thread(&self) -> bool {
        self.n_nodes() > 20 * self.n_joints()
    }

    /// The number of tips below each node, itself if it is one.
    pub(crate) fn n_tips_below(&self) -> Vec<u32> {
        let mut n_tips = vec![0_u32; self.n_nodes()];
        for node in (0..self.n_nodes()).rev() {
            n_tips[node] = n_tips[node].max(1);
            if node > 0 {
                n_tips[self.parent[node] as usize] += n_tips[node];
            }
        }
        n_tips
    }

    /// The children of a node in the counter-clockwise order of their target angles.
    pub(crate) fn children_by_target(&self, node: usize) -> Vec<usize> {
        let mut children = self.tree.children(node).to_vec();
        let angle = &self.targets.angle_rad;
        children.sort_by(|&a, &b| angle[a].total_cmp(&angle[b]).then(a.cmp(&b)));
        children
    }
}

fn zero_if_nan(value: f64) -> f64 {
    if value.is_nan() { 0.0 } else { value }
}

fn median_length(lengths: &[f64]) -> f64 {
    let mut sorted = lengths.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}
