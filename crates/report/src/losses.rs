//! What each node loses in a layout.
//!
//! **Input** a tree with an embedding, or with the positions of any layout. **Output** by node: the loss of its angle
//! against the target, of its length, and of its angle in space.
//! **Source** Metric 1 and Metric 2, section 5.1.1 of [Hu2022]; angles in degrees.

use espalier_geom::angle;
use espalier_model::{Embedding, Tree};
use glam::DVec2;

/// |θ − θ_e| of each node in degrees, 0 to 180; 0 where there is no angle.
pub(crate) fn angle_deg(tree: &Tree, embedding: &Embedding) -> Vec<f64> {
    let at = |node: usize| embedding.positions_mm[node];
    let loss = |node: usize| {
        let (parent, grandparent) = tree.parent(node).and_then(|p| Some((p, tree.parent(p)?)))?;
        let drawn = angle::ccw(at(grandparent) - at(parent), at(node) - at(parent));
        // A reflection of the whole turns every angle round.
        let drawn = if embedding.pose.is_reflected { std::f64::consts::TAU - drawn } else { drawn };
        Some(angle::wrap(drawn - embedding.targets.angle_rad[node]).abs().to_degrees())
    };
    (0..tree.n_nodes()).map(|node| loss(node).unwrap_or(0.0)).collect()
}

/// |l − l_e| / l of each edge; 0 at the root, and below the rounding of coordinates.
pub(crate) fn length_share(tree: &Tree, embedding: &Embedding) -> Vec<f64> {
    let loss = |node: usize| {
        let (parent, target) = (tree.parent(node)?, embedding.targets.length_mm[node]);
        let lost = (embedding.positions_mm[node].distance(embedding.positions_mm[parent]) - target).abs();
        (target > 0.0 && lost > 2.0 * embedding.quantum_mm).then(|| lost / target)
    };
    (0..tree.n_nodes()).map(|node| loss(node).unwrap_or(0.0)).collect()
}

/// |φ − φ_e| of each node in degrees: the angle at its parent in space against that in the plane.
pub(crate) fn angle3d_deg(tree: &Tree, positions_mm: &[DVec2]) -> Vec<f64> {
    let error = |node: usize| {
        let (parent, grandparent) = tree.parent(node).and_then(|p| Some((p, tree.parent(p)?)))?;
        let space = |node: usize| tree.position_mm(node) - tree.position_mm(parent);
        let plane = |node: usize| (positions_mm[node] - positions_mm[parent]).extend(0.0);
        let [in_space, in_plane] = [
            angle::between(space(grandparent), space(node)),
            angle::between(plane(grandparent), plane(node)),
        ];
        Some((in_space - in_plane).abs().to_degrees()).filter(|error| error.is_finite())
    };
    (0..tree.n_nodes()).map(|node| error(node).unwrap_or(0.0)).collect()
}
