//! The losses of a layout, by the names of their columns.
//!
//! **Input** the tree, targets, what was measured in the plane. **Output** `Loss` for each column.
//! **Notation** φ the interior angle in space, φ_e in the plane: θ_e or 2π − θ_e, whichever is at most π.
//! **Steps** Metric 1: |l − l_e| / l over edges; |θ − θ_e| / θ over nodes with a grandparent. Metric 2:
//! |φ − φ_e| / max(φ, 5°), and |φ − φ_e| in degrees. The rest: see `form`, `clearance`, `distances`.
//! **Source** [Hu2022] section 5.1.1. **Cost** O(N log N), and that of the distances.

use std::f64::consts::{PI, TAU};

use espalier_model::{Branches, Targets, Tree};
use glam::DVec2;

use crate::flat::{Flat, interior_angle};
use crate::{clearance, distances, form};

/// The least denominator of Metric 2: 5°.
const GUARD_RAD: f64 = PI / 36.0;
/// Share by which a sum of many doubles may differ from the same sum in another order.
const ROUNDING: f64 = 1e-9;

/// A loss.
pub(crate) struct Loss {
    pub(crate) name: &'static str,
    pub(crate) value: f64,
    /// By how much a stated one may be off.
    pub(crate) tolerance: f64,
}

/// Every loss.
pub(crate) fn losses(
    (tree, branches): (&Tree, &Branches),
    targets: &Targets,
    (flat, positions): (&Flat, &[DVec2]),
) -> Vec<Loss> {
    let siblings = form::sibling_errors_deg(tree, positions);
    let chords = form::chord_errors(tree, branches, positions);
    let ((least_mm, most_mm), median_mm) = clearance::clearance_mm(tree, targets, positions);
    let per_median = if median_mm > 0.0 { 1.0 / median_mm } else { 0.0 };
    let (backward, open) = form::backward_share(targets, flat);
    let (area, aspect) = form::bounding_box(positions);
    let (stress, spearman) = distances::compare(tree, positions);
    let mut losses = angle_losses(tree, targets, flat);
    losses.extend([
        Loss::new("sibling_error_mean_deg", mean(&siblings)),
        Loss::new("sibling_error_max_deg", max(&siblings)),
        Loss::new("chord_error_mean", mean(&chords)),
        Loss::new("chord_error_max", max(&chords)),
        Loss::between("clearance_min_mm", least_mm, most_mm),
        Loss::between("clearance_min_edges", least_mm * per_median, most_mm * per_median),
        Loss { name: "backward_length_share", value: backward, tolerance: open + ROUNDING },
        Loss::new("box_area_mm2", area),
        Loss::new("box_aspect", aspect),
        Loss::new("stress", stress),
        Loss::new("spearman", spearman),
    ]);
    losses
}

/// The two metrics, and degrees.
fn angle_losses(tree: &Tree, targets: &Targets, flat: &Flat) -> Vec<Loss> {
    let length: Vec<f64> =
        tree.edges().map(|(node, _)| (1.0 - flat.length_mm[node] / targets.length_mm[node]).abs()).collect();
    let (mut angle, mut angle3d, mut degrees, mut moments) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut turning_mm = 0.0;
    for (node, _) in tree.edges() {
        let Some(embedded) = flat.angle_rad[node] else { continue };
        angle.push((1.0 - embedded / targets.angle_rad[node]).abs());
        let space = interior_angle(tree, node).unwrap_or(PI);
        let error = (space - embedded.min(TAU - embedded)).abs();
        angle3d.push(error / space.max(GUARD_RAD));
        degrees.push(error * (180.0 / PI));
        moments.push(error * (180.0 / PI) * targets.length_mm[node]);
        turning_mm += targets.length_mm[node];
    }
    let weighted = if turning_mm > 0.0 { moments.iter().sum::<f64>() / turning_mm } else { 0.0 };
    vec![
        Loss::new("length_loss_mean", mean(&length)),
        Loss::new("length_loss_max", max(&length)),
        Loss::new("angle_loss_mean", mean(&angle)),
        Loss::new("angle_loss_max", max(&angle)),
        Loss::new("angle3d_loss_mean", mean(&angle3d)),
        Loss::new("angle3d_loss_max", max(&angle3d)),
        Loss::new("angle3d_error_mean_deg", mean(&degrees)),
        Loss::new("angle3d_error_max_deg", max(&degrees)),
        Loss::new("angle3d_error_weighted_deg", weighted),
        Loss::new("angle3d_error_p95_deg", percentile_95(degrees)),
    ]
}

impl Loss {
    fn new(name: &'static str, value: f64) -> Self {
        Self { name, value, tolerance: ROUNDING * value.abs().max(1.0) }
    }

    /// A loss that a comparison decides, which rounding may turn.
    fn between(name: &'static str, least: f64, most: f64) -> Self {
        let value = f64::midpoint(least, most);
        Self { name, value, tolerance: 0.5 * (most - least).abs() + ROUNDING * value.abs().max(1e-300) }
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / (values.len() as f64).max(1.0)
}

fn max(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

/// The least value that 95 of 100 do not exceed; 0 of none.
fn percentile_95(mut values: Vec<f64>) -> f64 {
    let n_at_most = |rank: usize| rank * 100 >= values.len() * 95;
    let Some(rank) = (1..=values.len()).find(|&rank| n_at_most(rank)) else { return 0.0 };
    *values.select_nth_unstable_by(rank - 1, f64::total_cmp).1
}
