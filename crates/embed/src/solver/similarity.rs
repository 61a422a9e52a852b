//! Similarities of the plane: what a change of ratios does to a part of a layout.
//!
//! **Definition** z → m z + t in complex numbers: m turns and scales, t shifts.

use glam::DVec2;

/// A turn with a scale, then a shift.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Similarity {
    /// Cosine and sine of the turn, times the scale.
    pub(crate) turn: DVec2,
    pub(crate) shift: DVec2,
}

impl Similarity {
    pub(crate) const IDENTITY: Self = Self { turn: DVec2::X, shift: DVec2::ZERO };

    /// Turns and scales about a point that stays.
    pub(crate) fn about(pivot: DVec2, turn: DVec2) -> Self {
        Self { turn, shift: pivot - turn.rotate(pivot) }
    }

    /// The image of a point.
    #[inline]
    pub(crate) fn of(&self, point: DVec2) -> DVec2 {
        self.turn.rotate(point) + self.shift
    }

    /// This one after another.
    #[inline]
    pub(crate) fn after(&self, first: &Self) -> Self {
        Self { turn: self.turn.rotate(first.turn), shift: self.of(first.shift) }
    }

    /// How much lengths grow.
    #[inline]
    pub(crate) fn scale(&self) -> f64 {
        self.turn.length()
    }
}
