//! The area-equivalent radius at each node: that of the nearest skeleton voxel's cross-section.
//!
//! **Input** tree, inscribed spheres. **Output** a radius in mm for each node, `NaN` where no sphere with a cross-section
//! has its centre inside of the node's own sphere.
//! **Steps** 1. Sort the spheres along the tree's longest axis. 2. For each node go through those within its radius.
//! **Guarantees** ties go to the lower index. **Cost** O((N + S) log S + N w), w the spheres within a radius along the
//! axis.

use espalier_model::{InscribedSpheres, Sphere, Tree};
use glam::DVec3;

pub(super) fn radii_mm(tree: &Tree, spheres: Option<&InscribedSpheres>) -> Vec<f64> {
    let known = |sphere: &&Sphere| sphere.area_radius_mm.is_finite();
    let mut sorted: Vec<&Sphere> =
        spheres.map_or(&[][..], |spheres| &spheres.0).iter().filter(known).collect();
    let axis = longest_axis(&sorted);
    sorted.sort_by(|a, b| a.center_mm[axis].total_cmp(&b.center_mm[axis]));
    let area_at = |(point_mm, radius_mm): (DVec3, f64)| {
        let first = sorted.partition_point(|sphere| sphere.center_mm[axis] < point_mm[axis] - radius_mm);
        let near =
            sorted[first..].iter().take_while(|sphere| sphere.center_mm[axis] <= point_mm[axis] + radius_mm);
        let distance = |sphere: &Sphere| sphere.center_mm.distance(point_mm);
        let nearest = near.min_by(|a, b| distance(a).total_cmp(&distance(b)));
        nearest
            .filter(|sphere| distance(sphere) <= radius_mm)
            .map_or(f64::NAN, |sphere| (sphere.area_radius_mm + sphere.wall_mm).max(0.0))
    };
    tree.nodes().iter().map(|node| area_at((node.position_mm, node.radius_mm))).collect()
}

/// The axis along which the centres spread most.
fn longest_axis(spheres: &[&Sphere]) -> usize {
    let centers = || spheres.iter().map(|sphere| sphere.center_mm);
    let extent =
        centers().fold(DVec3::NEG_INFINITY, DVec3::max) - centers().fold(DVec3::INFINITY, DVec3::min);
    (0..3).fold(0, |longest, axis| if extent[axis] > extent[longest] { axis } else { longest })
}
