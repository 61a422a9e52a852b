//! Letters beside long branches that run otherwise in space than the letters at the map's edges say.
//!
//! **Input** the map on its page, with what its right and up mean. **Output** texts that cover no branch and no other
//! mark.
//! **Steps** 1. Long branches whose chord in space leaves the direction that the map gives it by [`OFF_DEG`] or more, the
//! longest first. 2. Each takes the first free place beside its middle, its quarters, its end; without one it goes
//! unnamed. What is taken stands in a grid of cells.
//! **Guarantees** at most [`MOST`] texts; the same for the same page.
//! **Source** ours: a map keeps no directions, so one compass cannot speak for all branches.
//! **Cost** O(nodes + branches · log branches).

use espalier_geom::math;
use espalier_model::{Branches, Tree};
use glam::{DVec2, DVec3};

use crate::drawing::{Group, Mark};
use crate::furniture::direction_letters;
use crate::page::Page;
use crate::palette::PageColors;
use crate::params::Compass;
use crate::scene::Scene;
use crate::text::{Anchor, Face};

/// The letters say at most "sin 20° of the axis", so less than this is within what they mean.
const OFF_DEG: f64 = 60.0;
/// Shorter branches have no letters, in layout units.
const SHORTEST: f64 = 5.0;
/// More letters than this nobody reads.
const MOST: usize = 14;
/// Font size, and the space to the branch, in layout units.
const SIZE: f64 = 1.15;
const SPACE: f64 = 0.45;

/// A map whose letters are asked for.
pub(crate) struct Map<'a> {
    /// The tree.
    pub tree: &'a Tree,
    /// Its branches.
    pub branches: &'a Branches,
    /// Where its nodes lie.
    pub scene: &'a Scene,
    /// The page.
    pub page: &'a Page,
    /// What points to the right and up.
    pub axes: [DVec3; 2],
}

/// The letters at branches; `taken` are boxes (low, high) of other marks.
pub(crate) fn at_branches(
    map: &Map<'_>,
    (face, colors): (&Face, &PageColors),
    kind: Compass,
    taken: &[[DVec2; 2]],
) -> Group {
    let unit = map.page.unit_px;
    let mut grid = Grid::new(map.page);
    for &[low, high] in taken {
        grid.take(low, high);
    }
    map.take_branches(&mut grid);
    let mut marks = Vec::new();
    for (branch, direction) in map.strays() {
        if marks.len() == MOST {
            break;
        }
        let Some(text) = direction_letters(direction, kind).filter(|text| !text.is_empty()) else { continue };
        let size = DVec2::new(f64::from(face.width(&text, (SIZE * unit) as f32)), 0.75 * SIZE * unit);
        let Some(center) = map.places(branch, size).into_iter().find(|&at| grid.is_free(at, size)) else {
            continue;
        };
        grid.take(center - 0.5 * size, center + 0.5 * size);
        let at = center + DVec2::new(0.0, 0.5 * size.y);
        let (size_px, color) = (SIZE * unit, colors.ink);
        marks.push(Mark::Text { at, size_px, anchor: Anchor::Middle, is_strong: true, color, text });
    }
    Group { name: "branch-letters", marks }
}

