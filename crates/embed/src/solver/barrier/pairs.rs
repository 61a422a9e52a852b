//! The pairs of edges that may be near each other, kept while nothing moves far.
//!
//! **Input** positions, and a rule of what each pair has to keep. **Output** flat lists of pairs.
//! **Notation** skin: how far a node may move before the list is made anew.
//! **Steps** 1. Each edge, as thick as the rule says, is counted into the cells of a hashed grid, then entered:
//! two passes, no lists to link. 2. Each edge visits the cells within its thickness, the rule's reach and twice
//! the skin, and keeps the edges before it. 3. Entries stand in order of their parents, so that an edge steps
//! over its siblings at once: a star of 10,000 is no worse than a chain.
//! **Guarantees** every pair within the rule's reach is listed until a node has moved by more than the skin; the
//! order of the list depends on positions only.
//! **Cost** O(N + cells + candidates) to make; no allocation after the arrays have grown.

use std::ops::Range;

use glam::DVec2;
use rayon::prelude::*;

use super::super::grid::{each_cell, mix};
use super::super::work::Work;
use super::contact::Contact;
use crate::problem::Problem;

/// The skin as a share of the reach. A wider one lists more pairs and is left as soon where whole subtrees turn: on an
/// airway of 4099 nodes the first relaxing takes 575 million units of work at .35, 445 at .15, 389 at .05.
const SKIN_SHARE: f64 = 0.05;
/// More pairs than this for each edge are not listed: the reach is halved instead, so that memory is bounded.
const MOST_PAIRS_PER_EDGE: usize = 60;
/// Edges whose neighbours are looked up together.
const EDGES_PER_CHUNK: usize = 2048;
/// A cell is at least this share of the largest half width, or one thick edge would be in too many.
const MOST_CELLS_ACROSS: f64 = 32.0;

/// What two edges have to keep: the barrier is infinite at `floor_mm` and ends at `floor_mm + width_mm`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    pub(crate) floor_mm: f64,
    pub(crate) width_mm: f64,
}

/// A rule of what pairs of edges have to keep.
pub(crate) trait Spacing: Sync {
    /// Half the width of an edge, in mm; 0 if only its centreline matters.
    fn thickness_mm(&self, edge: usize) -> f64;
    /// The most that any pair's bounds end beyond the two thicknesses, in mm.
    fn reach_mm(&self) -> f64;
    /// Halves the reach; false if it is as short as the rule allows.
    fn halve_reach(&mut self) -> bool;
    /// What edges a < b have to keep, if anything; nothing if they have a common node.
    fn bounds(&self, a: usize, b: usize) -> Option<Bounds>;
}

/// A pair of edges, the first above the second in preorder, with what it has to keep.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair {
    pub(super) first: u32,
    pub(super) second: u32,
    pub(super) bounds: Bounds,
}

/// The list.
#[derive(Default)]
pub(super) struct PairList {
    pub(super) pairs: Vec<Pair>,
    /// Where the nodes were when the list was made.
    anchors: Vec<DVec2>,
    skin_mm: f64,
    by_parent: Vec<u32>,
    /// Where the entries of each cell begin, and one more.
    starts: Vec<u32>,
    entries: Vec<u32>,
    /// For each entry, the end of the run of siblings it is in.
    run_ends: Vec<u32>,
    chunks: Vec<Chunk>,
}

/// What the edges of one chunk found.
#[derive(Default)]
struct Chunk {
    pairs: Vec<Pair>,
    candidates: Vec<u32>,
    n_visits: usize,
}

impl PairList {
    pub(super) fn new(problem: &Problem) -> Self {
        let mut by_parent: Vec<u32> = (1..problem.n_nodes() as u32).collect();
        by_parent.sort_by_key(|&node| (problem.parent[node as usize], node));
        Self { by_parent, ..Self::default() }
    }

    #[cfg(test)]
    pub(super) fn skin_mm(&self) -> f64 {
        self.skin_mm
    }

    /// Whether a node has left its place by more than the skin.
    pub(super) fn is_stale(&self, positions: &[DVec2]) -> bool {
        let most = self.skin_mm * self.skin_mm;
        self.anchors.len() != positions.len()
            || self.anchors.iter().zip(positions).any(|(a, p)| a.distance_squared(*p) > most)
    }

