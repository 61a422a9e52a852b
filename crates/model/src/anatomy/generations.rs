//! The branches of one generation together, and `generations.tsv`.

use super::number;
use crate::table::{Column, Table};

/// Mean and standard deviation of a measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// The mean; `NaN` where nothing was measured.
    pub mean: f64,
    /// The sample standard deviation (divisor n − 1); `NaN` for fewer than two.
    pub sd: f64,
}

/// The branches of one generation.
#[derive(Clone, Debug, PartialEq)]
pub struct GenerationSummary {
    /// The generation: 0 at the root.
    pub generation: u32,
    /// How many branches it has.
    pub n_branches: usize,
    /// How many of them end in a tip.
    pub n_terminal: usize,
    /// Their length together, in mm.
    pub total_length_mm: f64,
    /// Their volume together, in mm³.
    pub total_volume_mm3: f64,
    /// Their lengths, in mm.
    pub length_mm: Spread,
    /// Their mean radii, in mm.
    pub radius_mm: Spread,
    /// Their tortuosities.
    pub tortuosity: Spread,
    /// Their angles to their parents, in degrees.
    pub branching_angle_deg: Spread,
}

/// The columns of `generations.tsv`.
pub const GENERATION_COLUMNS: [Column; 13] = [
    Column::new("generation", "1", "forks between the root and the branches: 0 at the root"),
    Column::new("branches", "1", "how many branches the generation has"),
    Column::new("terminal", "1", "how many of them end in a tip"),
    Column::new("total_length_mm", "mm", "their length together"),
    Column::new("total_volume_mm3", "mm3", "the volume of their truncated cones together"),
    Column::new("length_mean_mm", "mm", "mean of their lengths"),
    Column::new("length_sd_mm", "mm", "sample standard deviation of their lengths; n/a for fewer than two"),
    Column::new("radius_mean_mm", "mm", "mean of their mean radii"),
    Column::new("radius_sd_mm", "mm", "sample standard deviation of their mean radii"),
    Column::new("tortuosity_mean", "1", "mean of their tortuosities"),
    Column::new("tortuosity_sd", "1", "sample standard deviation of their tortuosities"),
    Column::new("branching_angle_mean_deg", "deg", "mean of their angles to their parents"),
    Column::new("branching_angle_sd_deg", "deg", "sample standard deviation of these angles"),
];

pub(super) fn to_tsv(generations: &[GenerationSummary]) -> String {
    let mut table = Table::with(&GENERATION_COLUMNS);
    for row in generations {
        let spread = |spread: Spread| [number(spread.mean), number(spread.sd)];
        let ([length, length_sd], [radius, radius_sd]) = (spread(row.length_mm), spread(row.radius_mm));
        let ([bend, bend_sd], [angle, angle_sd]) = (spread(row.tortuosity), spread(row.branching_angle_deg));
        table.row(&[
            &row.generation,
            &row.n_branches,
            &row.n_terminal,
            &number(row.total_length_mm),
            &number(row.total_volume_mm3),
            &length,
            &length_sd,
            &radius,
            &radius_sd,
            &bend,
            &bend_sd,
            &angle,
            &angle_sd,
        ]);
    }
    table.into_string()
}
