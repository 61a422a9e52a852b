//! Corners filled: two levels become one.
//!
//! **Input** two levels g and h, a width k. **Output** their smooth maximum, and the share that the second has in it.
//! **Notation** r₁ ≤ r₂ radii, ψ the angle between the normals, s = r₁ √(r₁ r₂).
//! **Steps** where |g − h| < k the maximum becomes max + (k − |g − h|)²/4k, which rounds the corner in the outline and the
//! crease in the surface at once. Of branches k = 2 κ s sin(ψ/2). Of cones of one branch k = 8 s (1 − cos(ψ/2)), at most
//! as much: the outline of two tubes that turn by φ moves by k/8r on the bisector of the inner corner, and a circle of
//! radius r by r (1 − cos(φ/2)), so a bend is as round inside as its ball makes it outside.
//! **Guarantees** continuous in everything; with ψ = 0 nothing is added. The ball at the end of a cone adds nothing to
//! the cone that runs straight on from it: at a distance t it lies t² lower, and k ≤ r² ψ² ≤ t².
//! **Source** Joining by the angle of the gradients: [Gourmel2013]; the quadratic smooth maximum is folklore of implicit
//! modelling; the width for bends is ours.

/// κ: the size of the fillets between branches, in radii.
const FILLET: f32 = 0.7;

/// The width of the join of two branches, by their radii and the cosine between their normals.
pub(super) fn of_branches(radii: [f32; 2], cosine: f32) -> f32 {
    2.0 * FILLET * scale(radii) * half_angle(cosine)[0]
}

/// The width of the join of two cones of one branch.
pub(super) fn of_bend(radii: [f32; 2], cosine: f32) -> f32 {
    let [sin, cos] = half_angle(cosine);
    // 1 − cos, without the digits that the difference would lose.
    scale(radii) * (8.0 * sin * sin / (1.0 + cos)).min(2.0 * FILLET * sin)
}

/// Levels that differ by more are never joined.
pub(super) fn widest(radii: [f32; 2]) -> f32 {
    2.0 * FILLET * scale(radii)
}

/// The smooth maximum of two levels, and the share of the second.
pub(super) fn smooth_max(first: f32, second: f32, k: f32) -> (f32, f32) {
    let apart = (first - second).abs();
    if apart >= k {
        return if second > first { (second, 1.0) } else { (first, 0.0) };
    }
    let nearness = 1.0 - apart / k;
    let of_lower = 0.5 * nearness;
    let share = if second > first { 1.0 - of_lower } else { of_lower };
    (first.max(second) + 0.25 * k * nearness * nearness, share)
}

fn scale(radii: [f32; 2]) -> f32 {
    let (small, large) = (radii[0].min(radii[1]), radii[0].max(radii[1]));
    small * (small * large).sqrt()
}

/// Sine and cosine of half an angle up to 180°.
fn half_angle(cosine: f32) -> [f32; 2] {
    [0.5 * (1.0 - cosine), 0.5 * (1.0 + cosine)].map(|square| square.max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_far_apart_are_their_maximum_and_equal_ones_gain_most() {
        assert_eq!(smooth_max(1.0, 3.0, 2.0), (3.0, 1.0));
        assert_eq!(smooth_max(3.0, 1.0, 0.0), (3.0, 0.0));
        assert_eq!(smooth_max(3.0, 3.0, 2.0), (3.5, 0.5));
        assert_eq!(smooth_max(0.0, 0.0, 0.0), (0.0, 0.0));
        // Continuous where it begins, and symmetric.
        assert!((smooth_max(0.0, 1.0, 1.0001).0 - 1.0).abs() < 1e-6);
        assert_eq!(smooth_max(0.25, 0.75, 1.0).0, smooth_max(0.75, 0.25, 1.0).0);
    }

    #[test]
    fn a_ball_adds_nothing_to_a_cone_that_runs_straight_on() {
        // Beside the outline of a tube of radius 1, and t along it from where it ends: the ball's normal leans back.
        for step in 1..200_u8 {
            let t = 0.01 * f32::from(step);
            let cosine = 1.0 / (1.0 + t * t).sqrt();
            // A normal has seven digits.
            assert!(of_bend([1.0; 2], cosine) <= t * t + 1e-6, "{t}");
        }
    }

    #[test]
    fn a_bend_is_as_round_inside_as_outside() {
        for turn_deg in [5.0_f64, 10.0, 20.0, 35.0] {
            let half = 0.5 * turn_deg.to_radians();
            let cosine = espalier_geom::math::cos(2.0 * half) as f32;
            let moved = f64::from(of_bend([2.0; 2], cosine)) / 16.0;
            let of_circle = 2.0 * (1.0 - espalier_geom::math::cos(half));
            assert!((moved - of_circle).abs() < 1e-3 * of_circle + 1e-6, "{turn_deg}: {moved} {of_circle}");
        }
    }
}
