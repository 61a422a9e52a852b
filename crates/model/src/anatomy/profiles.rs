//! The calibre along a branch, and `profiles.tsv`.

use super::{number, percent};
use crate::table::{Column, Table};

/// The calibre at one node of a branch.
#[derive(Clone, Debug, PartialEq)]
pub struct ProfileRow {
    /// The branch.
    pub branch: usize,
    /// The node; the first of a branch is the fork or root that it starts from.
    pub node: usize,
    /// Path length from the branch's start, in mm.
    pub from_start_mm: f64,
    /// Path length from the root, in mm.
    pub from_root_mm: f64,
    /// The radius at the node, in mm.
    pub radius_mm: f64,
    /// The radius of the circle with the area of the cross-section, in mm; `NaN` where it is not known.
    pub area_radius_mm: f64,
    /// The radius that the vessel has before and after, in mm; `NaN` inside of a fork.
    pub reference_radius_mm: f64,
    /// By how much the radius falls short of the reference, in percent; `NaN` inside of a fork.
    pub narrowing_percent: f64,
}

/// The columns of `profiles.tsv`.
pub const PROFILE_COLUMNS: [Column; 8] = [
    Column::new("branch", "n/a", "the branch"),
    Column::new("node", "n/a", "the node; the first of a branch is the fork or root that it starts from"),
    Column::new("from_start_mm", "mm", "path length from the start of the branch"),
    Column::new("from_root_mm", "mm", "path length from the root"),
    Column::new(
        "radius_mm",
        "mm",
        "radius at the node: of the sphere inside the mask, or up to the wall that the scan shows",
    ),
    Column::new(
        "area_radius_mm",
        "mm",
        "radius of the circle with the area of the cross-section, from the nearest skeleton voxel; n/a where unknown",
    ),
    Column::new(
        "reference_radius_mm",
        "mm",
        "the smaller of the largest radii on the way towards the root and on the ways towards the tips, each within ten radii of the branch, this place included; n/a inside of a fork",
    ),
    Column::new("narrowing_percent", "%", "100 (1 - radius / reference); n/a inside of a fork"),
];

pub(super) fn to_tsv(profile: &[ProfileRow]) -> String {
    let mut table = Table::with(&PROFILE_COLUMNS);
    for row in profile {
        table.row(&[
            &row.branch,
            &row.node,
            &number(row.from_start_mm),
            &number(row.from_root_mm),
            &number(row.radius_mm),
            &number(row.area_radius_mm),
            &number(row.reference_radius_mm),
            &percent(row.narrowing_percent),
        ]);
    }
    table.into_string()
}
