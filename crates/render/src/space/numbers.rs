//! Numbers of branches, the same in space and on the plane.
//!
//! **Input** the figure, laid out. **Output** the numbers of the longest branches that find a free place beside them both
//! at the centreline and on the map.
//! **Guarantees** at most [`MOST`] numbers, none upon a branch or another mark.
//! **Cost** O(nodes + branches · log branches).

use glam::DVec2;

use super::{Artist, Frame, Kind, Sheet};
use crate::drawing::{Group, Mark};
use crate::letters::Map;
use crate::room::Grid;
use crate::text::Anchor;

/// More numbers than this nobody reads.
const MOST: usize = 48;
/// Font size in layout units.
const SIZE: f64 = 0.95;
/// Shorter branches have no numbers, in layout units from their first to their last node.
const SHORTEST: f64 = 1.2;

/// The numbers of the panels.
pub(super) fn at_branches(artist: &Artist<'_>, sheet: &Sheet<'_>) -> Option<Group> {
    let of_kind = |kind: Kind| sheet.frames.iter().find(|frame| frame.kind == kind);
    let mut sides = [Side::new(artist, of_kind(Kind::Line)?), Side::new(artist, of_kind(Kind::Map)?)];
    for side in &mut sides {
        side.grid.take_marks(&sheet.groups, &artist.face);
        side.grid.take_branches(side.map.page, side.map.tree, side.map.scene);
    }
    let mut marks = Vec::new();
    for branch in longest(artist) {
        if marks.len() >= 2 * MOST {
            break;
        }
        let text = branch.to_string();
        let size_px = SIZE * sides[0].map.page.unit_px;
        let size = DVec2::new(f64::from(artist.face.width(&text, size_px as f32)), 0.75 * size_px);
        let [Some(a), Some(b)] = [0, 1].map(|side: usize| sides[side].place(branch, size)) else { continue };
        for (side, center) in sides.iter_mut().zip([a, b]) {
            side.grid.take(center - 0.5 * size, center + 0.5 * size);
            let (at, color) = (center + DVec2::new(0.0, 0.5 * size.y), artist.colors.ink);
            let text = text.clone();
            marks.push(Mark::Text { at, size_px, anchor: Anchor::Middle, is_strong: false, color, text });
        }
    }
    Some(Group { name: "numbers", marks })
}

/// Branches by their lengths in space.
fn longest(artist: &Artist<'_>) -> Vec<usize> {
    let n_branches = artist.branches.list().len();
    let lengths: Vec<f64> =
        (0..n_branches).map(|branch| artist.branches.length_mm(artist.subject.tree, branch)).collect();
    let mut order: Vec<usize> = (0..n_branches).collect();
    order.sort_by(|&a, &b| lengths[b].total_cmp(&lengths[a]).then(a.cmp(&b)));
    order
}

/// A panel that numbers are put into.
struct Side<'a> {
    map: Map<'a>,
    grid: Grid,
    area: [DVec2; 2],
}

impl<'a> Side<'a> {
    fn new(artist: &Artist<'a>, frame: &'a Frame) -> Self {
        let axes = [artist.view.right(), artist.view.up];
        let map = Map {
            tree: artist.subject.tree,
            branches: artist.branches,
            scene: &frame.scene,
            page: &frame.page,
            axes,
        };
        Self {
            map,
            grid: Grid::new([frame.page.width, frame.page.height], frame.page.unit_px),
            area: frame.page.area,
        }
    }

    /// A free place beside a branch.
    fn place(&self, branch: usize, size: DVec2) -> Option<DVec2> {
        let ends = &self.map.branches.list()[branch];
        let [hub, end] =
            [ends.hub, ends.end()].map(|node| self.map.page.px(self.map.scene.points_mm[node].truncate()));
        if hub.distance(end) < SHORTEST * self.map.page.unit_px {
            return None;
        }
        let is_inside = |at: &DVec2| {
            (*at - 0.5 * size).cmpge(self.area[0]).all() && (*at + 0.5 * size).cmple(self.area[1]).all()
        };
        let places = self.map.places(branch, size).into_iter().filter(is_inside);
        places.into_iter().find(|&at| self.grid.is_free(at, size))
    }
}
