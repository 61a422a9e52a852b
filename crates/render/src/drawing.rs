//! What stands on the page beside the tree: a list of simple marks that every format can draw.

use glam::DVec2;

use crate::palette::{Palette, Rgb};
use crate::text::{Anchor, Face};

/// A mark on the page, in pixels, y down.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Mark {
    /// A line of text.
    Text {
        /// A point of its baseline.
        at: DVec2,
        /// Pixels per em.
        size_px: f64,
        /// Which point of the baseline.
        anchor: Anchor,
        /// Whether it is set bolder.
        is_strong: bool,
        /// Its colour.
        color: Rgb,
        /// What it says.
        text: String,
    },
    /// A straight line.
    Line {
        /// One end.
        from: DVec2,
        /// The other.
        to: DVec2,
        /// Width in pixels.
        width_px: f64,
        /// Its colour.
        color: Rgb,
    },
    /// A bent line through at least two points, with round corners.
    Bent {
        /// Its points.
        points: Vec<DVec2>,
        /// Width in pixels.
        width_px: f64,
        /// Its colour.
        color: Rgb,
    },
    /// An upright colour bar, value 0 at the bottom.
    Bar {
        /// Its upper left corner.
        corner: DVec2,
        /// Its size.
        size: DVec2,
        /// Its colours.
        palette: Palette,
    },
    /// A circle.
    Ring {
        /// Its centre.
        center: DVec2,
        /// The radius of the middle of its line, in pixels.
        radius_px: f64,
        /// Width of the line in pixels.
        width_px: f64,
        /// Its colour.
        color: Rgb,
    },
}

impl Mark {
    /// The corners of the box that it takes.
    pub(crate) fn bounds(&self, face: &Face) -> [DVec2; 2] {
        match self {
            Self::Text { at, size_px, anchor, text, .. } => {
                let width = f64::from(face.width(text, *size_px as f32));
                let left = at.x - width * f64::from(anchor.share());
                [DVec2::new(left, at.y - size_px), DVec2::new(left + width, at.y + 0.3 * size_px)]
            }
            Self::Line { from, to, width_px, .. } => [from.min(*to) - *width_px, from.max(*to) + *width_px],
            Self::Bent { points, width_px, .. } => {
                let first = points.first().copied().unwrap_or_default();
                let [low, high] =
                    points.iter().fold([first; 2], |[low, high], &at| [low.min(at), high.max(at)]);
                [low - *width_px, high + *width_px]
            }
            Self::Bar { corner, size, .. } => [*corner, *corner + *size],
            Self::Ring { center, radius_px, width_px, .. } => {
                [*center - (radius_px + width_px), *center + (radius_px + width_px)]
            }
        }
    }
}

/// Marks that belong together, under a name.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Group {
    /// Its name, such as `legend`.
    pub name: &'static str,
    /// Its marks, the first at the bottom.
    pub marks: Vec<Mark>,
}
