//! Places on the page: from mm to whole units of a drawing.
//!
//! **Input** points in plane mm. **Output** a [`Frame`]: units of which the longer side has [`LONG_SIDE`], y downwards.
//! **Guarantees** whole numbers, so that paths are short and the same on every machine.

use glam::DVec2;

/// Units along the longer side of a drawing: a tenth of a pixel on a wide screen, a hundredth of a mm on paper.
pub(crate) const LONG_SIDE: f64 = 10_000.0;
/// Room around a drawing, as a share of the longer side.
const MARGIN: f64 = 0.015;
/// The shorter side is at least this share of the longer one, so that a straight tube has a picture too.
const LEAST_ASPECT: f64 = 0.2;

/// A box in the plane and its scale on the page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Frame {
    /// The upper left corner, plane mm.
    corner_mm: DVec2,
    /// Length of a unit.
    pub(crate) mm_per_unit: f64,
    /// Width and height in units.
    pub(crate) size: [i64; 2],
}

impl Frame {
    /// The frame of a box.
    pub(crate) fn around(corners: [DVec2; 2]) -> Self {
        Self::with_margin(corners, MARGIN)
    }

    /// The frame of a box with more room around it, as a share of the longer side.
    pub(crate) fn with_margin([low, high]: [DVec2; 2], margin: f64) -> Self {
        let extent = high - low;
        let longest = extent.max_element();
        let longest = if longest > 0.0 && longest.is_finite() { longest } else { 1.0 };
        let room = extent.max(DVec2::splat(LEAST_ASPECT * longest)) + 2.0 * margin * longest;
        let mm_per_unit = room.max_element() / LONG_SIDE;
        let corner_mm = 0.5 * (low + high) + DVec2::new(-0.5, 0.5) * room;
        let size = (room / mm_per_unit).to_array().map(|side| (side + 0.5) as i64);
        Self { corner_mm, mm_per_unit, size }
    }

    /// Where a point lies, in units.
    pub(crate) fn place(&self, point_mm: DVec2) -> [i64; 2] {
        self.offset(point_mm).to_array().map(|value| (value + 0.5).floor() as i64)
    }

    /// The same before it is rounded: x to the right, y down.
    pub(crate) fn offset(&self, point_mm: DVec2) -> DVec2 {
        (point_mm - self.corner_mm) / self.mm_per_unit * DVec2::new(1.0, -1.0)
    }

    /// A length in units.
    pub(crate) fn units(&self, length_mm: f64) -> f64 {
        length_mm / self.mm_per_unit
    }

    /// The attribute `viewBox`.
    pub(crate) fn view_box(&self) -> String {
        format!("0 0 {} {}", self.size[0], self.size[1])
    }
}

/// The smallest upright box around discs (centre, radius).
pub(crate) fn bounds(discs: impl Iterator<Item = (DVec2, f64)>) -> [DVec2; 2] {
    let nothing = [DVec2::INFINITY, DVec2::NEG_INFINITY];
    let found = discs.fold(nothing, |[low, high], (center, radius)| {
        [low.min(center - DVec2::splat(radius)), high.max(center + DVec2::splat(radius))]
    });
    if found[0].is_finite() && found[1].is_finite() { found } else { [DVec2::ZERO; 2] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_holds_its_box() {
        for (low, high) in [
            (DVec2::ZERO, DVec2::new(30.0, 10.0)),
            (DVec2::new(-1.0, 5.0), DVec2::new(-1.0, 9.0)),
            (DVec2::ZERO, DVec2::ZERO),
        ] {
            let frame = Frame::around([low, high]);
            for point in [low, high, 0.5 * (low + high)] {
                let [x, y] = frame.place(point);
                assert!((0..=frame.size[0]).contains(&x) && (0..=frame.size[1]).contains(&y), "{point}");
            }
            assert!(frame.place(low)[1] >= frame.place(high)[1], "up is up");
        }
        assert_eq!(bounds(std::iter::empty()), [DVec2::ZERO; 2]);
    }
}
