//! SWC: traced trees in, trees out.

use glam::DVec3;

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
