//! From the mask's surface to the wall that the scan shows.
//!
//! **Input** the dense nodes of a tree, whose radii are the mask's; the spheres, each with how far beyond the mask the wall
//! lies. **Output** the nodes with radii that reach to the wall.
//! **Why last?** Spurs, tips and forks are judged against the mask, so by its own radii.
//! **Cost** O(nodes · log spheres).

use espalier_model::{InscribedSpheres, Node};

use crate::graph::Sample;
use crate::nearest::NearestSphere;

/// What is left of a radius at least, where the wall lies inside the mask: a wall of a wider place beside it may be the
/// nearest.
const LEAST_SHARE: f64 = 0.5;

/// Adds to each node's radius what the nearest sphere has beyond the mask.
pub(crate) fn widen(nodes: &mut [Node], spheres: &InscribedSpheres) {
    if spheres.0.iter().all(|sphere| sphere.wall_mm == 0.0) {
        return;
    }
    let point = |position_mm| Sample { position_mm, radius_mm: 0.0 };
    let centers = NearestSphere::of(spheres.0.iter().map(|sphere| point(sphere.center_mm)));
    for node in nodes {
        if let Some((nearest, _)) = centers.look(point(node.position_mm), f64::INFINITY) {
            node.radius_mm = (node.radius_mm + spheres.0[nearest].wall_mm).max(LEAST_SHARE * node.radius_mm);
        }
    }
}
