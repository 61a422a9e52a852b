//! What stands on the page beside the tree: a list of simple marks that every format can draw.

use glam::DVec2;

use crate::palette::{Palette, Rgb};
use crate::text::Anchor;

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

/// Marks that belong together, under a name.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Group {
    /// Its name, such as `legend`.
    pub name: &'static str,
    /// Its marks, the first at the bottom.
    pub marks: Vec<Mark>,
}
