//! Rectangles in any direction, around edges.
//!
//! **Guarantees** a rectangle around two holds both, up to rounding.
//! **Source** the separating axis test of [Gottschalk1996], in the plane.

use glam::DVec2;

use super::isometry::Isometry;

/// A rectangle; an empty one has no extent at all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rectangle {
    pub(super) center: DVec2,
    /// The direction of its first side, of length 1.
    axis: DVec2,
    /// Half the length of both sides.
    half: DVec2,
}

impl Rectangle {
    pub(super) const EMPTY: Self = Self { center: DVec2::ZERO, axis: DVec2::X, half: DVec2::NEG_INFINITY };

    /// Around a segment with a direction of length 1.
    pub(super) fn of_segment((start, end): (DVec2, DVec2), axis: DVec2) -> Self {
        Self { center: 0.5 * (start + end), axis, half: DVec2::new(0.5 * start.distance(end), 0.0) }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.half.x < 0.0
    }

    /// Half the sum of the sides.
    pub(super) fn size(&self) -> f64 {
        self.half.x + self.half.y
    }

    pub(super) fn moved(&self, isometry: &Isometry) -> Self {
        Self { center: isometry.point(self.center), axis: isometry.direction(self.axis), half: self.half }
    }

    /// How far it reaches from its center along a direction.
    #[inline]
    fn reach(&self, direction: DVec2) -> f64 {
        self.half.x * self.axis.dot(direction).abs() + self.half.y * self.axis.perp_dot(direction).abs()
    }

    /// Whether no side of either is farther than a margin from the other; never false for what is nearer.
    #[inline]
    pub(super) fn is_near(&self, other: &Self, margin_mm: f64) -> bool {
        let offset = other.center - self.center;
        let (along, across) = (self.axis.dot(other.axis).abs(), self.axis.perp_dot(other.axis).abs());
        offset.dot(self.axis).abs() <= self.half.x + other.half.x * along + other.half.y * across + margin_mm
            && offset.perp_dot(self.axis).abs()
                <= self.half.y + other.half.x * across + other.half.y * along + margin_mm
            && offset.dot(other.axis).abs()
                <= other.half.x + self.half.x * along + self.half.y * across + margin_mm
            && offset.perp_dot(other.axis).abs()
                <= other.half.y + self.half.x * across + self.half.y * along + margin_mm
    }

    /// A rectangle around both: along the larger one, or from one to the other, whichever is smaller.
    pub(super) fn around(&self, other: &Self) -> Self {
        if self.is_empty() || other.is_empty() {
            return if self.is_empty() { *other } else { *self };
        }
        let larger = if self.size() >= other.size() { self } else { other };
        let first = self.around_along(other, larger.axis);
        match (other.center - self.center).try_normalize() {
            Some(axis) => {
                let second = self.around_along(other, axis);
                if second.size() < first.size() { second } else { first }
            }
            None => first,
        }
    }

    /// A rectangle around all, along the largest.
    pub(super) fn around_all<'r>(all: impl Iterator<Item = &'r Self> + Clone) -> Self {
        let larger = |a: &'r Self, b: &'r Self| if b.size() > a.size() { b } else { a };
        let Some(largest) = all.clone().reduce(larger).filter(|largest| !largest.is_empty()) else {
            return Self::EMPTY;
        };
        let (axis, across) = (largest.axis, largest.axis.perp());
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for rectangle in all.filter(|rectangle| !rectangle.is_empty()) {
            let center = DVec2::new(rectangle.center.dot(axis), rectangle.center.dot(across));
            let reach = DVec2::new(rectangle.reach(axis), rectangle.reach(across));
            (low, high) = (low.min(center - reach), high.max(center + reach));
        }
        let middle = 0.5 * (low + high);
        Self { center: axis * middle.x + across * middle.y, axis, half: 0.5 * (high - low) }
    }

    fn around_along(&self, other: &Self, axis: DVec2) -> Self {
        let interval = |direction: DVec2| {
            let (a, b) = (self.center.dot(direction), other.center.dot(direction));
            let (reach_a, reach_b) = (self.reach(direction), other.reach(direction));
            ((a - reach_a).min(b - reach_b), (a + reach_a).max(b + reach_b))
        };
        let ((low, high), (left, right)) = (interval(axis), interval(axis.perp()));
        let center = axis * (0.5 * (low + high)) + axis.perp() * (0.5 * (left + right));
        Self { center, axis, half: 0.5 * DVec2::new(high - low, right - left) }
    }
}

#[cfg(test)]
mod tests {
    use espalier_geom::math::unit_vector;
    use espalier_geom::plane::{Segment, segment_distance};

    use super::*;
    use crate::common::stream;

    #[test]
    fn holds_what_it_is_around() {
        let mut stream = stream(5300);
        for round in 0..500 {
            let mut segments = Vec::new();
            let mut group = |n: usize, far: f64| {
                let mut whole = Rectangle::EMPTY;
                let at = DVec2::new(stream.normal(), stream.normal()) * far;
                for _ in 0..n {
                    let axis = unit_vector(stream.uniform(0.0, 7.0));
                    let a = at + DVec2::new(stream.normal(), stream.normal());
                    let b = a + axis * stream.unit();
                    segments.push(Segment { a, b });
                    whole = whole.around(&Rectangle::of_segment((a, b), axis));
                }
                whole
            };
            let (first, second) = (group(5, 0.0), group(4, 4.0));
            let distances =
                segments[..5].iter().flat_map(|s| segments[5..].iter().map(|t| segment_distance(s, t)));
            let nearest = distances.fold(f64::INFINITY, f64::min);
            assert!(first.is_near(&second, nearest * (1.0 + 1e-9) + 1e-12), "round {round}");
            let both = Rectangle::around_all([first, second, Rectangle::EMPTY].iter());
            assert!(
                both.is_near(&first, 1e-12) && both.size() + 1e-9 > first.size().max(second.size()) / 1.5
            );
            for Segment { a, b } in &segments {
                assert!(both.is_near(&Rectangle::of_segment((*a, *b), DVec2::X), 1e-9));
            }
            assert!(!first.is_near(&Rectangle::EMPTY, 1.0) && !Rectangle::EMPTY.is_near(&second, 1.0));
        }
    }
}
