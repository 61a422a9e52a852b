//! Boxes with axes of their own: around edges, around two boxes, moved, and whether two are apart.
//!
//! **Cost** a fixed number of operations each; a box around two boxes tries three axes.

use espalier_geom::plane::Segment;
use glam::DVec2;

use super::similarity::Similarity;

/// A box with its own axes; without edges if a half width is negative.
#[derive(Clone, Copy)]
pub(super) struct OrientedBox {
    center: DVec2,
    axis: DVec2,
    half: DVec2,
}

impl OrientedBox {
    pub(super) const EMPTY: Self = Self { center: DVec2::ZERO, axis: DVec2::X, half: DVec2::NEG_ONE };

    fn is_empty(&self) -> bool {
        self.half.x < 0.0
    }

    /// The box of a few edges along the line from the first to the last of them.
    pub(super) fn around(edges: &[Segment]) -> Self {
        let (Some(first), Some(last)) = (edges.first(), edges.last()) else { return Self::EMPTY };
        let axis = (last.b - first.a).try_normalize().unwrap_or(DVec2::X);
        Self::of_points(edges.iter().flat_map(|edge| [edge.a, edge.b]), axis)
    }

    pub(super) fn of_points(points: impl Iterator<Item = DVec2>, axis: DVec2) -> Self {
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for point in points {
            let own = DVec2::new(axis.dot(point), axis.perp_dot(point));
            (low, high) = (low.min(own), high.max(own));
        }
        Self { center: axis.rotate(0.5 * (low + high)), axis, half: 0.5 * (high - low) }
    }

    /// A box around two boxes: the smallest of those along either's axis or along the line between them.
    pub(super) fn joined(&self, other: &Self) -> Self {
        if self.is_empty() || other.is_empty() {
            return if other.is_empty() { *self } else { *other };
        }
        let between = (other.center - self.center).try_normalize().unwrap_or(self.axis);
        let corners = || self.corners().into_iter().chain(other.corners());
        let mut best = Self::of_points(corners(), between);
        for axis in [self.axis, other.axis] {
            let candidate = Self::of_points(corners(), axis);
            if candidate.size() < best.size() {
                best = candidate;
            }
        }
        best
    }

    /// The upright box around this one.
    pub(super) fn upright(&self) -> Self {
        let axis = self.axis.abs();
        let half = DVec2::new(
            axis.x * self.half.x + axis.y * self.half.y,
            axis.y * self.half.x + axis.x * self.half.y,
        );
        if self.is_empty() { *self } else { Self { center: self.center, axis: DVec2::X, half } }
    }

    /// The box around two upright boxes.
    pub(super) fn joined_upright(&self, other: &Self) -> Self {
        if self.is_empty() || other.is_empty() {
            return if other.is_empty() { *self } else { *other };
        }
        let low = (self.center - self.half).min(other.center - other.half);
        let high = (self.center + self.half).max(other.center + other.half);
        Self { center: 0.5 * (low + high), axis: DVec2::X, half: 0.5 * (high - low) }
    }

    /// Half the girth, so that thin boxes compare too.
    pub(super) fn size(&self) -> f64 {
        self.half.x + self.half.y
    }

    fn corners(&self) -> [DVec2; 4] {
        let (along, across) = (self.axis * self.half.x, self.axis.perp() * self.half.y);
        [
            self.center + along + across,
            self.center + along - across,
            self.center - along + across,
            self.center - along - across,
        ]
    }

    #[inline]
    pub(super) fn moved(&self, motion: &Similarity) -> Self {
        if *motion == Similarity::IDENTITY || self.is_empty() {
            return *self;
        }
        let scale = motion.scale();
        Self {
            center: motion.of(self.center),
            axis: motion.turn.rotate(self.axis) / scale,
            half: self.half * scale,
        }
    }

    /// Whether one of the four axes shows a gap of more than the margin.
    #[inline]
    pub(super) fn is_apart(&self, other: &Self, margin: f64) -> bool {
        if self.is_empty() || other.is_empty() {
            return true;
        }
        let between = other.center - self.center;
        let (cos, sin) = (self.axis.dot(other.axis).abs(), self.axis.perp_dot(other.axis).abs());
        let swap = |half: DVec2| DVec2::new(half.x * cos + half.y * sin, half.x * sin + half.y * cos);
        let reach = self.half + swap(other.half) + DVec2::splat(margin);
        let other_reach = other.half + swap(self.half) + DVec2::splat(margin);
        self.axis.dot(between).abs() > reach.x
            || self.axis.perp_dot(between).abs() > reach.y
            || other.axis.dot(between).abs() > other_reach.x
            || other.axis.perp_dot(between).abs() > other_reach.y
    }
}