impl Map<'_> {
    /// Long branches that leave the direction the map gives them, the longest first, each with where it points.
    fn strays(&self) -> Vec<(usize, DVec3)> {
        let [right, up] = self.axes;
        let mut found = Vec::new();
        for (branch_idx, branch) in self.branches.list().iter().enumerate() {
            let (hub, end) = (branch.hub, branch.end());
            let chord = self.scene.points_mm[end] - self.scene.points_mm[hub];
            let length_px = self.page.px_per_mm * chord.length();
            let space = (self.tree.position_mm(end) - self.tree.position_mm(hub)).try_normalize();
            if let (Some(map), Some(space)) = (chord.truncate().try_normalize(), space) {
                let cosine = space.dot(map.x * right + map.y * up).clamp(-1.0, 1.0);
                let is_long = length_px >= SHORTEST * self.page.unit_px;
                if is_long && math::acos(cosine).to_degrees() >= OFF_DEG {
                    found.push((branch_idx, space, length_px));
                }
            }
        }
        found.sort_by(|a, b| b.2.total_cmp(&a.2).then(a.0.cmp(&b.0)));
        found.into_iter().map(|(branch, space, _)| (branch, space)).collect()
    }

    /// Middles of boxes of this size beside a branch, the best place first.
    pub(crate) fn places(&self, branch: usize, size: DVec2) -> Vec<DVec2> {
        let nodes: Vec<usize> = self.branches.list()[branch].polyline().collect();
        let mut places = Vec::new();
        for share in [0.5, 0.35, 0.65, 0.8] {
            let last = nodes.len() - 1;
            let upper = ((share * last as f64) as usize).min(last - 1);
            let part = share * last as f64 - upper as f64;
            let [from, to] =
                [nodes[upper], nodes[upper + 1]].map(|n| self.page.px(self.scene.points_mm[n].truncate()));
            let Some(along) = (to - from).try_normalize() else { continue };
            let radius_px = self
                .page
                .radius_px(self.scene.radii_mm[nodes[upper]].max(self.scene.radii_mm[nodes[upper + 1]]));
            for across in [along.perp(), -along.perp()] {
                // The box touches the branch with whichever of its sides is nearer.
                let half = 0.5 * (size.x * across.x.abs() + size.y * across.y.abs());
                places.push(from.lerp(to, part) + across * (radius_px + SPACE * self.page.unit_px + half));
            }
        }
        places
    }

    /// Takes the cells under the branches.
    pub(crate) fn take_branches(&self, grid: &mut Grid) {
        for (node, parent) in self.tree.edges() {
            let [a, b] = [parent, node].map(|n| self.page.px(self.scene.points_mm[n].truncate()));
            let radius_px = self.page.radius_px(self.scene.radii_mm[node].max(self.scene.radii_mm[parent]));
            let n_steps = (a.distance(b) / grid.cell_px).min(1e5) as usize + 1;
            for i in 0..=n_steps {
                let at = a.lerp(b, i as f64 / n_steps as f64);
                grid.take(at - radius_px, at + radius_px);
            }
        }
    }
}

/// Which cells of a page are taken.
pub(crate) struct Grid {
    cell_px: f64,
    size: [usize; 2],
    is_taken: Vec<bool>,
}

impl Grid {
    pub(crate) fn new(page: &Page) -> Self {
        let cell_px = 0.35 * page.unit_px;
        let size = [page.width, page.height].map(|pixels| (f64::from(pixels) / cell_px) as usize + 1);
        Self { cell_px, size, is_taken: vec![false; size[0] * size[1]] }
    }

    /// The cells from a point to another, inside of the page.
    fn cells(&self, low: DVec2, high: DVec2) -> impl Iterator<Item = usize> + use<> {
        let cell = |at: f64, n: usize| ((at / self.cell_px).max(0.0) as usize).min(n);
        let [n_x, n_y] = self.size;
        let columns = cell(low.x, n_x)..cell(high.x + self.cell_px, n_x);
        let rows = cell(low.y, n_y)..cell(high.y + self.cell_px, n_y);
        rows.flat_map(move |row| columns.clone().map(move |column| row * n_x + column))
    }

    pub(crate) fn take(&mut self, low: DVec2, high: DVec2) {
        for cell in self.cells(low, high) {
            self.is_taken[cell] = true;
        }
    }

    pub(crate) fn is_free(&self, center: DVec2, size: DVec2) -> bool {
        let (low, high) = (center - 0.5 * size, center + 0.5 * size);
        let page = DVec2::new(self.size[0] as f64, self.size[1] as f64) * self.cell_px;
        let is_inside = low.cmpge(DVec2::ZERO).all() && high.cmplt(page).all();
        is_inside && !self.cells(low, high).any(|cell| self.is_taken[cell])
    }
}
