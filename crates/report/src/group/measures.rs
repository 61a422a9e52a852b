//! What is told of each run of a group.
//!
//! **Input** the numbers of a run. **Output** columns: their names, units and meanings, how they are shown.

use espalier_model::table::{Column, Digits};

use crate::length::number;
use crate::verdict::{degrees, percent};

/// The numbers of a run. `NaN` where there is none.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// Branches of the tree.
    pub branches: usize,
    /// Its tips.
    pub tips: usize,
    /// Length of all branches together, in mm.
    pub total_length_mm: f64,
    /// Mean radius over that length, in mm.
    pub radius_mean_mm: f64,
    /// The highest generation; the root's is 0.
    pub generation_max: u32,
    /// Mean length loss, 0.01 = 1 %.
    pub length_loss_mean: f64,
    /// Mean angle loss against the targets, 0.01 = 1 %.
    pub angle_loss_mean: f64,
    /// Mean error of angles against space, in degrees.
    pub angle3d_error_mean_deg: f64,
    /// The energy of the layout.
    pub energy: f64,
    /// Pairs of edges that cross.
    pub crossings: usize,
    /// Pairs of tubes that overlap at true width.
    pub overlaps: usize,
    /// Warnings of all stages.
    pub warnings: usize,
    /// Loops that the ledger says were cut.
    pub loops_cut: usize,
    /// Spurs that it says were pruned.
    pub spurs_pruned: usize,
    /// Narrow places listed.
    pub narrow_places: usize,
    /// The size of a voxel of the mask, in mm.
    pub voxel_mm: [f64; 3],
}

/// A measure of the runs of a group.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measure {
    /// Its column in `group.tsv`.
    pub(super) column: Column,
    /// Its heading on the page.
    pub(super) heading: &'static str,
    /// How it is written in tables.
    pub(super) digits: Digits,
    /// Its value.
    pub(super) of: fn(&Measured) -> f64,
}

impl Measure {
    /// Differences up to this say nothing: what is lost below a hundredth of a percent or a twentieth of a degree is
    /// rounding of the solver.
    pub(super) fn noise(&self) -> f64 {
        match self.column.name {
            name if name.ends_with("_loss_mean") => 1e-4,
            name if name.ends_with("_deg") => 0.05,
            "energy" => 1e-6,
            _ => 0.0,
        }
    }

    /// A value as the page shows it.
    pub(super) fn text(&self, value: f64) -> String {
        match self.column.name {
            _ if !value.is_finite() => number(value, 4),
            name if name.ends_with("_loss_mean") => percent(value),
            name if name.ends_with("_deg") => degrees(value),
            _ => number(value, 4),
        }
    }
}

const fn measure(column: Column, heading: &'static str, digits: Digits, of: fn(&Measured) -> f64) -> Measure {
    Measure { column, heading, digits, of }
}

const WHOLE: Digits = Digits::Decimals(0);
/// As in the other tables.
const SEVEN: Digits = Digits::Significant(7);

/// All measures, in the order of the columns. The last three are shown as one.
pub(super) const MEASURES: [Measure; 18] = [
    measure(Column::new("branches", "1", "branches of the tree"), "branches", WHOLE, |m| m.branches as f64),
    measure(Column::new("tips", "1", "tips of the tree"), "tips", WHOLE, |m| m.tips as f64),
    measure(
        Column::new("total_length_mm", "mm", "length of all branches together"),
        "length (mm)",
        SEVEN,
        |m| m.total_length_mm,
    ),
    measure(
        Column::new("radius_mean_mm", "mm", "mean radius over that length"),
        "mean radius (mm)",
        SEVEN,
        |m| m.radius_mean_mm,
    ),
    measure(
        Column::new("generation_max", "1", "the highest generation; the root's is 0"),
        "highest generation",
        WHOLE,
        |m| f64::from(m.generation_max),
    ),
    measure(
        Column::new("length_loss_mean", "1", "mean length loss of the map's edges, as in compare.tsv"),
        "length loss",
        SEVEN,
        |m| m.length_loss_mean,
    ),
    measure(
        Column::new("angle_loss_mean", "1", "mean angle loss of the map's nodes, as in compare.tsv"),
        "angle loss",
        SEVEN,
        |m| m.angle_loss_mean,
    ),
    measure(
        Column::new("angle3d_error_mean_deg", "deg", "mean error of the map's angles against space"),
        "angle in space",
        SEVEN,
        |m| m.angle3d_error_mean_deg,
    ),
    measure(Column::new("energy", "1", "energy of the map"), "energy", SEVEN, |m| m.energy),
    measure(Column::new("crossings", "1", "pairs of edges of the map that cross"), "crossings", WHOLE, |m| {
        m.crossings as f64
    }),
    measure(
        Column::new("overlaps", "1", "pairs of tubes that overlap in the map at true width"),
        "overlaps",
        WHOLE,
        |m| m.overlaps as f64,
    ),
    measure(Column::new("warnings", "1", "warnings of all stages"), "warnings", WHOLE, |m| m.warnings as f64),
    measure(
        Column::new("loops_cut", "1", "loops cut, as topology.tsv lists them"),
        "loops cut",
        WHOLE,
        |m| m.loops_cut as f64,
    ),
    measure(
        Column::new("spurs_pruned", "1", "spurs pruned, as topology.tsv lists them"),
        "spurs pruned",
        WHOLE,
        |m| m.spurs_pruned as f64,
    ),
    measure(
        Column::new("narrow_places", "1", "narrow places, as stenoses.tsv lists them"),
        "narrow places",
        WHOLE,
        |m| m.narrow_places as f64,
    ),
    measure(
        Column::new("voxel_x_mm", "mm", "size of a voxel of the mask to the right; n/a for a traced tree"),
        "voxel x (mm)",
        SEVEN,
        |m| m.voxel_mm[0],
    ),
    measure(Column::new("voxel_y_mm", "mm", "the same towards the front"), "voxel y (mm)", SEVEN, |m| {
        m.voxel_mm[1]
    }),
    measure(Column::new("voxel_z_mm", "mm", "the same upwards"), "voxel z (mm)", SEVEN, |m| m.voxel_mm[2]),
];

/// How many of the measures are shown as one.
pub(super) const N_VOXEL: usize = 3;
