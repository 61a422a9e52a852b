//! What of a page is taken, as a grid of cells.
//!
//! **Input** boxes of marks, the branches of a tree. **Output** whether a box is free.
//! **Cost** O(cells) memory, some ten thousand; O(cells under it) time for a box.

use espalier_model::Tree;
use glam::DVec2;

use crate::drawing::Group;
use crate::page::Page;
use crate::scene::Scene;
use crate::text::Face;

/// Side of a cell, in layout units.
const CELL: f64 = 0.35;

/// Which cells of a page are taken.
pub(crate) struct Grid {
    cell_px: f64,
    size: [usize; 2],
    is_taken: Vec<bool>,
    n_free: usize,
}

impl Grid {
    /// A page of this size, all of it free.
    pub(crate) fn new(size: [u32; 2], unit_px: f64) -> Self {
        let cell_px = CELL * unit_px;
        let size = size.map(|pixels| (f64::from(pixels) / cell_px) as usize + 1);
        let n_cells = size[0] * size[1];
        Self { cell_px, size, is_taken: vec![false; n_cells], n_free: n_cells }
    }

    /// The cells from a point to another, inside of the page.
    fn cells(&self, low: DVec2, high: DVec2) -> impl Iterator<Item = usize> + use<> {
        let cell = |at: f64, n: usize| ((at / self.cell_px).max(0.0) as usize).min(n);
        let [n_x, n_y] = self.size;
        let columns = cell(low.x, n_x)..cell(high.x + self.cell_px, n_x);
        let rows = cell(low.y, n_y)..cell(high.y + self.cell_px, n_y);
        rows.flat_map(move |row| columns.clone().map(move |column| row * n_x + column))
    }

    /// Takes the cells that a box touches.
    pub(crate) fn take(&mut self, low: DVec2, high: DVec2) {
        for cell in self.cells(low, high) {
            self.n_free -= usize::from(!self.is_taken[cell]);
            self.is_taken[cell] = true;
        }
    }

    /// Whether a box lies on the page and touches nothing.
    pub(crate) fn is_free(&self, center: DVec2, size: DVec2) -> bool {
        let (low, high) = (center - 0.5 * size, center + 0.5 * size);
        let page = DVec2::new(self.size[0] as f64, self.size[1] as f64) * self.cell_px;
        let is_inside = low.cmpge(DVec2::ZERO).all() && high.cmplt(page).all();
        is_inside && !self.cells(low, high).any(|cell| self.is_taken[cell])
    }

    /// Takes the boxes of marks.
    pub(crate) fn take_marks(&mut self, groups: &[Group], face: &Face) {
        for mark in groups.iter().flat_map(|group| &group.marks) {
            let [low, high] = mark.bounds(face);
            self.take(low, high);
        }
    }

    /// Takes the cells under the branches of a tree on its page.
    pub(crate) fn take_branches(&mut self, page: &Page, tree: &Tree, scene: &Scene) {
        let at = |node: usize| page.px(scene.points_mm[node].truncate());
        let first = page.radius_px(scene.radii_mm[0]);
        self.take(at(0) - first, at(0) + first);
        for (node, parent) in tree.edges() {
            let (a, b) = (at(parent), at(node));
            let radius_px = page.radius_px(scene.radii_mm[node].max(scene.radii_mm[parent]));
            let n_steps = (a.distance(b) / self.cell_px).min(1e5) as usize + 1;
            for i in 0..=n_steps {
                // Tubes as wide as the page, of radii in a wrong unit, leave nothing after the first.
                if self.n_free == 0 {
                    return;
                }
                let at = a.lerp(b, i as f64 / n_steps as f64);
                self.take(at - radius_px, at + radius_px);
            }
        }
    }
}
