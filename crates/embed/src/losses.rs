//! What a layout loses, by the paper's two metrics and in degrees.
//!
//! **Input** rounded positions. **Output** `Losses`, those of distances aside.
//! **Notation** θ, l targets; θ_e, l_e embedded; φ the interior angle in space (π = straight), φ_e in the plane.
//! **Steps** Metric 1: |l − l_e| / l over edges, |θ − θ_e| / θ over nodes with a grandparent. Metric 2:
//! |φ − φ_e| / max(φ, 5°) over the same nodes, and |φ − φ_e| in degrees.
//! **Source** [Hu2022] section 5.1.1.
//! **Differs from the source** it calls the angle of Metric 2 acute, but only the interior angle has the size of
//! its figures; the guard keeps fold-backs from ruling the mean.
//! **Cost** O(N).

use std::f64::consts::PI;

use espalier_geom::angle::wrap_positive;
use espalier_model::Losses;
use glam::DVec2;

use crate::place;
use crate::problem::Problem;
use crate::targets::interior_angle;

/// The least denominator of Metric 2: 5°.
const GUARD_RAD: f64 = 5.0 * PI / 180.0;

/// Mean and maximum under construction.
#[derive(Default)]
struct Summary {
    sum: f64,
    max: f64,
    count: usize,
}

impl Summary {
    fn add(&mut self, value: f64) {
        self.sum += value;
        self.max = self.max.max(value);
        self.count += 1;
    }

    fn mean(&self) -> f64 {
        if self.count == 0 { 0.0 } else { self.sum / self.count as f64 }
    }
}

/// Metric 1 and Metric 2 of a layout.
pub(crate) fn losses(problem: &Problem, positions: &[DVec2]) -> Losses {
    let heading_rad = place::headings(problem, positions);
    let turn_rad = place::turns(problem, &heading_rad);
    let (mut length, mut angle) = (Summary::default(), Summary::default());
    let (mut angle3d, mut degrees) = (Summary::default(), Summary::default());
    for (node, parent) in problem.tree.edges() {
        let target_mm = problem.targets.length_mm[node];
        length.add((positions[node].distance(positions[parent]) - target_mm).abs() / target_mm);
        if parent == 0 {
            continue;
        }
        let target_rad = problem.targets.angle_rad[node];
        angle.add((target_rad - wrap_positive(turn_rad[node] + PI)).abs() / target_rad);
        let interior = interior_angle(problem.tree, node, parent);
        let error = (interior - (PI - turn_rad[node].abs())).abs();
        angle3d.add(error / interior.max(GUARD_RAD));
        degrees.add(error.to_degrees());
    }
    Losses {
        length_loss_mean: length.mean(),
        length_loss_max: length.max,
        angle_loss_mean: angle.mean(),
        angle_loss_max: angle.max,
        angle3d_loss_mean: angle3d.mean(),
        angle3d_loss_max: angle3d.max,
        angle3d_error_mean_deg: degrees.mean(),
        angle3d_error_max_deg: degrees.max,
        ..Losses::default()
    }
}
