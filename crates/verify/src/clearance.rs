//! The clearance that a layout keeps.
//!
//! **Input** the tree, target lengths, positions. **Output** the least and the largest value that rounding allows.
//! **Definition** the least distance of two edges without a common node that are nearer to each other than a fifth of
//! the path along the tree, in target lengths, between their near ends; no more than the median edge.
//! **Steps** each edge asks a tree of boxes for later edges nearer than the least distance so far. Done twice, with a
//! hair more and a hair less than a fifth. **Cost** about O(N log N).

use espalier_geom::plane::{Segment, segment_distance};
use espalier_model::{Targets, Tree};
use glam::DVec2;

use crate::boxes::{Box2, Boxes};
use crate::kinship::Kinship;

/// Edges nearer than this share of the path between them are too near.
const SHARE: f64 = 0.2;
/// By how much rounding may move a comparison.
const HAIR: f64 = 1e-9;

/// The clearance in mm, least and largest, and the median edge.
pub(crate) fn clearance_mm(tree: &Tree, targets: &Targets, positions: &[DVec2]) -> ((f64, f64), f64) {
    let mut sorted = targets.length_mm[1..].to_vec();
    sorted.sort_by(f64::total_cmp);
    let median_mm = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    let mut path_mm = vec![0.0; tree.n_nodes()];
    for (node, parent) in tree.edges() {
        path_mm[node] = path_mm[parent] + targets.length_mm[node];
    }
    let search = Search { kinship: Kinship::new(tree), positions, path_mm };
    let [most, least] = [1.0 - HAIR, 1.0 + HAIR].map(|hair| search.least_mm(median_mm, SHARE * hair));
    ((least, most), median_mm)
}

struct Search<'a> {
    kinship: Kinship<'a>,
    positions: &'a [DVec2],
    path_mm: Vec<f64>,
}

impl Search<'_> {
    fn segment(&self, edge: usize) -> Segment {
        Segment { a: self.positions[self.kinship.parent(edge)], b: self.positions[edge] }
    }

    fn bounds(&self, edge: usize, margin_mm: f64) -> Box2 {
        let Segment { a, b } = self.segment(edge);
        Box2::around(a, b, margin_mm)
    }

    fn least_mm(&self, median_mm: f64, share: f64) -> f64 {
        let n_nodes = self.positions.len();
        let mut boxes = Boxes::new(n_nodes, |edge| self.bounds(edge, 0.0));
        let (mut least_mm, mut later) = (median_mm, Vec::new());
        for a in 1..n_nodes {
            boxes.later_meeting(a, &self.bounds(a, least_mm), &mut later);
            for &b in later.iter().filter(|&&b| !self.kinship.are_neighbours(a, b)) {
                let distance_mm = segment_distance(&self.segment(a), &self.segment(b));
                let (near_a, near_b, parting) = self.kinship.near_ends(a, b);
                let gap_mm = self.path_mm[near_a] + self.path_mm[near_b] - 2.0 * self.path_mm[parting];
                if distance_mm < share * gap_mm {
                    least_mm = least_mm.min(distance_mm);
                }
            }
        }
        least_mm
    }
}
