//! Angle and length ratios: equation 3 and its inverse.
//!
//! **Input** a target angle θ and a ratio r_a. **Output** the embedded bend |θ_e − π|; and the way back.
//! **Notation** τ = θ − π is the turn, a = |τ| its bend in [0, π]; the side is right (clockwise) for θ ≤ π.
//! On either side equation 3 says the same about the bend: it is a (1 − r_a) for r_a ≥ 0, which straightens, and
//! a − r_a (π − a) for r_a < 0, which folds. So the four cases become two, and the side is a sign.
//! **Guarantees** the inverse of the bend under r is r up to rounding for θ ≠ π and r in [−1, 1].
//! **Source** Eq. 3 of [Hu2022].
//! **Differs from the source** r_a ≥ −0.97, because −1 folds an edge onto its parent; 1 + r_l ∈ (0, 2], because
//! the text's r_l ∈ (0, 2] excludes its own P_0. The inverse also measures layouts that change the side:
//! 1 + (beyond the straight line) / π.

use std::f64::consts::PI;

use espalier_geom::angle::wrap;

/// The range of r_a.
pub(crate) const ANGLE_RANGE: (f64, f64) = (-0.97, 1.0);
/// The range of r_l: the embedded length is from a thirty-third of the length to twice the length.
pub(crate) const LENGTH_RANGE: (f64, f64) = (-0.97, 1.0);
/// Below this bend a target counts as straight: a share of no bend cannot be told.
const STRAIGHT_RAD: f64 = 1e-6;

/// −1 for a target that turns right (θ ≤ π), 1 for left.
pub(crate) fn side_sign(angle_rad: f64) -> f64 {
    if angle_rad <= PI { -1.0 } else { 1.0 }
}

/// The bend of a target angle: how far it is from straight, in [0, π].
pub(crate) fn target_bend(angle_rad: f64) -> f64 {
    (angle_rad - PI).abs()
}

/// The embedded bend of a target bend under r_a: equation 3.
#[inline]
pub(crate) fn embedded_bend(bend_rad: f64, ratio: f64) -> f64 {
    if ratio >= 0.0 { bend_rad * (1.0 - ratio) } else { bend_rad - ratio * (PI - bend_rad) }
}

/// The ratio r_a that an embedded turn (heading less parent's heading, radians) has against a target angle.
///
/// A turn to the target's side gives a ratio in [−1, 1]; a turn to the other side one in (1, 2].
pub(crate) fn angle_ratio(angle_rad: f64, turn_rad: f64) -> f64 {
    let bend = target_bend(angle_rad);
    let embedded = side_sign(angle_rad) * wrap(turn_rad);
    if bend < STRAIGHT_RAD {
        -embedded.abs() / PI
    } else if embedded < 0.0 && embedded > -PI {
        1.0 - embedded / PI
    } else if embedded.abs() <= bend {
        1.0 - embedded.abs() / bend
    } else {
        (bend - embedded.abs()) / (PI - bend)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    /// Equation 3 as it is printed.
    fn printed(theta: f64, r_a: f64) -> f64 {
        if theta <= PI && r_a >= 0.0 {
            theta + (PI - theta) * r_a
        } else if theta <= PI {
            (1.0 + r_a) * theta
        } else if r_a >= 0.0 {
            theta - (theta - PI) * r_a
        } else {
            theta - (TAU - theta) * r_a
        }
    }

    fn embedded_angle(angle_rad: f64, ratio: f64) -> f64 {
        PI + side_sign(angle_rad) * embedded_bend(target_bend(angle_rad), ratio)
    }

    #[test]
    fn equals_the_printed_equation_and_inverts() {
        for i in 1..628 {
            let theta = f64::from(i) * 0.01;
            for j in -97..=100 {
                let r_a = f64::from(j) * 0.01;
                let embedded = embedded_angle(theta, r_a);
                assert!((embedded - printed(theta, r_a)).abs() < 1e-14, "{theta} {r_a}");
                let back = angle_ratio(theta, embedded - PI);
                assert!((back - r_a).abs() < 1e-9, "{theta} {r_a} {back}");
            }
        }
    }

    #[test]
    fn other_side_and_straight_targets() {
        assert!((angle_ratio(PI - 1.0, 0.5) - (1.0 + 0.5 / PI)).abs() < 1e-15);
        assert!((angle_ratio(PI + 1.0, -3.0) - (1.0 + 3.0 / PI)).abs() < 1e-15);
        assert!((angle_ratio(PI, 0.5) + 0.5 / PI).abs() < 1e-15);
        assert_eq!(angle_ratio(PI, 0.0), 0.0);
        assert_eq!(angle_ratio(2.0, 0.0), 1.0);
        assert!((angle_ratio(2.0, -PI) + 1.0).abs() < 1e-15);
        assert!((angle_ratio(4.0, -PI) + 1.0).abs() < 1e-15);
    }
}