    /// Makes the list for the places of now.
    pub(super) fn rebuild(
        &mut self,
        problem: &Problem,
        spacing: &mut impl Spacing,
        positions: &[DVec2],
        work: &mut Work,
    ) {
        self.anchors.clear();
        self.anchors.extend_from_slice(positions);
        let mut most_pairs = MOST_PAIRS_PER_EDGE * problem.n_nodes();
        loop {
            self.skin_mm = SKIN_SHARE * spacing.reach_mm();
            let slack_mm = 2.0 * self.skin_mm;
            let mut search = Search { problem, spacing: &*spacing, positions, cells_per_mm: 0.0, slack_mm };
            search.cells_per_mm = search.cells_per_mm();
            self.enter(&search);
            if self.collect(&search, most_pairs, work) {
                return;
            }
            if !spacing.halve_reach() {
                most_pairs = usize::MAX;
            }
        }
    }

    /// Enters all edges into the cells.
    fn enter<S: Spacing>(&mut self, search: &Search<S>) {
        let n_lists = (2 * self.by_parent.len()).next_power_of_two().max(16);
        let mask = n_lists - 1;
        self.starts.clear();
        self.starts.resize(n_lists + 1, 0);
        for &edge in &self.by_parent {
            search.each_cell(edge as usize, 0.0, |cell| self.starts[(mix(cell) & mask) + 1] += 1);
        }
        for list in 0..n_lists {
            self.starts[list + 1] += self.starts[list];
        }
        let n_entries = self.starts[n_lists] as usize;
        self.entries.clear();
        self.entries.resize(n_entries, 0);
        for &edge in &self.by_parent {
            search.each_cell(edge as usize, 0.0, |cell| {
                let start = &mut self.starts[mix(cell) & mask];
                self.entries[*start as usize] = edge;
                *start += 1;
            });
        }
        // Each start has moved to its end, which is the start of the next.
        self.starts.copy_within(0..n_lists, 1);
        self.starts[0] = 0;
        self.find_runs(search.problem, n_lists);
    }

    fn find_runs(&mut self, problem: &Problem, n_lists: usize) {
        self.run_ends.clear();
        self.run_ends.resize(self.entries.len(), 0);
        for list in 0..n_lists {
            let (start, end) = (self.starts[list] as usize, self.starts[list + 1] as usize);
            let mut run_end = end as u32;
            for idx in (start..end).rev() {
                let parent = problem.parent[self.entries[idx] as usize];
                if idx + 1 < end && problem.parent[self.entries[idx + 1] as usize] != parent {
                    run_end = idx as u32 + 1;
                }
                self.run_ends[idx] = run_end;
            }
        }
    }

    /// Lists the pairs; false if there are more than `most_pairs`.
    fn collect<S: Spacing>(&mut self, search: &Search<S>, most_pairs: usize, work: &mut Work) -> bool {
        let n_nodes = search.problem.n_nodes();
        let margin_mm = search.spacing.reach_mm() + 2.0 * self.skin_mm;
        let Self { pairs, chunks, starts, entries, run_ends, .. } = self;
        let cells = Cells { starts, entries, run_ends };
        chunks.resize_with(n_nodes.div_ceil(EDGES_PER_CHUNK), Chunk::default);
        chunks.par_iter_mut().enumerate().for_each(|(idx, chunk)| {
            let edges = (idx * EDGES_PER_CHUNK).max(1)..((idx + 1) * EDGES_PER_CHUNK).min(n_nodes);
            chunk.collect(search, &cells, (edges, margin_mm, most_pairs));
        });
        work.spend(n_nodes + chunks.iter().map(|chunk| chunk.n_visits).sum::<usize>());
        pairs.clear();
        chunks.iter().for_each(|chunk| pairs.extend_from_slice(&chunk.pairs));
        pairs.len() <= most_pairs
    }
}

/// The grid as it is read.
struct Cells<'a> {
    starts: &'a [u32],
    entries: &'a [u32],
    run_ends: &'a [u32],
}

