//! The calibre at each node of each branch.
//!
//! **Input** lines, places with their references, the spheres. **Output** rows: for each branch the fork or root that it
//! starts from, then its own nodes. **Cost** O(N) and the search for spheres.

use espalier_model::anatomy::ProfileRow;
use espalier_model::{Branches, InscribedSpheres, Tree};

use super::areas;
use super::line::Line;
use super::reference::Place;

pub(super) fn of(
    tree: &Tree,
    (branches, lines): (&Branches, &[Line]),
    from_root_mm: &[f64],
    (places, spheres): (&[Place], Option<&InscribedSpheres>),
) -> Vec<ProfileRow> {
    let areas_mm = areas::radii_mm(tree, spheres);
    let mut rows = Vec::new();
    let mut rest = places;
    for (branch_idx, (branch, line)) in branches.list().iter().zip(lines).enumerate() {
        let (own, later) = rest.split_at(rest.partition_point(|place| place.branch <= branch_idx));
        rest = later;
        for (&node, &arc_mm) in line.nodes.iter().zip(&line.arcs_mm) {
            // A branch's places are its nodes outside of forks and up to two borders: the same arc is the same place.
            let place = own.get(own.partition_point(|place| place.from_start_mm < arc_mm));
            let place = place.filter(|place| place.from_start_mm == arc_mm);
            rows.push(ProfileRow {
                branch: branch_idx,
                node,
                from_start_mm: arc_mm,
                from_root_mm: from_root_mm[branch.hub] + arc_mm,
                radius_mm: tree.nodes()[node].radius_mm,
                area_radius_mm: areas_mm[node],
                reference_radius_mm: place.map_or(f64::NAN, |place| place.reference_mm),
                narrowing_percent: place.map_or(f64::NAN, Place::narrowing_percent),
            });
        }
    }
    rows
}
