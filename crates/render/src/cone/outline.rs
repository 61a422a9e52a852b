//! The outline of a round cone: that of the hull of two discs.
//!
//! **Input** a place beside the axis. **Output** the signed distance to the outline, negative inside.

use glam::Vec2;

/// The hull of two discs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Outline {
    /// How long the axis is seen.
    seen: f32,
    radii: [f32; 2],
    /// Sine and cosine of the angle between the outline's straight sides and the axis; `None` where one disc holds the
    /// other.
    side: Option<[f32; 2]>,
}

impl Outline {
    pub(super) fn new(seen: f32, radii: [f32; 2]) -> Self {
        let taper = radii[1] - radii[0];
        let sin = taper / seen;
        Self { seen, radii, side: (taper.abs() < seen).then(|| [sin, (1.0 - sin * sin).sqrt()]) }
    }

    /// The distance from a place that lies `w` from the start and `v` from the end, `x` along the axis and `y` beside it:
    /// to the hull of both discs, or to the larger if it holds the other.
    pub(super) fn outside(&self, [w, v]: [Vec2; 2], [x, y]: [f32; 2]) -> f32 {
        let from_start = || w.length() - self.radii[0];
        let from_end = || v.length() - self.radii[1];
        let Some([sin, cos]) = self.side else { return from_start().min(from_end()) };
        let tangent = x * cos + y * sin;
        if tangent < 0.0 {
            from_start()
        } else if tangent > self.seen * cos {
            from_end()
        } else {
            y * cos - x * sin - self.radii[0]
        }
    }
}
