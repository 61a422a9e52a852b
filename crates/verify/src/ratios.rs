//! The ratios r_l and r_a of a layout, measured.
//!
//! **Input** what was measured in the plane, the targets, what is stated. **Output** how far a stated ratio is off
//! at worst, and at which node.
//! **Notation** s = θ for θ ≤ π, else 2π − θ; s_e is θ_e measured on the same side.
//! **Steps** r_l = l_e / l − 1. r_a = (s_e − s) / (π − s) for s ≤ s_e ≤ π; s_e / s − 1 for s_e < s; 1 + (s_e − π) / π
//! where the layout turns to the other side; −|θ_e − π| / π where the target is straight to 1e-6.
//! **Guarantees** a stated 0 is right wherever the rounding of the coordinates explains the deviation: each end of an
//! edge has moved by at most 0.71 of the step, so an edge's length by 1.42 and its direction by 1.42 per length; two
//! steps are granted.
//! **Source** Eq. 3 of [Hu2022], inverted.

use std::f64::consts::{PI, TAU};

use espalier_model::{Targets, Tree};

use crate::check::Check;
use crate::flat::Flat;

/// How far a stated ratio may be off: far above rounding in doubles, far below anything a loss can see.
const TOLERANCE: f64 = 1e-8;
/// Rounding in doubles of an angle of three points far from the origin, in rad.
const ANGLE_ROUNDING_RAD: f64 = 1e-12;
/// Steps of the coordinates that an edge may be off.
const STEPS: f64 = 2.0;
/// Below this bend a target is straight.
const STRAIGHT_RAD: f64 = 1e-6;

/// The angle ratio of an embedded angle against its target.
pub(crate) fn angle_ratio(target_rad: f64, embedded_rad: f64) -> f64 {
    let on_left = target_rad > PI;
    let s = if on_left { TAU - target_rad } else { target_rad };
    let s_e = if on_left { TAU - embedded_rad } else { embedded_rad };
    if PI - s < STRAIGHT_RAD {
        -(embedded_rad - PI).abs() / PI
    } else if s_e > PI && s_e < TAU {
        1.0 + (s_e - PI) / PI
    } else if s_e >= TAU {
        // Folded back exactly: no side.
        -1.0
    } else if s_e >= s {
        (s_e - s) / (PI - s)
    } else {
        s_e / s - 1.0
    }
}

/// The ratios of a layout, 0 where rounding explains the deviation.
pub(crate) fn measured(tree: &Tree, targets: &Targets, flat: &Flat, quantum_mm: f64) -> (Vec<f64>, Vec<f64>) {
    let (mut length, mut angle) = (vec![0.0; tree.n_nodes()], vec![0.0; tree.n_nodes()]);
    for (node, parent) in tree.edges() {
        let (l, l_e) = (targets.length_mm[node], flat.length_mm[node]);
        if (l_e - l).abs() > STEPS * quantum_mm {
            length[node] = l_e / l - 1.0;
        }
        let Some(embedded) = flat.angle_rad[node] else { continue };
        let slack_rad = STEPS * quantum_mm * (1.0 / l_e + 1.0 / targets.length_mm[parent]);
        let off = (embedded - targets.angle_rad[node]).abs();
        if off.min(TAU - off) > slack_rad || l_e == 0.0 {
            angle[node] = angle_ratio(targets.angle_rad[node], embedded);
        }
    }
    (length, angle)
}

/// The worst of something over the nodes.
#[derive(Default)]
struct Worst {
    node: usize,
    excess: f64,
    stated: f64,
    found: f64,
}

impl Worst {
    fn see(&mut self, node: usize, (stated, found): (f64, f64), allowed: f64) {
        let excess = (stated - found).abs() / allowed;
        if excess > self.excess || excess.is_nan() {
            *self = Self { node, excess, stated, found };
        }
    }

    fn check(&self, name: &str, n_ratios: usize) -> Check {
        let fault = (self.excess.is_nan() || self.excess > 1.0)
            .then(|| format!("node {}: stated {:.9}, found {:.9}", self.node, self.stated, self.found));
        Check::unless(name, format!("{n_ratios} ratios"), fault)
    }
}

/// Checks stated length ratios.
pub(crate) fn check_lengths(targets: &Targets, flat: &Flat, quantum_mm: f64, stated: &[f64]) -> Check {
    let mut worst = Worst::default();
    for (node, &stated) in stated.iter().enumerate().skip(1) {
        let (l, l_e) = (targets.length_mm[node], flat.length_mm[node]);
        let is_explained = stated == 0.0 && (l_e - l).abs() <= STEPS * quantum_mm * (1.0 + 1e-9);
        if !is_explained {
            worst.see(node, (stated, l_e / l - 1.0), TOLERANCE);
        }
    }
    worst.check("length ratios", stated.len() - 1)
}

/// Checks stated angle ratios.
pub(crate) fn check_angles(
    (tree, targets): (&Tree, &Targets),
    flat: &Flat,
    quantum_mm: f64,
    stated: &[f64],
) -> Check {
    let (mut worst, mut n_angles) = (Worst::default(), 0);
    for (node, &stated) in stated.iter().enumerate().skip(1) {
        let parent = tree.parent(node).unwrap_or(0);
        let Some(embedded) = flat.angle_rad[node] else {
            worst.see(node, (stated, 0.0), TOLERANCE);
            continue;
        };
        n_angles += 1;
        let target = targets.angle_rad[node];
        let before_mm = targets.length_mm[parent].min(flat.length_mm[parent]);
        let slack_rad = STEPS * quantum_mm * (1.0 / flat.length_mm[node] + 1.0 / before_mm);
        let off = (embedded - target).abs();
        let is_explained = stated == 0.0 && off.min(TAU - off) <= slack_rad * (1.0 + 1e-9);
        if !is_explained {
            let bend = (target - PI).abs();
            let steepest = 1.0 / bend.min(PI - bend).max(STRAIGHT_RAD);
            let allowed = TOLERANCE + ANGLE_ROUNDING_RAD * steepest;
            worst.see(node, (stated, angle_ratio(target, embedded)), allowed);
        }
    }
    worst.check("angle ratios", n_angles)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ratio_inverts_the_printed_equation() {
        for i in 1..628 {
            let theta = f64::from(i) * 0.01;
            for j in -97..=99 {
                let r = f64::from(j) * 0.01;
                let embedded = match (theta <= PI, r >= 0.0) {
                    (true, true) => theta + (PI - theta) * r,
                    (true, false) => (1.0 + r) * theta,
                    (false, true) => theta - (theta - PI) * r,
                    (false, false) => theta - (TAU - theta) * r,
                };
                assert!((angle_ratio(theta, embedded) - r).abs() < 1e-9, "{theta} {r}");
            }
        }
        assert!((angle_ratio(2.0, PI + 0.5) - (1.0 + 0.5 / PI)).abs() < 1e-15);
        assert!((angle_ratio(4.0, PI - 0.5) - (1.0 + 0.5 / PI)).abs() < 1e-15);
        assert!((angle_ratio(PI, PI + 0.5) + 0.5 / PI).abs() < 1e-15);
    }
}
