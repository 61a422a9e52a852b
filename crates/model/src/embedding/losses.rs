//! What a layout loses: every loss with its name, its unit, its meaning and which way is better, in one list.
//!
//! The list makes the type, its file, its columns in `compare.tsv` and its lines in the data dictionary, so that none
//! of them can say what another does not.

use serde::{Deserialize, Serialize};

use crate::table::{Column, Digits};

/// Which of two values of a column is the better one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Better {
    /// The smaller.
    Less,
    /// The larger.
    More,
    /// Neither: it describes.
    Neither,
}

/// A loss as a column of a table.
#[derive(Clone, Copy, Debug)]
pub struct LossColumn {
    /// Name, unit and meaning.
    pub column: Column,
    /// Which way is better.
    pub better: Better,
    /// How it is written.
    pub digits: Digits,
    /// Its value.
    pub of: fn(&Losses) -> f64,
}

macro_rules! losses {
    ($( $name:ident, $unit:literal, $digits:expr, $better:ident, $meaning:literal; )*) => {
        /// What a layout loses (section 5.1.1 of [Hu2022], and more). Means are over what has the quantity; where
        /// nothing has it, they are 0.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields)]
        pub struct Losses {
            $( #[doc = $meaning] pub $name: f64, )*
        }

        impl Losses {
            /// Every loss, in the order of `compare.tsv`.
            pub const COLUMNS: &'static [LossColumn] = &[
                $( LossColumn {
                    column: Column { name: stringify!($name), unit: $unit, meaning: $meaning },
                    better: Better::$better,
                    digits: $digits,
                    of: |losses| losses.$name,
                }, )*
            ];
        }
    };
}

losses! {
    length_loss_mean, "1", Digits::Decimals(6), Less,
        "Metric 1: mean of |l − l_e| / l over edges, l the target length, l_e the drawn one";
    length_loss_max, "1", Digits::Decimals(6), Less,
        "Metric 1: maximum of |l − l_e| / l";
    angle_loss_mean, "1", Digits::Decimals(6), Less,
        "Metric 1: mean of |θ − θ_e| / θ over nodes with a grandparent, θ the target angle, θ_e the drawn one";
    angle_loss_max, "1", Digits::Decimals(6), Less,
        "Metric 1: maximum of |θ − θ_e| / θ";
    angle3d_loss_mean, "1", Digits::Decimals(6), Less,
        "Metric 2: mean of |φ − φ_e| / max(φ, 5°), φ the interior angle in space (π = straight), φ_e in the plane";
    angle3d_loss_max, "1", Digits::Decimals(6), Less,
        "Metric 2: maximum of |φ − φ_e| / max(φ, 5°)";
    angle3d_error_mean_deg, "deg", Digits::Decimals(4), Less,
        "mean of |φ − φ_e|";
    angle3d_error_max_deg, "deg", Digits::Decimals(4), Less,
        "maximum of |φ − φ_e|";
    stress, "1", Digits::Decimals(6), Less,
        "Kruskal's stress of the distances between nodes, plane against space";
    spearman, "1", Digits::Decimals(6), More,
        "Spearman's rank correlation of the distances between nodes, plane against space";
    angle3d_error_p95_deg, "deg", Digits::Decimals(4), Less,
        "95th percentile of |φ − φ_e| (nearest rank)";
    angle3d_error_weighted_deg, "deg", Digits::Decimals(4), Less,
        "mean of |φ − φ_e|, each weighted by the length in space of the edge that turns";
    sibling_error_mean_deg, "deg", Digits::Decimals(4), Less,
        "mean of |γ − γ_e|, γ the angle in space between two edges with a common upper node, γ_e in the plane, both \
         in 0 to 180; of forks with over 64 edges only those at most 32 apart in the tree's order";
    sibling_error_max_deg, "deg", Digits::Decimals(4), Less,
        "maximum of |γ − γ_e|";
    chord_error_mean, "1", Digits::Decimals(6), Less,
        "mean of |c − c_e| / c over branches, c the straight distance in space between a branch's ends (at least a \
         twentieth of the branch's length), c_e in the plane";
    chord_error_max, "1", Digits::Decimals(6), Less,
        "maximum of |c − c_e| / c";
    clearance_min_mm, "mm", Digits::Significant(6), More,
        "the largest clearance that the layout keeps, at most one median edge: the least distance between two edges \
         without a common node that are nearer to each other than a fifth of the path along the tree between them";
    clearance_min_edges, "median edge", Digits::Decimals(6), More,
        "the same as a share of the median edge length, at most 1";
    backward_length_share, "1", Digits::Decimals(6), Less,
        "share of the length seen in the global view that points over 90° off its direction there, after the \
         rotation (and reflection) of the whole that agrees best";
    box_area_mm2, "mm2", Digits::Significant(6), Neither,
        "area of the upright box around the layout as it is written";
    box_aspect, "1", Digits::Decimals(6), Neither,
        "shorter over longer side of that box; 0 for a line";
}
