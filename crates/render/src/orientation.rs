//! Which way the map lies in the body, and where it does not.
//!
//! **Input** a tree and where its nodes lie in a flat picture. **Output** the directions in space that fit the picture's
//! right and up best, and by how many degrees each edge runs otherwise.
//! **Notation** d the direction of an edge in space, e in the picture, l its length in space; M = Σ l d eᵀ, 3 × 2.
//! **Steps** 1. The orthonormal 3 × 2 matrix R nearest to M, its polar factor M (MᵀM)^(−½), has the largest sum of
//! l · cos∠(d, R e): its columns are right and up. 2. An edge's loss is ∠(d, R e).
//! **Guarantees** a straight tree, or one whose edges cancel out, has no such directions: it says so.
//! **Source** orthogonal Procrustes problem; for 2 × 2 matrices √A = (A + √det A · I) / √(tr A + 2 √det A).
//! **Cost** O(nodes).

use espalier_geom::math;
use espalier_model::Tree;
use glam::{DVec2, DVec3};

use crate::scene::Scene;

/// det MᵀM over (tr MᵀM)² below which one direction is not determined.
const FLAT: f64 = 1e-4;

/// How a flat picture lies in space.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Orientation {
    /// What points to the right and up, unit vectors in RAS+; `None` if the tree does not tell.
    pub axes: Option<[DVec3; 2]>,
    /// By node: the loss of the edge to its parent in degrees, 0 to 180; 0 where it has no direction.
    pub loss_deg: Vec<f64>,
    /// The mean loss over the length, degrees.
    pub mean_loss_deg: f64,
}

impl Orientation {
    /// The orientation of a scene that is flat.
    pub(crate) fn of(tree: &Tree, scene: &Scene) -> Self {
        let axes = axes(tree, scene);
        let mut loss_deg = vec![0.0; tree.n_nodes()];
        let (mut lost, mut length_mm) = (0.0, 0.0);
        if let Some([right, up]) = axes {
            for (node, _) in tree.edges() {
                let Some((space, map)) = directions(tree, scene, node) else { continue };
                let cosine = space.dot(map.x * right + map.y * up).clamp(-1.0, 1.0);
                loss_deg[node] = math::acos(cosine).to_degrees();
                lost += tree.edge_length_mm(node) * loss_deg[node];
                length_mm += tree.edge_length_mm(node);
            }
        }
        let mean_loss_deg = if length_mm > 0.0 { lost / length_mm } else { 0.0 };
        Self { axes, loss_deg, mean_loss_deg }
    }
}

fn axes(tree: &Tree, scene: &Scene) -> Option<[DVec3; 2]> {
    let (mut x, mut y) = (DVec3::ZERO, DVec3::ZERO);
    for (node, _) in tree.edges() {
        if let Some((space, map)) = directions(tree, scene, node) {
            x += tree.edge_length_mm(node) * map.x * space;
            y += tree.edge_length_mm(node) * map.y * space;
        }
    }
    // Scaled, so that squares of tiny and of huge trees can be taken.
    let scale = x.abs().max_element().max(y.abs().max_element());
    let (x, y) = (x / scale, y / scale);
    let (a, b, c) = (x.length_squared(), x.dot(y), y.length_squared());
    let (trace, det) = (a + c, a * c - b * b);
    if !(trace > 0.0 && det > FLAT * trace * trace) {
        return None;
    }
    // The inverse of √A is, up to a factor, the adjugate of A + √det A · I.
    let root = det.sqrt();
    let right = (c + root) * x - b * y;
    let up = (a + root) * y - b * x;
    Some([right.normalize(), up.normalize()])
}

/// The unit directions of a node's edge, in space and in the picture, if it has both.
fn directions(tree: &Tree, scene: &Scene, node: usize) -> Option<(DVec3, DVec2)> {
    let parent = tree.parent(node)?;
    let space = (tree.position_mm(node) - tree.position_mm(parent)).try_normalize()?;
    let map = (scene.points_mm[node] - scene.points_mm[parent]).truncate().try_normalize()?;
    Some((space, map))
}

#[cfg(test)]
mod tests {
    use espalier_model::Node;

    use super::*;

    /// A stem down, arms right and left, and one arm that the map draws to the right although it points at the viewer.
    fn cross(scale: f64) -> (Tree, Scene) {
        let node = |x: f64, y: f64, z: f64, parent| Node {
            position_mm: scale * DVec3::new(x, y, z),
            radius_mm: scale,
            parent,
            kind: 0,
        };
        let tree = Tree::new(&[
            node(0.0, 0.0, 0.0, None),
            node(0.0, 0.0, -10.0, Some(0)),
            node(10.0, 0.0, -10.0, Some(1)),
            node(-10.0, 0.0, -10.0, Some(1)),
            node(0.0, 0.0, -20.0, Some(1)),
            node(0.0, 2.0, -20.0, Some(4)),
        ])
        .expect("a tree");
        // As seen from the front: the patient's right is on the left.
        let mut points: Vec<DVec3> =
            tree.nodes().iter().map(|n| DVec3::new(-n.position_mm.x, n.position_mm.z, 0.0)).collect();
        points[5] = points[4] + scale * DVec3::X;
        (tree, Scene { points_mm: points, radii_mm: vec![scale; 6], turn_deg: 0 })
    }

    #[test]
    fn the_axes_are_those_of_most_edges() {
        for scale in [1e-12, 1.0, 1e9] {
            let (tree, scene) = cross(scale);
            let found = Orientation::of(&tree, &scene);
            let [right, up] = found.axes.expect("axes");
            assert!(right.dot(DVec3::NEG_X) > 0.99 && up.dot(DVec3::Z) > 0.99, "{right} {up}");
            assert!(right.dot(up).abs() < 1e-9);
            assert!(found.loss_deg[..5].iter().all(|&loss| loss < 8.0), "{:?}", found.loss_deg);
            assert!((found.loss_deg[5] - 90.0).abs() < 8.0, "{:?}", found.loss_deg);
            assert!(found.mean_loss_deg < 12.0);
        }
    }

    #[test]
    fn what_has_no_sides_has_no_axes() {
        let node = |z: f64, parent| Node { position_mm: DVec3::Z * z, radius_mm: 1.0, parent, kind: 0 };
        let tree = Tree::new(&[node(0.0, None), node(-1.0, Some(0)), node(-2.0, Some(1))]).expect("a tree");
        let points_mm = tree.nodes().iter().map(|n| DVec3::new(0.0, n.position_mm.z, 0.0)).collect();
        let found = Orientation::of(&tree, &Scene { points_mm, radii_mm: vec![1.0; 3], turn_deg: 0 });
        assert_eq!((found.axes, found.loss_deg), (None, vec![0.0; 3]));
    }
}
