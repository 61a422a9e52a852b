//! What can be measured in a layout: lengths and angles straight from positions.
//!
//! **Input** a tree and positions, in the handedness of the targets. **Output** `Flat`.
//! **Notation** v a node, p its parent, g its grandparent; θ_e the counter-clockwise angle from p → g to p → v, in
//! [0, 2π), π = straight on. **Guarantees** no angle is summed up from node to node: each is that of three points,
//! unless an edge has no length, which goes on like its parent's.
//! **Source** [Hu2022] section 3.2.1. **Cost** O(N).

use std::f64::consts::TAU;

use espalier_geom::math;
use espalier_model::Tree;
use glam::{DVec2, DVec3};

/// Lengths and angles of a layout by node.
pub(crate) struct Flat {
    /// l_e in mm; 0 for the root.
    pub(crate) length_mm: Vec<f64>,
    /// θ_e in radians; `None` for the root and its children.
    pub(crate) angle_rad: Vec<Option<f64>>,
    /// The direction of each edge, of length 1; that of an edge without length is its parent's.
    pub(crate) direction: Vec<DVec2>,
}

impl Flat {
    /// Measures a layout.
    pub(crate) fn new(tree: &Tree, positions: &[DVec2]) -> Self {
        let n_nodes = tree.n_nodes();
        let mut flat = Self {
            length_mm: vec![0.0; n_nodes],
            angle_rad: vec![None; n_nodes],
            direction: vec![DVec2::X; n_nodes],
        };
        for (node, parent) in tree.edges() {
            let ahead = positions[node] - positions[parent];
            let length_mm = math::hypot(ahead.x, ahead.y);
            flat.length_mm[node] = length_mm;
            flat.direction[node] = if length_mm > 0.0 { ahead / length_mm } else { flat.direction[parent] };
            if parent != 0 {
                let angle = counter_clockwise(-flat.direction[parent], flat.direction[node]);
                flat.angle_rad[node] = Some(angle);
            }
        }
        flat
    }
}

/// The counter-clockwise angle between two vectors, in [0, 2π).
fn counter_clockwise(from: DVec2, to: DVec2) -> f64 {
    let angle = math::atan2(from.x * to.y - from.y * to.x, from.x * to.x + from.y * to.y);
    if angle < 0.0 { (angle + TAU).min(TAU.next_down()) } else { angle }
}

/// The angle between two vectors in space, in [0, π].
pub(crate) fn angle_between(a: DVec3, b: DVec3) -> f64 {
    // Kahan's: as accurate near 0 and π as in the middle.
    let (a, b) = (a / a.length(), b / b.length());
    2.0 * math::atan2((a - b).length(), (a + b).length())
}

/// The interior angle of a node in space: between its parent's edge and its own, π = straight; `None` for the root
/// and its children.
pub(crate) fn interior_angle(tree: &Tree, node: usize) -> Option<f64> {
    let parent = tree.parent(node)?;
    let hub = tree.position_mm(parent);
    let back = tree.position_mm(tree.parent(parent)?) - hub;
    Some(angle_between(back, tree.position_mm(node) - hub))
}

/// The mirror image of a layout.
pub(crate) fn mirrored(positions: &[DVec2]) -> Vec<DVec2> {
    positions.iter().map(|p| DVec2::new(-p.x, p.y)).collect()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn angles_have_their_size_and_side() {
        for degrees in 0..360 {
            let angle = f64::from(degrees) * PI / 180.0;
            for turn in 0..8 {
                let turn = f64::from(turn);
                let (from, to) = (math::unit_vector(turn), 3.0 * math::unit_vector(turn + angle));
                let off = (counter_clockwise(from, to) - angle).abs();
                assert!(off < 1e-14 || (off - TAU).abs() < 1e-14, "{degrees}");
            }
        }
        let tiny = angle_between(DVec3::new(1.0, 1e-9, 0.0), DVec3::X * 7.0);
        assert!((tiny - 1e-9).abs() < 1e-20);
        assert_eq!(angle_between(DVec3::X, -2.0 * DVec3::X), PI);
    }
}
