//! Where two edges are nearest, and what the barrier makes of it.
//!
//! **Input** two segments. **Output** their distance, the nearest points, and the direction between them.
//! **Definition** b(u) = −(u − 1)² ln u for 0 < u < 1, 0 above: twice differentiable at 1, infinite at 0.
//! **Source** b is the barrier of [Li2020], Eq. 6, over d instead of d².
//! **Cost** O(1).

use espalier_geom::math;
use glam::DVec2;

use super::pairs::Bounds;

/// Both ends of both edges of a pair.
pub(super) type Ends = ((DVec2, DVec2), (DVec2, DVec2));

/// The nearest points of two segments.
#[derive(Clone, Copy, Debug)]
pub(super) struct Contact {
    /// 0 where they cross.
    pub(super) distance: f64,
    /// Where on the first segment, from 0 at its start to 1 at its end.
    pub(super) along_first: f64,
    /// Where on the second.
    pub(super) along_second: f64,
    /// From the second's point to the first's, of length 1; zero where they cross.
    pub(super) normal: DVec2,
}

impl Contact {
    /// Between the segments p0 → p1 and q0 → q1.
    pub(super) fn between((p0, p1): (DVec2, DVec2), (q0, q1): (DVec2, DVec2)) -> Self {
        let (p, q) = (p1 - p0, q1 - q0);
        let start = q0 - p0;
        let (side_q0, side_q1) = (p.perp_dot(start), p.perp_dot(q1 - p0));
        let (side_p0, side_p1) = (-q.perp_dot(start), q.perp_dot(p1 - q0));
        if side_q0 * side_q1 < 0.0 && side_p0 * side_p1 < 0.0 {
            return Self { distance: 0.0, along_first: 0.0, along_second: 0.0, normal: DVec2::ZERO };
        }
        let mut best = (f64::INFINITY, 0.0, 0.0, DVec2::ZERO);
        let mut offer = |along_first: f64, along_second: f64| {
            let apart = p * along_first - start - q * along_second;
            let squared = apart.length_squared();
            if squared < best.0 {
                best = (squared, along_first, along_second, apart);
            }
        };
        let (per_p, per_q) = (inverse_or_zero(p.length_squared()), inverse_or_zero(q.length_squared()));
        offer(0.0, (-start.dot(q) * per_q).clamp(0.0, 1.0));
        offer(1.0, ((p - start).dot(q) * per_q).clamp(0.0, 1.0));
        offer((start.dot(p) * per_p).clamp(0.0, 1.0), 0.0);
        offer(((start + q).dot(p) * per_p).clamp(0.0, 1.0), 1.0);
        let (squared, along_first, along_second, apart) = best;
        let distance = squared.sqrt();
        Self { distance, along_first, along_second, normal: apart * inverse_or_zero(distance) }
    }
}

/// What the barrier of one pair is, and does: its value, infinite where the edges meet, and its derivative by the
/// first edge's nearest point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Push {
    pub(super) value: f64,
    pub(super) on_first: DVec2,
    pub(super) along_first: f64,
    pub(super) along_second: f64,
}

impl Push {
    pub(super) const NONE: Self =
        Self { value: 0.0, on_first: DVec2::ZERO, along_first: 0.0, along_second: 0.0 };

    /// Of two edges by their ends.
    pub(super) fn between((p, q): Ends, bounds: &Bounds) -> Self {
        if are_apart(p, q, bounds.floor_mm + bounds.width_mm) {
            return Self::NONE;
        }
        Self::of(&Contact::between(p, q), bounds)
    }

    /// Of two edges by their nearest points.
    pub(super) fn of(contact: &Contact, bounds: &Bounds) -> Self {
        let u = (contact.distance - bounds.floor_mm) / bounds.width_mm;
        if u >= 1.0 {
            return Self::NONE;
        }
        if u <= 0.0 {
            return Self { value: f64::INFINITY, ..Self::NONE };
        }
        let (value, slope, _) = barrier(u);
        let on_first = contact.normal * (slope / bounds.width_mm);
        Self { value, on_first, along_first: contact.along_first, along_second: contact.along_second }
    }
}

/// Whether two segments are farther apart than `reach` for sure: the discs about them are.
pub(super) fn are_apart((p0, p1): (DVec2, DVec2), (q0, q1): (DVec2, DVec2), reach: f64) -> bool {
    let between = 0.5 * ((p0 + p1) - (q0 + q1));
    let (p, q) = ((p1 - p0).length_squared(), (q1 - q0).length_squared());
    // (a + b)² ≤ 2 (a² + b²) spares the roots: half lengths are √p / 2 and √q / 2.
    let halves = (0.5 * (p + q)).sqrt();
    between.length_squared() > (halves + reach) * (halves + reach)
}

fn inverse_or_zero(x: f64) -> f64 {
    if x > 0.0 { 1.0 / x } else { 0.0 }
}

/// b(u), b′(u) and b″(u) for u > 0.
pub(super) fn barrier(u: f64) -> (f64, f64, f64) {
    if u >= 1.0 {
        return (0.0, 0.0, 0.0);
    }
    let (ln, below) = (math::ln(u), u - 1.0);
    let ratio = below / u;
    (-below * below * ln, -2.0 * below * ln - below * ratio, -2.0 * ln - 4.0 * ratio + ratio * ratio)
}

#[cfg(test)]
mod tests {
    use espalier_geom::plane::{Segment, segment_distance};

    use super::*;
    use crate::common::stream;

    #[test]
    fn distance_is_that_of_the_exact_routine() {
        let mut stream = stream(5100);
        for round in 0..20_000 {
            let mut point = || DVec2::new(stream.normal(), stream.normal());
            let (a, b, c) = (point(), point(), point());
            // Some edges have no length, some lie along each other.
            let d = match round % 10 {
                0 => c,
                1 => c + (b - a),
                _ => point(),
            };
            let exact = segment_distance(&Segment { a, b }, &Segment { a: c, b: d });
            let contact = Contact::between((a, b), (c, d));
            assert!((contact.distance - exact).abs() < 1e-12, "{round}: {exact} {contact:?}");
            let apart = a.lerp(b, contact.along_first) - c.lerp(d, contact.along_second);
            assert!(apart.distance(contact.normal * contact.distance) < 1e-12 || exact == 0.0);
        }
    }

    #[test]
    fn barrier_has_the_derivatives_it_says() {
        for i in 1..120 {
            let (u, h) = (f64::from(i) * 0.01, 1e-6);
            let (value, slope, curvature) = barrier(u);
            let ((low, low_slope, _), (high, high_slope, _)) = (barrier(u - h), barrier(u + h));
            assert!((slope - (high - low) / (2.0 * h)).abs() < 1e-5 * slope.abs().max(1.0), "{u}");
            assert!(
                (curvature - (high_slope - low_slope) / (2.0 * h)).abs() < 1e-4 * curvature.abs().max(1.0),
                "{u}"
            );
            assert!(value >= 0.0 && slope <= 0.0 && curvature >= 0.0);
        }
    }
}
