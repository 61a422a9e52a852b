//! The last rigid motion, and rounding.
//!
//! **Input** a layout in any pose. **Output** rounded positions, root at the origin; pose; quantum.
//! **Steps** 1. Turn the whole so that Σ conf · l · (1 − cos(h + φ − H)) is least: φ is the argument of
//! Σ conf · l · e^{i(H − h)}. 2. Round to a power of ten at 12 significant digits of the extent, by formatting and
//! parsing, so that memory equals file.
//! **Guarantees** no reflection: targets and global view have the same handedness, so the picture already shows
//! the sides of the global view, patient's right on the viewer's left where that view looks from the front.
//! **Cost** O(N).

use espalier_geom::math;
use espalier_model::Pose;
use glam::DVec2;

use crate::place;
use crate::problem::Problem;

/// Significant digits of the largest coordinate.
const DIGITS: i32 = 12;

/// A layout in its final pose.
pub(crate) struct Posed {
    pub(crate) positions: Vec<DVec2>,
    pub(crate) pose: Pose,
    pub(crate) quantum_mm: f64,
}

/// Turns, moves and rounds a layout.
pub(crate) fn pose(problem: &Problem, positions: &[DVec2]) -> Posed {
    let heading_rad = place::headings(problem, positions);
    let (mut cos_sum, mut sin_sum) = (0.0, 0.0);
    for (node, &heading_rad) in heading_rad.iter().enumerate().skip(1) {
        let weight = problem.targets.confidence[node] * problem.targets.length_mm[node];
        let (sin, cos) = math::sin_cos(problem.targets.heading_rad[node] - heading_rad);
        cos_sum += weight * cos;
        sin_sum += weight * sin;
    }
    let rotation_rad = math::atan2(sin_sum, cos_sum);
    let turn = math::unit_vector(rotation_rad);
    let mut posed: Vec<DVec2> = positions.iter().map(|&p| turn.rotate(p - positions[0])).collect();

    let extent = posed.iter().fold(0.0_f64, |extent, p| extent.max(p.x.abs()).max(p.y.abs()));
    let decimals = decimals(extent);
    for p in &mut posed {
        *p = DVec2::new(round(p.x, decimals), round(p.y, decimals));
    }
    let quantum_mm = format!("1e-{decimals}").parse().unwrap_or(1.0);
    Posed { positions: posed, pose: Pose { rotation_rad, is_reflected: false }, quantum_mm }
}

/// Decimals that give the extent its digits; never a negative number of them.
fn decimals(extent: f64) -> usize {
    if extent == 0.0 {
        return 0;
    }
    let n_before_point = math::floor(math::log10(extent)) as i32 + 1;
    usize::try_from(DIGITS - n_before_point).unwrap_or(0)
}

/// The number that a reader of the file will have.
fn round(value: f64, decimals: usize) -> f64 {
    let rounded: f64 = format!("{value:.decimals$}").parse().unwrap_or(value);
    // −0 and 0 are one coordinate and shall have one byte pattern.
    rounded + 0.0
}
