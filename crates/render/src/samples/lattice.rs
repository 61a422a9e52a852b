//! Where samples lie: rows of them over a square of pixels.

use std::ops::Range;

use glam::Vec2;

use super::surface::Surface;
use crate::cone::Cone;

/// Where samples lie: a square of pixels, some of them per pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lattice {
    /// The upper left corner, pixels.
    pub origin: Vec2,
    /// Pixels per axis.
    pub n_pixels: usize,
    /// Samples per pixel and axis.
    pub n: usize,
}

impl Lattice {
    /// Samples per axis.
    pub(crate) fn row(self) -> usize {
        self.n_pixels * self.n
    }

    /// The indices of the samples from `low` to `high` along an axis on which the square begins at `from`.
    fn clip(self, low: f32, high: f32, from: f32) -> Range<usize> {
        let index = |at: f32| (at - from) * self.n as f32 - 0.5;
        // Casts saturate at 0; one sample of slack on either side covers rounding.
        let first = (index(low) - 1.0) as u32 as usize;
        let last = (index(high) + 2.0).max(0.0) as u32 as usize;
        first..last.min(self.row())
    }

    /// A sample's place along an axis.
    fn place(self, from: f32, index: usize) -> f32 {
        from + (index as f32 + 0.5) * (1.0 / self.n as f32)
    }

    /// A sample of a row whose place on the other axis is `y`.
    pub(super) fn pixel(self, row: usize, sample: usize, y: f32) -> Vec2 {
        Vec2::new(self.place(self.origin.x, sample - row * self.row()), y)
    }

    /// Row by row, what a cone can reach when it is `margin` wider: the row, its place, its samples.
    pub(super) fn runs(
        self,
        cone: &Cone,
        margin: f32,
    ) -> impl Iterator<Item = (usize, f32, Range<usize>)> + '_ {
        let (low, high) = cone.bounds();
        self.clip(low.y - margin, high.y + margin, self.origin.y).filter_map(move |row| {
            let y = self.place(self.origin.y, row);
            let (from, to) = cone.span(y, margin)?;
            let columns = self.clip(from, to, self.origin.x);
            let first = row * self.row();
            Some((row, y, first + columns.start..first + columns.end)).filter(|(.., run)| !run.is_empty())
        })
    }

    /// The distance from an outline at which a sample begins to be covered: half of it.
    pub(super) fn fringe_px(self) -> f32 {
        0.5 / self.n as f32
    }

    /// The share of a sample that is covered, by the distance to the outline and the radius. A branch narrower than
    /// the sample ends within it on the other side too.
    pub(crate) fn coverage(self, surface: &Surface) -> f32 {
        let inside = |outside: f32| (0.5 - outside * self.n as f32).clamp(0.0, 1.0);
        inside(surface.outside) - inside(surface.outside + 2.0 * surface.radius)
    }
}
