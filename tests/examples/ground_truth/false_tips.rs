//! The tips that were found but are not true, each with the branch that it ends.

use espalier_geom::space::nearest_parameter;
use espalier_model::Tree;
use espalier_tests::ground_truth::{false_tips, phantoms::Measured};
use glam::DVec3;

use crate::lost_tips::nearest_entry;

/// One line a tip: place, radius, length and fork's radius of its branch, how far it lies out of the true body, and the
/// nearest line of the tree's ledger.
pub(crate) fn print(measured: &Measured) {
    let (truth, found) = (&measured.truth, &measured.built.tree);
    let branches = found.branches();
    for tip in false_tips(truth, found, measured.case.spacing_mm.into()) {
        let place = found.position_mm(tip);
        let branch = branches.of_node(tip).unwrap_or(0);
        println!(
            "    false: ({:.1}, {:.1}, {:.1}) radius {:.2} mm, on a branch of {:.1} mm at a fork of radius {:.2} mm, {:+.1} mm out \
             of the true body{}",
            place.x,
            place.y,
            place.z,
            found.nodes()[tip].radius_mm,
            branches.length_mm(found, branch),
            branches.list().get(branch).map_or(0.0, |branch| found.nodes()[branch.hub].radius_mm),
            outside_mm(truth, place),
            nearest_entry("tree", &measured.built.ledger, place)
        );
    }
}

/// The distance of a place from the nearest round cone of a tree; negative inside.
fn outside_mm(tree: &Tree, place: DVec3) -> f64 {
    let beyond = |(a, b): (usize, usize)| {
        let (a, b) = (tree.nodes()[a], tree.nodes()[b]);
        let share = nearest_parameter(place, a.position_mm, b.position_mm);
        let distance_mm = place.distance(a.position_mm.lerp(b.position_mm, share));
        distance_mm - (a.radius_mm + share * (b.radius_mm - a.radius_mm))
    };
    tree.edges().map(beyond).fold(f64::INFINITY, f64::min)
}
