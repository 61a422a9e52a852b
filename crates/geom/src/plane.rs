//! Planar segments: exact crossing test and distances.
//!
//! **Source** Adaptive-precision orientation predicates of Shewchuk (crate `robust`): the sign is exact for
//! any finite coordinates, so "crosses" is a statement about the numbers themselves, not about a tolerance.

use glam::DVec2;

/// A planar segment from `a` to `b`, in plane mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// First end.
    pub a: DVec2,
    /// Second end.
    pub b: DVec2,
}

/// On which side of the directed line `a → b` the point `c` lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Counter-clockwise.
    Left,
    /// Exactly on the line.
    On,
    /// Clockwise.
    Right,
}

/// The exact side of `c` as seen from `a → b`.
#[must_use]
pub fn side(a: DVec2, b: DVec2, c: DVec2) -> Side {
    let coord = |p: DVec2| robust::Coord { x: p.x, y: p.y };
    let twice_area = robust::orient2d(coord(a), coord(b), coord(c));
    if twice_area > 0.0 {
        Side::Left
    } else if twice_area < 0.0 {
        Side::Right
    } else {
        Side::On
    }
}

/// Whether two closed segments have at least one point in common, exactly: touching and collinear overlap count.
///
/// ```
/// use espalier_geom::plane::{Segment, intersect};
/// use glam::DVec2;
/// let flat = Segment { a: DVec2::ZERO, b: DVec2::X };
/// let touching = Segment { a: DVec2::new(0.5, 0.0), b: DVec2::new(0.5, 1.0) };
/// let apart = Segment { a: DVec2::new(0.5, 1e-300), b: DVec2::new(0.5, 1.0) };
/// assert!(intersect(&flat, &touching));
/// assert!(!intersect(&flat, &apart));
/// ```
#[must_use]
pub fn intersect(s: &Segment, t: &Segment) -> bool {
    if !boxes_meet(s, t) {
        return false;
    }
    let (ta, tb) = (side(s.a, s.b, t.a), side(s.a, s.b, t.b));
    if ta == tb && ta != Side::On {
        return false;
    }
    let (sa, sb) = (side(t.a, t.b, s.a), side(t.a, t.b, s.b));
    // All four on one line: the boxes meet, so the segments do.
    sa != sb || sa == Side::On
}

/// Whether two segments that share the point `hub` (`hub → s_tip`, `hub → t_tip`) have any other point in common.
///
/// They do exactly if both point the same way from the hub, or if one of them has no length.
#[must_use]
pub fn overlap_beyond_hub(hub: DVec2, s_tip: DVec2, t_tip: DVec2) -> bool {
    if s_tip == hub || t_tip == hub {
        return true;
    }
    if side(hub, s_tip, t_tip) != Side::On {
        return false;
    }
    // Collinear: compare signs of coordinate differences, which subtraction gives exactly.
    let same_sign = |hub: f64, s: f64, t: f64| (s > hub && t > hub) || (s < hub && t < hub);
    same_sign(hub.x, s_tip.x, t_tip.x) || same_sign(hub.y, s_tip.y, t_tip.y)
}

fn boxes_meet(s: &Segment, t: &Segment) -> bool {
    s.a.x.min(s.b.x) <= t.a.x.max(t.b.x)
        && t.a.x.min(t.b.x) <= s.a.x.max(s.b.x)
        && s.a.y.min(s.b.y) <= t.a.y.max(t.b.y)
        && t.a.y.min(t.b.y) <= s.a.y.max(s.b.y)
}

/// The distance from a point to a segment, in mm.
#[must_use]
pub fn distance_to_segment(point: DVec2, segment: &Segment) -> f64 {
    point.distance(segment.a.lerp(segment.b, nearest_parameter(point, segment)))
}

/// The parameter in [0, 1] of the point of `segment` that is nearest to `point`; 0 if the segment has no length.
#[must_use]
pub fn nearest_parameter(point: DVec2, segment: &Segment) -> f64 {
    let along = segment.b - segment.a;
    let length_squared = along.length_squared();
    if length_squared == 0.0 {
        0.0
    } else {
        ((point - segment.a).dot(along) / length_squared).clamp(0.0, 1.0)
    }
}

/// The distance between two segments, in mm; 0 if they meet.
#[must_use]
pub fn segment_distance(s: &Segment, t: &Segment) -> f64 {
    if intersect(s, t) {
        return 0.0;
    }
    distance_to_segment(s.a, t)
        .min(distance_to_segment(s.b, t))
        .min(distance_to_segment(t.a, s))
        .min(distance_to_segment(t.b, s))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segment(ax: f64, ay: f64, bx: f64, by: f64) -> Segment {
        Segment { a: DVec2::new(ax, ay), b: DVec2::new(bx, by) }
    }

    #[test]
    fn proper_touching_collinear_and_apart() {
        let base = segment(0.0, 0.0, 4.0, 0.0);
        for (other, expected) in [
            (segment(1.0, -1.0, 1.0, 1.0), true),
            (segment(1.0, 0.0, 1.0, 1.0), true),
            (segment(4.0, 0.0, 5.0, 1.0), true),
            (segment(3.0, 0.0, 9.0, 0.0), true),
            (segment(4.5, 0.0, 9.0, 0.0), false),
            (segment(1.0, 1.0, 3.0, 1.0), false),
            (segment(-1.0, 1.0, -1.0, -1.0), false),
            (segment(5.0, -1.0, 4.0, 1.0), false),
            (segment(2.0, 0.0, 2.0, 0.0), true),
            (segment(2.0, 0.1, 2.0, 0.1), false),
        ] {
            assert_eq!(intersect(&base, &other), expected, "{other:?}");
            assert_eq!(intersect(&other, &base), expected, "{other:?} swapped");
            assert_eq!(segment_distance(&base, &other) == 0.0, expected, "{other:?} distance");
        }
    }

    #[test]
    fn hub_sharing() {
        let hub = DVec2::new(1.0, 1.0);
        let tip = |x, y| DVec2::new(x, y);
        assert!(!overlap_beyond_hub(hub, tip(2.0, 1.0), tip(0.0, 1.0)));
        assert!(overlap_beyond_hub(hub, tip(2.0, 1.0), tip(3.0, 1.0)));
        assert!(!overlap_beyond_hub(hub, tip(2.0, 1.0), tip(3.0, 1.0 + 1e-15)));
        assert!(overlap_beyond_hub(hub, tip(2.0, 2.0), tip(5.0, 5.0)));
        assert!(overlap_beyond_hub(hub, hub, tip(5.0, 5.0)));
    }
}
