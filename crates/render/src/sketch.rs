//! The edges of a scene as round cones on a page.
//!
//! **Input** a scene, its page, its colours. **Output** one cone per edge, in preorder; a tree of one node is a
//! ball.

use espalier_model::Tree;

use crate::coloring::Coloring;
use crate::cone::{Ball, Cone, Joint};
use crate::kinship::Kinship;
use crate::page::Page;
use crate::raster::Drawn;
use crate::scene::Scene;

/// The cones of a tree.
pub(crate) fn edges(
    tree: &Tree,
    scene: &Scene,
    page: &Page,
    coloring: &Coloring,
    kinship: &Kinship,
) -> Vec<Drawn> {
    let balls: Vec<Ball> = (0..tree.n_nodes())
        .map(|node| {
            let point = scene.points_mm[node];
            let radius = page.radius_px(scene.radii_mm[node]);
            let center = page.px(point.truncate()).extend(point.z * page.px_per_mm);
            Ball { center, radius }
        })
        .collect();
    let drawn = |node: usize, parent: usize, cone: Cone| Drawn {
        node: node as u32,
        cone,
        values: coloring.ends[node],
        arc_px: [kinship.arc_px[parent], kinship.arc_px[node]],
    };
    if tree.n_nodes() == 1 {
        return vec![drawn(0, 0, Cone::new(balls[0], balls[0], [Joint::End; 2]))];
    }
    tree.edges()
        .map(|(node, parent)| {
            let before = tree.parent(parent).filter(|_| tree.children(parent).len() == 1);
            let after = Some(tree.children(node)).filter(|children| children.len() == 1);
            let joints = [
                before.map_or(Joint::End, |before| Joint::Chain(balls[before])),
                after.map_or(Joint::End, |after| Joint::Chain(balls[after[0]])),
            ];
            drawn(node, parent, Cone::new(balls[parent], balls[node], joints))
        })
        .collect()
}
