//! Segments and directions in three dimensions.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use crate::math;

/// The parameter in [0, 1] of the point of `a → b` nearest to `point`; 0 if the segment has no length.
#[must_use]
pub fn nearest_parameter(point: DVec3, a: DVec3, b: DVec3) -> f64 {
    let along = b - a;
    let length_squared = along.length_squared();
    if length_squared == 0.0 { 0.0 } else { ((point - a).dot(along) / length_squared).clamp(0.0, 1.0) }
}

/// The distance from `point` to the segment `a → b`.
#[must_use]
pub fn distance_to_segment(point: DVec3, a: DVec3, b: DVec3) -> f64 {
    point.distance(a.lerp(b, nearest_parameter(point, a, b)))
}

/// Two unit vectors `(right, up)` with `right × up = normal`, for a unit `normal`.
///
/// `up` is as near to `up_hint` as it can be; where the hint is parallel to the normal, an axis stands in.
#[must_use]
pub fn plane_axes(normal: DVec3, up_hint: DVec3) -> (DVec3, DVec3) {
    let flat_hint = up_hint - normal * up_hint.dot(normal);
    let up = if flat_hint.length_squared() > 1e-16 * up_hint.length_squared().max(f64::MIN_POSITIVE) {
        flat_hint.normalize()
    } else {
        let axis = if normal.y.abs() < 0.9 { DVec3::Y } else { DVec3::X };
        (axis - normal * axis.dot(normal)).normalize()
    };
    (up.cross(normal), up)
}

/// `count` directions spread evenly over the half sphere z ≥ 0 on a Fibonacci spiral.
///
/// ```
/// assert!(espalier_geom::space::half_sphere(100).all(|d| d.z > 0.0 && (d.length() - 1.0).abs() < 1e-12));
/// ```
pub fn half_sphere(count: usize) -> impl Iterator<Item = DVec3> {
    let golden_angle = PI * (3.0 - 5.0_f64.sqrt());
    (0..count).map(move |i| {
        let z = 1.0 - (i as f64 + 0.5) / count as f64;
        let ring = (1.0 - z * z).sqrt();
        let (sin, cos) = math::sin_cos((golden_angle * i as f64) % TAU);
        DVec3::new(ring * cos, ring * sin, z)
    })
}

/// Half the diagonal of the box around the points: how far one can be from its centre. 0 for no point.
#[must_use]
pub fn extent(points: impl Iterator<Item = DVec3>) -> f64 {
    let (low, high) = points
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), point| (low.min(point), high.max(point)));
    if low.cmpgt(high).any() { 0.0 } else { 0.5 * (high - low).length() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_right_handed() {
        for normal in half_sphere(50) {
            let (right, up) = plane_axes(normal, DVec3::Z);
            assert!((right.cross(up) - normal).length() < 1e-12);
        }
        let (right, up) = plane_axes(DVec3::Z, DVec3::Z);
        assert!((right.cross(up) - DVec3::Z).length() < 1e-12);
    }
}
