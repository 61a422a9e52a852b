//! The edges of a scene as round cones on a page.
//!
//! **Input** a scene, its page, its colours. **Output** one cone per edge, in preorder; a tree of one node is a
//! ball.

use espalier_model::Tree;

use crate::coloring::Coloring;
use crate::cone::{Ball, Cone, reach_at_joint};
use crate::kinship::Kinship;
use crate::page::Page;
use crate::params::Style;
use crate::raster::Drawn;
use crate::scene::Scene;

/// The cones of a tree.
pub(crate) fn edges(
    tree: &Tree,
    scene: &Scene,
    page: &Page,
    coloring: &Coloring,
    (kinship, style): (&Kinship, Style),
) -> Vec<Drawn> {
    let balls: Vec<Ball> = (0..tree.n_nodes())
        .map(|node| {
            let point = scene.points_mm[node];
            let radius = match style {
                Style::PseudoSurface => page.radius_px(scene.radii_mm[node]),
                Style::Line => 0.5 * page.min_width_px,
            };
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
        return vec![drawn(0, 0, Cone::new(balls[0], balls[0], [1.0, 1.0]))];
    }
    tree.edges()
        .map(|(node, parent)| {
            let before = tree.parent(parent).filter(|_| tree.children(parent).len() == 1);
            let after = Some(tree.children(node)).filter(|children| children.len() == 1);
            let reach = [
                before.map_or(1.0, |before| reach_at_joint(balls[before], balls[parent], balls[node])),
                after.map_or(1.0, |after| reach_at_joint(balls[parent], balls[node], balls[after[0]])),
            ];
            drawn(node, parent, Cone::new(balls[parent], balls[node], reach))
        })
        .collect()
}
