//! How far apart two places of the tree are along the tree.
//!
//! **Input** the branches and the drawn arc length at each node. **Output** the length of the path between two places,
//! up to a limit.
//! **Steps** climb from the branch that stands later in preorder to its hub, adding up lengths, until both places
//! are on one branch or the limit is passed.
//! **Guarantees** at most [`MAX_CLIMB`] steps; beyond that the places count as far apart.
//! **Cost** O(branches on the path).

use espalier_model::{Branches, Tree};

use crate::scene::Scene;

/// Branches shorter than a pixel by the hundred are no junction that a picture could show.
const MAX_CLIMB: usize = 48;
/// The branch of the root.
const ROOT: u32 = u32::MAX;

/// Arc lengths and branch ancestry, in pixels.
#[derive(Clone, Debug)]
pub(crate) struct Kinship {
    /// By node: the drawn length of the path from the root.
    pub arc_px: Vec<f32>,
    /// By node: its branch.
    branch_of: Vec<u32>,
    /// By branch: the branch it hangs from, and the arc at its hub.
    above: Vec<(u32, f32)>,
}

impl Kinship {
    /// The kinship of a tree drawn at `px_per_mm`.
    pub(crate) fn new(tree: &Tree, branches: &Branches, scene: &Scene, px_per_mm: f64) -> Self {
        let mut arc = vec![0.0_f64; tree.n_nodes()];
        for (node, parent) in tree.edges() {
            arc[node] = arc[parent] + px_per_mm * scene.points_mm[node].distance(scene.points_mm[parent]);
        }
        let index = |branch: Option<usize>| branch.map_or(ROOT, |branch| branch as u32);
        Self {
            branch_of: (0..tree.n_nodes()).map(|node| index(branches.of_node(node))).collect(),
            above: branches.list().iter().map(|b| (index(b.parent), arc[b.hub] as f32)).collect(),
            arc_px: arc.into_iter().map(|arc| arc as f32).collect(),
        }
    }

    /// The branch of the edge above a node.
    pub(crate) fn branch_of(&self, node: u32) -> u32 {
        self.branch_of[node as usize]
    }

    /// The length of the path between two places, each on the edge above a node at an arc length; infinite if it is
    /// over `limit_px`.
    pub(crate) fn path_px(
        &self,
        (node_a, arc_a): (u32, f32),
        (node_b, arc_b): (u32, f32),
        limit_px: f32,
    ) -> f32 {
        let mut a = (self.branch_of[node_a as usize], arc_a);
        let mut b = (self.branch_of[node_b as usize], arc_b);
        let mut path = 0.0;
        for _ in 0..MAX_CLIMB {
            if a.0 == b.0 {
                path += (a.1 - b.1).abs();
                return if path <= limit_px { path } else { f32::INFINITY };
            }
            // In preorder the later branch cannot be an ancestor of the earlier; ROOT is everybody's.
            let a_is_deeper = b.0 == ROOT || (a.0 != ROOT && a.0 > b.0);
            let deeper = if a_is_deeper { &mut a } else { &mut b };
            let (parent, hub_arc) = self.above[deeper.0 as usize];
            path += deeper.1 - hub_arc;
            *deeper = (parent, hub_arc);
            if path > limit_px {
                return f32::INFINITY;
            }
        }
        f32::INFINITY
    }
}

#[cfg(test)]
mod tests {
    use espalier_model::Node;
    use glam::DVec3;

    use super::*;

    #[test]
    fn paths_go_over_the_fork_that_both_places_hang_from() {
        let node = |x: f64, y: f64, parent| Node {
            position_mm: DVec3::new(x, y, 0.0),
            radius_mm: 1.0,
            parent,
            kind: 0,
        };
        // Two arms of length 10 with a stem of length 5; each arm forks at its end.
        let tree = Tree::new(&[
            node(0.0, 0.0, None),
            node(0.0, -5.0, Some(0)),
            node(-10.0, -5.0, Some(1)),
            node(-12.0, -5.0, Some(2)),
            node(-10.0, -7.0, Some(2)),
            node(10.0, -5.0, Some(1)),
            node(12.0, -5.0, Some(5)),
            node(10.0, -7.0, Some(5)),
        ])
        .expect("a tree");
        let scene = Scene {
            points_mm: tree.nodes().iter().map(|node| node.position_mm).collect(),
            radii_mm: vec![1.0; 8],
            turn_deg: 0,
        };
        let kinship = Kinship::new(&tree, &tree.branches(), &scene, 2.0);
        let end = |node: u32| (node, kinship.arc_px[node as usize]);
        for (a, b, path_px) in [(3, 4, 8.0), (3, 6, 48.0), (1, 7, 24.0), (2, 3, 4.0), (5, 5, 0.0)] {
            for (a, b) in [(a, b), (b, a)] {
                assert_eq!(kinship.path_px(end(a), end(b), path_px + 0.01), path_px, "{a} {b}");
                assert_eq!(kinship.path_px(end(a), end(b), path_px - 0.01), f32::INFINITY, "{a} {b}");
            }
        }
    }
}
