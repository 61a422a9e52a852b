//! Edges by the cells of a square grid through which they pass: who may be near whom, while edges move.
//!
//! **Input** edges, each a segment. **Output** the edges whose cells a widened segment touches.
//! **Steps** cells are hashed into a table of lists; an edge is entered in each cell it passes through, row by row.
//! A question visits the cells within a margin of a segment. Entries are doubly linked, so an edge is taken out in
//! the time it took to put it in.
//! **Guarantees** every edge nearer than the margin is visited, once per question; the order of visits depends on
//! the history of insertions only.
//! **Cost** O(cells) for each operation; no allocation after the table has grown.

use glam::DVec2;

const NONE: u32 = u32::MAX;

/// Edges by cells.
pub(crate) struct EdgeGrid {
    cells_per_mm: f64,
    /// First entry of each list; the length is a power of two.
    heads: Vec<u32>,
    entries: Vec<Entry>,
    /// First entry that is free, linked by `next`.
    free: u32,
    /// First entry of each edge, linked by `next_of_edge`.
    of_edge: Vec<u32>,
}

#[derive(Clone, Copy)]
struct Entry {
    edge: u32,
    list: u32,
    next: u32,
    previous: u32,
    next_of_edge: u32,
}

/// Which edges a question has visited.
#[derive(Default)]
pub(crate) struct Visited {
    stamps: Vec<u32>,
    stamp: u32,
}

impl Visited {
    fn begin(&mut self, n_edges: usize) {
        self.stamps.resize(n_edges, 0);
        if self.stamp == u32::MAX {
            self.stamps.fill(0);
            self.stamp = 0;
        }
        self.stamp += 1;
    }

    fn is_new(&mut self, edge: u32) -> bool {
        std::mem::replace(&mut self.stamps[edge as usize], self.stamp) != self.stamp
    }
}

impl EdgeGrid {
    /// An empty grid for edges 0..n.
    pub(crate) fn new(n_edges: usize, cell_mm: f64) -> Self {
        let n_lists = (2 * n_edges).next_power_of_two().max(16);
        Self {
            cells_per_mm: 1.0 / cell_mm,
            heads: vec![NONE; n_lists],
            entries: Vec::with_capacity(3 * n_edges),
            free: NONE,
            of_edge: vec![NONE; n_edges],
        }
    }

    /// Puts an edge in, which is not in yet.
    pub(crate) fn insert(&mut self, edge: u32, a: DVec2, b: DVec2) {
        debug_assert!(!self.contains(edge));
        let (a, b) = (a * self.cells_per_mm, b * self.cells_per_mm);
        // Far less than any margin that is asked for.
        each_cell(a, b, 1e-9, |cell| {
            self.enter(edge, cell);
            true
        });
    }

    /// Takes an edge out; nothing happens if it is not in.
    pub(crate) fn remove(&mut self, edge: u32) {
        let mut entry_idx = std::mem::replace(&mut self.of_edge[edge as usize], NONE);
        while entry_idx != NONE {
            let Entry { list, next, previous, next_of_edge, .. } = self.entries[entry_idx as usize];
            if previous == NONE {
                self.heads[list as usize] = next;
            } else {
                self.entries[previous as usize].next = next;
            }
            if next != NONE {
                self.entries[next as usize].previous = previous;
            }
            self.entries[entry_idx as usize].next = self.free;
            self.free = entry_idx;
            entry_idx = next_of_edge;
        }
    }

    /// Whether an edge is in.
    pub(crate) fn contains(&self, edge: u32) -> bool {
        self.of_edge[edge as usize] != NONE
    }

    /// Visits the edges that may be nearer than `margin_mm` to a segment, until `visit` says no; whether it never
    /// did.
    pub(crate) fn each_near(
        &self,
        (a, b): (DVec2, DVec2),
        margin_mm: f64,
        visited: &mut Visited,
        mut visit: impl FnMut(u32) -> bool,
    ) -> bool {
        visited.begin(self.of_edge.len());
        let margin = margin_mm * self.cells_per_mm + 1e-9;
        each_cell(a * self.cells_per_mm, b * self.cells_per_mm, margin, |cell| {
            let mut entry_idx = self.heads[self.list_of(cell)];
            while entry_idx != NONE {
                let entry = self.entries[entry_idx as usize];
                if visited.is_new(entry.edge) && !visit(entry.edge) {
                    return false;
                }
                entry_idx = entry.next;
            }
            true
        })
    }

