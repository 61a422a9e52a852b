//! SWC: traced trees in, trees out.
//!
//! | step | file |
//! |---|---|
//! | text → fields → nodes with resolved parents, checked for cycles | [`parse`] |
//! | [`Tree`](crate::Tree) → text and back | [`write()`], [`read_tree`] |
//!
//! **Format** One node a line, `id type x y z radius parent`; `#` starts a comment anywhere; parent −1 marks a
//! root. SWC has no standard body, so the rules that this reader follows are written out in [`parse`].

mod error;
mod parse;
mod write;

use glam::DVec3;

pub use error::SwcError;
pub use parse::{memory_bytes, parse};
pub use write::{header_value, is_own, read_tree, write};

/// One line of an SWC file, scaled to mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TracedNode {
    /// The id in the file.
    pub id: i64,
    /// The structure type in the file.
    pub kind: i32,
    /// RAS+ mm by the caller's scale.
    pub position_mm: DVec3,
    /// In mm; 0 where the file gives none.
    pub radius_mm: f64,
    /// The index (not the id) of its parent; `None` for a root.
    pub parent: Option<usize>,
    /// The line in the file, from 1.
    pub line: usize,
}

/// A traced structure: one or more rooted trees, nodes in file order.
///
/// **Guarantees** at least one node; ids are unique; parents exist; no cycle; numbers are finite; radii are at
/// least 0. Several roots, zero-length edges and zero radii are allowed: the `tree` stage has policies for them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Traced {
    /// The nodes in file order.
    pub nodes: Vec<TracedNode>,
}

/// How the numbers of a file become mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SwcScale {
    /// Mm for one unit of x, y, z. A negative factor mirrors that axis (−1, −1, 1 turns LPS into RAS).
    pub position_mm: DVec3,
    /// Mm for one unit of radius; above 0. Some programs write radii in another unit than positions.
    pub radius_mm: f64,
}

impl SwcScale {
    /// The file is in micrometres, as most SWC files are.
    #[must_use]
    pub fn micrometres() -> Self {
        Self::uniform(1e-3)
    }

    /// The file is in nanometres, as those from electron microscopy are.
    #[must_use]
    pub fn nanometres() -> Self {
        Self::uniform(1e-6)
    }

    /// The file is in millimetres, as our own are.
    #[must_use]
    pub fn millimetres() -> Self {
        Self::uniform(1.0)
    }

    /// One unit of the file, positions and radii alike, is so many mm.
    #[must_use]
    pub fn uniform(unit_mm: f64) -> Self {
        Self { position_mm: DVec3::splat(unit_mm), radius_mm: unit_mm }
    }
}
