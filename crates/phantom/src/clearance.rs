//! Keeping branches apart.
//!
//! **Input** the branches placed so far and a new one. **Output** whether the new one keeps its distance.
//! **Notation** a branch is a chain of balls; its box holds them all.
//! **Cost** O(branches) box tests, and O(edges²) for the few branches whose boxes meet.

use glam::DVec3;

/// A placed branch: its polyline with radii, hub included.
#[derive(Clone, Debug)]
struct Placed {
    balls: Vec<(DVec3, f64)>,
    low: DVec3,
    high: DVec3,
}

/// All branches placed so far.
#[derive(Clone, Debug, Default)]
pub(crate) struct Occupied {
    branches: Vec<Placed>,
}

impl Occupied {
    /// Adds a branch and returns its number.
    pub(crate) fn add(&mut self, balls: Vec<(DVec3, f64)>) -> usize {
        let (low, high) = bounds(&balls);
        self.branches.push(Placed { balls, low, high });
        self.branches.len() - 1
    }

    /// Whether `balls` stays at least `clearance_mm` away from the surface of every branch but `parent`.
    pub(crate) fn is_clear(&self, balls: &[(DVec3, f64)], parent: usize, clearance_mm: f64) -> bool {
        let (low, high) = bounds(balls);
        self.branches.iter().enumerate().all(|(branch_idx, placed)| {
            let is_far = (placed.low - high).max_element() > clearance_mm
                || (low - placed.high).max_element() > clearance_mm;
            branch_idx == parent || is_far || are_apart(&placed.balls, balls, clearance_mm)
        })
    }
}

fn bounds(balls: &[(DVec3, f64)]) -> (DVec3, DVec3) {
    balls.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &(center, radius)| {
        (low.min(center - radius), high.max(center + radius))
    })
}

/// Whether two chains keep `clearance_mm` between their surfaces; each edge counts with its larger radius.
fn are_apart(one: &[(DVec3, f64)], other: &[(DVec3, f64)], clearance_mm: f64) -> bool {
    one.windows(2).all(|s| {
        other.windows(2).all(|t| {
            let reach = s[0].1.max(s[1].1) + t[0].1.max(t[1].1) + clearance_mm;
            segment_distance([s[0].0, s[1].0], [t[0].0, t[1].0]) >= reach
        })
    })
}

/// The distance between two segments in space.
pub(crate) fn segment_distance(s: [DVec3; 2], t: [DVec3; 2]) -> f64 {
    let (d1, d2, r) = (s[1] - s[0], t[1] - t[0], s[0] - t[0]);
    let (a, e, b) = (d1.length_squared(), d2.length_squared(), d1.dot(d2));
    let (c, f) = (d1.dot(r), d2.dot(r));
    let denominator = a * e - b * b;
    // The nearest point of s to the line of t, then the nearest of t to it, then back; clamping each.
    let mut u =
        if denominator > 1e-12 * a * e { ((b * f - c * e) / denominator).clamp(0.0, 1.0) } else { 0.0 };
    let v = if e > 0.0 { ((b * u + f) / e).clamp(0.0, 1.0) } else { 0.0 };
    if a > 0.0 {
        u = ((b * v - c) / a).clamp(0.0, 1.0);
    }
    (s[0] + u * d1).distance(t[0] + v * d2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use espalier_geom::random::{Purpose, Stream};

    /// Against a dense sampling of both segments.
    #[test]
    fn segment_distance_is_the_minimum() {
        let mut stream = Stream::new(3, Purpose::Test, 0, 0);
        let mut point = || DVec3::new(stream.unit(), stream.unit(), stream.unit());
        for _ in 0..200 {
            let (s, t) = ([point(), point()], [point(), point()]);
            let sampled = (0..=200)
                .map(|i| {
                    let p = s[0].lerp(s[1], f64::from(i) / 200.0);
                    espalier_geom::space::distance_to_segment(p, t[0], t[1])
                })
                .fold(f64::INFINITY, f64::min);
            let exact = segment_distance(s, t);
            assert!(exact <= sampled + 1e-12 && sampled < exact + 0.01, "{exact} {sampled} {s:?} {t:?}");
        }
    }
}
