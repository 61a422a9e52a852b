//! Angles in radians: wrapping, headings, turns, interior angles.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

use crate::math;

/// The same angle in [−π, π).
///
/// ```
/// use espalier_geom::angle::wrap;
/// assert!((wrap(7.0) - (7.0 - std::f64::consts::TAU)).abs() < 1e-12);
/// ```
#[must_use]
pub fn wrap(angle_rad: f64) -> f64 {
    let wrapped = angle_rad - TAU * math::floor((angle_rad + PI) / TAU);
    // Rounding can land exactly on +π for arguments just below it.
    if wrapped >= PI { wrapped - TAU } else { wrapped }
}

/// The same angle in [0, 2π).
#[must_use]
pub fn wrap_positive(angle_rad: f64) -> f64 {
    let wrapped = angle_rad - TAU * math::floor(angle_rad / TAU);
    if wrapped >= TAU { wrapped - TAU } else { wrapped }
}

/// The heading of a planar vector: counter-clockwise from the x axis, in (−π, π].
#[must_use]
pub fn heading(vector: DVec2) -> f64 {
    math::atan2(vector.y, vector.x)
}

/// The counter-clockwise angle from `from` to `to`, in [0, 2π).
#[must_use]
pub fn ccw(from: DVec2, to: DVec2) -> f64 {
    wrap_positive(math::atan2(from.perp_dot(to), from.dot(to)))
}

/// The unsigned angle between two vectors, in [0, π]; 0 if either has no length.
///
/// Stays accurate near 0 and π, where an arc cosine would not.
#[must_use]
pub fn between(a: DVec3, b: DVec3) -> f64 {
    math::atan2(a.cross(b).length(), a.dot(b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrapping_stays_in_range() {
        for i in -1000..1000 {
            let angle = f64::from(i) * 0.1;
            assert!((-PI..PI).contains(&wrap(angle)));
            assert!((0.0..TAU).contains(&wrap_positive(angle)));
            assert!((math::sin(wrap(angle)) - math::sin(angle)).abs() < 1e-9);
        }
        assert_eq!(wrap(PI), -PI);
        assert_eq!(wrap_positive(-1e-300), 0.0);
    }

    #[test]
    fn ccw_is_counter_clockwise() {
        assert!((ccw(DVec2::X, DVec2::Y) - PI / 2.0).abs() < 1e-15);
        assert!((ccw(DVec2::Y, DVec2::X) - 1.5 * PI).abs() < 1e-15);
    }
}