impl Chunk {
    fn collect<S: Spacing>(
        &mut self,
        search: &Search<S>,
        cells: &Cells,
        (edges, margin_mm, most_pairs): (Range<usize>, f64, usize),
    ) {
        let mask = cells.starts.len() - 2;
        self.pairs.clear();
        self.n_visits = 0;
        for edge in edges {
            let parent = search.problem.parent[edge];
            self.candidates.clear();
            search.each_cell(edge, margin_mm, |cell| {
                let list = mix(cell) & mask;
                let (mut idx, end) = (cells.starts[list] as usize, cells.starts[list + 1] as usize);
                while idx < end {
                    self.n_visits += 1;
                    let other = cells.entries[idx];
                    if search.problem.parent[other as usize] == parent {
                        idx = cells.run_ends[idx] as usize;
                        continue;
                    }
                    idx += 1;
                    if (other as usize) < edge && other != parent {
                        self.candidates.push(other);
                    }
                }
            });
            self.candidates.sort_unstable();
            self.candidates.dedup();
            self.pairs.extend(self.candidates.iter().filter_map(|&other| search.pair(other as usize, edge)));
            if self.pairs.len() > most_pairs {
                return;
            }
        }
    }
}

/// What one search looks at.
struct Search<'a, S> {
    problem: &'a Problem<'a>,
    spacing: &'a S,
    positions: &'a [DVec2],
    cells_per_mm: f64,
    /// By how much a pair can come nearer while the list holds.
    slack_mm: f64,
}

impl<S: Spacing> Search<'_, S> {
    /// Cells about as large as an edge is long or as a search is wide, whichever is more, so that there are
    /// few cells for each edge.
    fn cells_per_mm(&self) -> f64 {
        let n_edges = self.positions.len().max(2) - 1;
        let extent = |edge: usize| {
            self.ends(edge).0.distance(self.ends(edge).1) + 2.0 * self.spacing.thickness_mm(edge)
        };
        let mean_mm = (1..self.positions.len()).map(extent).sum::<f64>() / n_edges as f64;
        let thickest_mm = (1..self.positions.len()).map(|e| self.spacing.thickness_mm(e)).fold(0.0, f64::max);
        let cell_mm =
            mean_mm.max(self.spacing.reach_mm() + self.slack_mm).max(thickest_mm / MOST_CELLS_ACROSS);
        1.0 / cell_mm.max(f64::MIN_POSITIVE)
    }

    fn ends(&self, edge: usize) -> (DVec2, DVec2) {
        (self.positions[self.problem.parent[edge] as usize], self.positions[edge])
    }

    fn each_cell(&self, edge: usize, margin_mm: f64, mut visit: impl FnMut((i32, i32))) {
        let (a, b) = self.ends(edge);
        let margin = (self.spacing.thickness_mm(edge) + margin_mm) * self.cells_per_mm + 1e-9;
        each_cell(a * self.cells_per_mm, b * self.cells_per_mm, margin, |cell| {
            visit(cell);
            true
        });
    }

    /// The pair, if it can come within its bounds while the list holds.
    fn pair(&self, first: usize, second: usize) -> Option<Pair> {
        let (p, q) = (self.ends(first), self.ends(second));
        let thick_mm = self.spacing.thickness_mm(first) + self.spacing.thickness_mm(second);
        if are_apart(p, q, thick_mm + self.spacing.reach_mm() + self.slack_mm) {
            return None;
        }
        let bounds = self.spacing.bounds(first, second)?;
        let reach_mm = bounds.floor_mm + bounds.width_mm + self.slack_mm;
        let is_near = Contact::between(p, q).distance < reach_mm;
        is_near.then_some(Pair { first: first as u32, second: second as u32, bounds })
    }
}

/// Whether two segments are farther apart than `reach` for sure: the discs about them are.
pub(super) fn are_apart((p0, p1): (DVec2, DVec2), (q0, q1): (DVec2, DVec2), reach: f64) -> bool {
    let between = 0.5 * ((p0 + p1) - (q0 + q1));
    let (p, q) = ((p1 - p0).length_squared(), (q1 - q0).length_squared());
    // (a + b)² ≤ 2 (a² + b²) spares the roots: half lengths are √p / 2 and √q / 2.
    let halves = (0.5 * (p + q)).sqrt();
    between.length_squared() > (halves + reach) * (halves + reach)
}
