//! Narrow places, and `stenoses.tsv`.

use glam::DVec3;

use super::{number, percent};
use crate::table::{Column, Table};

/// A narrow place.
#[derive(Clone, Debug, PartialEq)]
pub struct Stenosis {
    /// The branch that it is on.
    pub branch: usize,
    /// The node at the narrowest place, or the next one beyond it.
    pub node: usize,
    /// The narrowest place, RAS+ mm.
    pub position_mm: DVec3,
    /// Path length from the root to there, in mm.
    pub from_root_mm: f64,
    /// The radius there, in mm.
    pub radius_mm: f64,
    /// The radius that the vessel has before and after, in mm.
    pub reference_radius_mm: f64,
    /// By how much the radius, and so the diameter, falls short of the reference, in percent.
    pub narrowing_percent: f64,
}

/// The columns of `stenoses.tsv`.
pub const STENOSIS_COLUMNS: [Column; 10] = [
    Column::new("candidate", "n/a", "index of the narrow place, the narrowest first"),
    Column::new("branch", "n/a", "the branch that it is on"),
    Column::new("node", "n/a", "the node at the narrowest place, or the next one beyond it"),
    Column::new("x_mm", "mm", "the narrowest place, RAS+: towards the right"),
    Column::new("y_mm", "mm", "the narrowest place: towards the front"),
    Column::new("z_mm", "mm", "the narrowest place: upwards"),
    Column::new("from_root_mm", "mm", "path length from the root to there"),
    Column::new("radius_mm", "mm", "the radius there"),
    Column::new("reference_radius_mm", "mm", "the reference there, as in profiles.tsv"),
    Column::new("narrowing_percent", "%", "diameter stenosis: 100 (1 - radius / reference)"),
];

pub(super) fn to_tsv(stenoses: &[Stenosis]) -> String {
    let mut table = Table::with(&STENOSIS_COLUMNS);
    for (candidate, row) in stenoses.iter().enumerate() {
        table.row(&[
            &candidate,
            &row.branch,
            &row.node,
            &number(row.position_mm.x),
            &number(row.position_mm.y),
            &number(row.position_mm.z),
            &number(row.from_root_mm),
            &number(row.radius_mm),
            &number(row.reference_radius_mm),
            &percent(row.narrowing_percent),
        ]);
    }
    table.into_string()
}
