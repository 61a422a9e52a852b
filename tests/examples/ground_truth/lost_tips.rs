//! The tips of the truth that were not found, each with what lies nearest to it.

use espalier_geom::space::nearest_parameter;
use espalier_tests::ground_truth::{lost_tips, phantoms::Measured};

/// One line a tip: place, true radius, the distances to the nearest free end and to the nearest place of the tree that was
/// found, and the nearest line of its ledger.
pub(crate) fn print(measured: &Measured) {
    let (truth, found) = (&measured.truth, &measured.built.tree);
    for tip in lost_tips(truth, found, measured.mask.grid().spacing_mm()) {
        let place = truth.position_mm(tip);
        let to_curve = |(a, b): (usize, usize)| {
            let (a, b) = (found.position_mm(a), found.position_mm(b));
            place.distance(a.lerp(b, nearest_parameter(place, a, b)))
        };
        let curve_mm = found.edges().map(to_curve).fold(f64::INFINITY, f64::min);
        let entries = measured.built.ledger.0.iter();
        let nearest =
            entries.min_by(|a, b| a.position_mm.distance(place).total_cmp(&b.position_mm.distance(place)));
        let ledger = nearest.map_or_else(String::new, |entry| {
            format!(
                "; {:.1} mm away: {}, {}",
                entry.position_mm.distance(place),
                entry.kind.name(),
                entry.reason
            )
        });
        println!(
            "    lost: ({:.1}, {:.1}, {:.1}) radius {:.2} mm, {curve_mm:.1} mm from the tree{ledger}",
            place.x,
            place.y,
            place.z,
            truth.nodes()[tip].radius_mm
        );
    }
}
