//! How far a turn is from its target, as an angle and as a ratio.
//!
//! **Notation** the *deviation* of a joint is its turn less its target turn, in rad, counter-clockwise positive. It is
//! −side · span · r_a, with the span the bend that is to lose (r_a ≥ 0) or to gain (r_a < 0). A joint costs
//! c (deviation / span)²: span² / c is its *softness*, and a sum of such costs is least where joints share a deviation
//! by their softness.
//! **Source** Eq. 3 and Eq. 4 of [Hu2022].

use std::f64::consts::PI;

use crate::problem::Problem;
use crate::ratio;

/// What a turn without cost counts as, so that it takes a deviation rather than share it.
const LEAST_COST: f64 = 1e-12;

/// The turn of a node less its target turn, in rad.
pub(crate) fn deviation(problem: &Problem, node: usize, ratio: f64) -> f64 {
    let bend = problem.bend[node];
    problem.side[node] * (ratio::embedded_bend(bend, ratio) - bend)
}

/// The ratio of a deviation; none if it is out of range.
pub(crate) fn ratio_of(problem: &Problem, node: usize, deviation_rad: f64) -> Option<f64> {
    if deviation_rad == 0.0 {
        return Some(0.0);
    }
    let ratio = -problem.side[node] * deviation_rad / span(problem, node, deviation_rad);
    let (low, high) = ratio::ANGLE_RANGE;
    (low..=high).contains(&ratio).then_some(ratio)
}

/// How much a node takes of a deviation of this sign.
pub(crate) fn softness(problem: &Problem, node: usize, deviation_rad: f64) -> f64 {
    let span = span(problem, node, deviation_rad);
    span * span / problem.angle_cost[node].max(LEAST_COST)
}

/// The bend that a node can lose, or gain, in a deviation of this sign.
fn span(problem: &Problem, node: usize, deviation_rad: f64) -> f64 {
    let bend = problem.bend[node];
    if deviation_rad * problem.side[node] <= 0.0 { bend } else { PI - bend }
}
