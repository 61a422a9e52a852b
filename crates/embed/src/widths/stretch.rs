//! The least scale of a layout against its radii at which nothing overlaps.
//!
//! **Input** a layout without crossings. **Output** λ ≥ 1, by which lengths are to be multiplied.
//! **Notation** for two edges whose capsules meet: distance d, sum of radii R, path p between them, junction disc D,
//! shorter branch B. **Steps** 1. At the scale λ they overlap if λ d < R, λ p > R, and λ p > 2 D or p > 2 B: an
//! interval of λ. Pairs that do not meet at 1 never do above. 2. From 1 upwards, step out of every interval.
//! **Guarantees** nothing overlaps at λ, and something does at every scale from 1 up to λ.
//! **Source** ours. **Cost** O(pairs log pairs) beyond finding them.

use glam::DVec2;

use super::overlap::{Meeting, each_meeting};
use crate::problem::Problem;

/// A step beyond the end of an interval, for rounding.
const BEYOND: f64 = 1e-9;

/// The least scale without overlaps; none if edges cross or there are too many pairs.
pub(super) fn least_scale(problem: &Problem, positions: &[DVec2]) -> Option<f64> {
    let mut intervals = Vec::new();
    if !each_meeting(problem, positions, |meeting| intervals.push(overlapping(meeting))) {
        return None;
    }
    intervals.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut scale = 1.0;
    for (from, to) in intervals {
        if from >= scale {
            break;
        }
        if to > scale {
            scale = to * (1.0 + BEYOND);
        }
    }
    scale.is_finite().then_some(scale)
}

/// The scales between which two edges overlap.
fn overlapping(&Meeting { distance_mm, reach_mm, between_mm, disc_mm, branch_mm }: &Meeting) -> (f64, f64) {
    let is_beyond_branch = between_mm > 2.0 * branch_mm;
    let beyond_disc = if is_beyond_branch { 0.0 } else { 2.0 * disc_mm / between_mm };
    ((reach_mm / between_mm).max(beyond_disc), reach_mm / distance_mm)
}
