//! The tips of the truth that were not found, each with what lies nearest to it.

use espalier_geom::math::{acos, cbrt};
use espalier_geom::space::nearest_parameter;
use espalier_model::{Ledger, Tree};
use espalier_tests::ground_truth::{lost_tips, phantoms::Measured};
use glam::DVec3;

/// One line a tip: place, true diameter, the angle of its branch to the slices' normal; how wide the gap is to the nearest
/// other branch of the truth; how far it is to the nearest voxel of the mask, of the skeleton, and to the tree that was
/// found; and the nearest lines of the ledgers of mask and tree.
pub(crate) fn print(measured: &Measured) {
    let (truth, found) = (&measured.truth, &measured.built.tree);
    let grid = measured.mask.grid();
    let voxel_mm = cbrt(measured.case.spacing_mm.iter().product());
    let place_of = |voxel: [f64; 3]| grid.world_from_voxel().transform_point3(DVec3::from_array(voxel));
    for tip in lost_tips(truth, found, measured.case.spacing_mm.into()) {
        let place = truth.position_mm(tip);
        let to_curve = |(a, b): (usize, usize)| {
            let (a, b) = (found.position_mm(a), found.position_mm(b));
            place.distance(a.lerp(b, nearest_parameter(place, a, b)))
        };
        let least = |distances: &mut dyn Iterator<Item = f64>| distances.fold(f64::INFINITY, f64::min);
        let mask_mm =
            least(&mut measured.mask.voxels().map(|v| place.distance(place_of(v.map(|c| c as f64)))));
        let skeleton = measured.skeleton.voxels().iter();
        let skeleton_mm = least(&mut skeleton.map(|v| place.distance(place_of(v.map(f64::from)))));
        println!(
            "    lost: ({:.1}, {:.1}, {:.1}) diameter {:.2} voxels, {:.0}° to the normal of the slices, {:.1} mm from another branch; mm to the mask {mask_mm:.1}, \
             skeleton {skeleton_mm:.1}, tree {:.1}{}{}",
            place.x,
            place.y,
            place.z,
            2.0 * truth.nodes()[tip].radius_mm / voxel_mm,
            degrees_to_normal(truth, tip),
            gap_mm(truth, tip),
            least(&mut found.edges().map(to_curve)),
            nearest_entry("mask", &measured.dropped, place),
            nearest_entry("tree", &measured.built.ledger, place)
        );
    }
}

/// The distance between the surfaces of a tip's ball and of the other branches, but the one that its own grows from.
fn gap_mm(truth: &Tree, tip: usize) -> f64 {
    let is_end = |node: usize| truth.children(node).len() != 1 || truth.parent(node).is_none();
    let fork =
        std::iter::successors(truth.parent(tip), |&node| truth.parent(node)).find(|&node| is_end(node));
    let own = |node: usize| {
        std::iter::successors(Some(node), |&node| truth.parent(node)).take_while(|&node| Some(node) != fork)
    };
    let (mine, trunk): (Vec<usize>, Vec<usize>) = (
        own(tip).collect(),
        fork.map_or_else(Vec::new, |fork| {
            std::iter::successors(Some(fork), |&node| truth.parent(node)).collect()
        }),
    );
    let is_other = |node: usize| !mine.contains(&node) && !trunk.contains(&node);
    let (place, radius_mm) = (truth.position_mm(tip), truth.nodes()[tip].radius_mm);
    let gap = |(a, b): (usize, usize)| {
        let (a, b) = (truth.nodes()[a], truth.nodes()[b]);
        let share = nearest_parameter(place, a.position_mm, b.position_mm);
        let thick_mm = a.radius_mm + share * (b.radius_mm - a.radius_mm);
        place.distance(a.position_mm.lerp(b.position_mm, share)) - radius_mm - thick_mm
    };
    truth.edges().filter(|&(a, b)| is_other(a.max(b))).map(gap).fold(f64::INFINITY, f64::min)
}

/// The angle between a tip's branch, over its last edges, and the third axis.
fn degrees_to_normal(truth: &Tree, tip: usize) -> f64 {
    let parent = truth.parent(tip).or_else(|| truth.children(tip).first().copied()).unwrap_or(tip);
    let before = truth.parent(parent).filter(|&node| node != tip).unwrap_or(parent);
    let way = (truth.position_mm(tip) - truth.position_mm(before)).normalize_or_zero();
    acos(way.z.abs().min(1.0)).to_degrees()
}

/// The entry nearest to a place, in words.
pub(crate) fn nearest_entry(name: &str, ledger: &Ledger, place: DVec3) -> String {
    let away_mm = |entry: &espalier_model::LedgerEntry| entry.position_mm.distance(place);
    let nearest = ledger.0.iter().min_by(|a, b| away_mm(a).total_cmp(&away_mm(b)));
    nearest.map_or_else(String::new, |entry| {
        format!("; {name}, {:.1} mm away: {}, {}", away_mm(entry), entry.kind.name(), entry.reason)
    })
}