    fn enter(&mut self, edge: u32, cell: (i32, i32)) {
        let list = self.list_of(cell) as u32;
        let next = self.heads[list as usize];
        let entry = Entry { edge, list, next, previous: NONE, next_of_edge: self.of_edge[edge as usize] };
        let entry_idx = if self.free == NONE {
            self.entries.push(entry);
            (self.entries.len() - 1) as u32
        } else {
            let entry_idx = self.free;
            self.free = self.entries[entry_idx as usize].next;
            self.entries[entry_idx as usize] = entry;
            entry_idx
        };
        if next != NONE {
            self.entries[next as usize].previous = entry_idx;
        }
        self.heads[list as usize] = entry_idx;
        self.of_edge[edge as usize] = entry_idx;
    }

    fn list_of(&self, cell: (i32, i32)) -> usize {
        mix(cell) & (self.heads.len() - 1)
    }
}

/// The hash of a cell.
pub(super) fn mix((column, row): (i32, i32)) -> usize {
    // Two odd constants near 2³² / golden ratio and its square spread neighbours over the table.
    let mixed = (column as u32).wrapping_mul(0x9E37_79B1) ^ (row as u32).wrapping_mul(0x85EB_CA77);
    (mixed ^ (mixed >> 15)) as usize
}

/// Visits the cells within `margin` of a segment, all in units of a cell, until `visit` says no; whether it never
/// did.
pub(super) fn each_cell(a: DVec2, b: DVec2, margin: f64, mut visit: impl FnMut((i32, i32)) -> bool) -> bool {
    let (low, high) = if a.y <= b.y { (a, b) } else { (b, a) };
    let (first_row, last_row) = (floor(low.y - margin), floor(high.y + margin));
    let slope = if high.y > low.y { (high.x - low.x) / (high.y - low.y) } else { 0.0 };
    for row in first_row..=last_row {
        // The piece of the segment that is within the margin of this row.
        let (from, to) = if slope == 0.0 || first_row == last_row {
            (low.x, high.x)
        } else {
            let at = |y: f64| low.x + slope * (y.clamp(low.y, high.y) - low.y);
            (at(f64::from(row) - margin), at(f64::from(row) + 1.0 + margin))
        };
        for column in floor(from.min(to) - margin)..=floor(from.max(to) + margin) {
            if !visit((column, row)) {
                return false;
            }
        }
    }
    true
}

fn floor(x: f64) -> i32 {
    espalier_geom::math::floor(x) as i32
}

#[cfg(test)]
mod tests {
    use espalier_geom::plane::{Segment, segment_distance};

    use super::*;
    use crate::common::stream;

    #[test]
    fn nothing_near_is_missed_while_edges_come_and_go() {
        let mut stream = stream(4100);
        let n_edges = 200;
        let mut grid = EdgeGrid::new(n_edges, 0.7);
        let mut edges: Vec<Option<(DVec2, DVec2)>> = vec![None; n_edges];
        let mut visited = Visited::default();
        for round in 0..4000 {
            let edge = stream.below(n_edges as u32);
            let mut point = |scale: f64| DVec2::new(stream.normal(), stream.normal()) * scale;
            let (a, margin) = (point(5.0), point(0.5).x.abs());
            let b = if round % 7 == 0 { a + DVec2::new(3.0, 0.0) } else { a + point(1.0) };
            if grid.contains(edge) {
                grid.remove(edge);
                edges[edge as usize] = None;
            } else {
                grid.insert(edge, a, b);
                edges[edge as usize] = Some((a, b));
            }
            let mut found = Vec::new();
            assert!(grid.each_near((b, a), margin, &mut visited, |edge| {
                found.push(edge);
                true
            }));
            let asked = Segment { a, b };
            for (edge, place) in edges.iter().enumerate() {
                let n_found = found.iter().filter(|&&other| other == edge as u32).count();
                let is_near =
                    place.is_some_and(|(a, b)| segment_distance(&asked, &Segment { a, b }) < margin);
                assert!(n_found <= 1 && (n_found == 1 || !is_near), "round {round}: edge {edge}");
                assert!(n_found == 0 || place.is_some(), "round {round}: edge {edge} is gone");
            }
        }
    }
}
