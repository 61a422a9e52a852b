//! Runs of foreground, and which of them connect.
//!
//! **Input** [`Bits`]. **Output** [`Runs`], the maximal runs along x of each row; for them the number of each one's
//! connected component.
//! **Notation** R runs; row (y, z) is the line of voxels with these coordinates.
//! **Steps** 1. cut each row, by counting the zeros at the end of its words; 2. join runs of neighbouring rows that
//! touch: over a face their intervals overlap, over an edge or corner they may also be next to each other.
//! **Guarantees** components are numbered in the order of their first voxel in storage order; the result depends
//! on the voxels only, not on the number of threads.
//! **Cost** O(words + R · α(R)) time, O(R + rows) memory. A row of zeros costs a look at its words.

use std::ops::Range;

use espalier_geom::union_find::UnionFind;
use espalier_model::Bits;
use rayon::prelude::*;

/// How voxels connect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Connectivity {
    /// By faces: 6 neighbours.
    Faces,
    /// By faces, edges and corners: 26 neighbours.
    All,
}

/// Voxels `start..end` of a row. Half the size of a range of `usize`: noise has a run for every fourth voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Run {
    pub(crate) start: u32,
    pub(crate) end: u32,
}

impl Run {
    pub(crate) fn len(&self) -> usize {
        (self.end - self.start) as usize
    }

    pub(crate) fn range(&self) -> Range<usize> {
        self.start as usize..self.end as usize
    }
}

/// The runs of a volume, row by row.
pub(crate) struct Runs {
    shape: [usize; 3],
    /// In storage order.
    runs: Vec<Run>,
    /// Where each row's runs begin, and where the last row's end.
    row_starts: Vec<usize>,
}

/// The number of each run's component, and how many components there are.
pub(crate) struct Components {
    pub(crate) of_run: Vec<usize>,
    pub(crate) n_components: usize,
}

impl Runs {
    /// Cuts the rows of a volume into runs.
    pub(crate) fn cut(bits: &Bits) -> Self {
        let [_, ny, nz] = bits.shape();
        let slices: Vec<(Vec<Run>, Vec<u32>)> =
            (0..nz).into_par_iter().map(|z| cut_rows(bits, z * ny..(z + 1) * ny)).collect();
        let mut runs = Vec::with_capacity(slices.iter().map(|(runs, _)| runs.len()).sum());
        let mut row_starts = Vec::with_capacity(bits.n_rows() + 1);
        for (slice, counts) in slices {
            let first = runs.len();
            row_starts.extend(counts.iter().map(|&before| first + before as usize));
            runs.extend(slice);
        }
        row_starts.push(runs.len());
        Self { shape: bits.shape(), runs, row_starts }
    }

    /// All runs, in storage order.
    pub(crate) fn all(&self) -> &[Run] {
        &self.runs
    }

    /// The places in [`Runs::all`] of the runs of a row.
    pub(crate) fn of_row(&self, row: usize) -> Range<usize> {
        self.row_starts[row]..self.row_starts[row + 1]
    }

    /// The runs of a row.
    pub(crate) fn row(&self, row: usize) -> &[Run] {
        &self.runs[self.of_row(row)]
    }

    /// The number of rows.
    pub(crate) fn n_rows(&self) -> usize {
        self.row_starts.len() - 1
    }

    /// The run that holds a voxel.
    pub(crate) fn find(&self, [x, y, z]: [usize; 3]) -> Option<usize> {
        let row = self.of_row(z * self.shape[1] + y);
        let run = row.start + self.runs[row.clone()].partition_point(|run| run.end as usize <= x);
        (run < row.end && self.runs[run].range().contains(&x)).then_some(run)
    }

    /// The rows whose voxels can touch those of a row, itself among them.
    pub(crate) fn rows_about(&self, row: usize) -> impl Iterator<Item = usize> + use<> {
        let [_, ny, nz] = self.shape;
        let (y, z) = (row % ny, row / ny);
        let rows = move |z: usize| (y.saturating_sub(1)..(y + 2).min(ny)).map(move |y| z * ny + y);
        (z.saturating_sub(1)..(z + 2).min(nz)).flat_map(rows)
    }

    /// The runs of a row that a run of the same row, or of one about it, touches, over corners too.
    pub(crate) fn touching(&self, row: usize, run: Run) -> Range<usize> {
        let row = self.of_row(row);
        let runs = &self.runs[row.clone()];
        let first = runs.partition_point(|other| other.end < run.start);
        let last = runs.partition_point(|other| other.start <= run.end);
        row.start + first..row.start + last.max(first)
    }

    /// The connected components.
    pub(crate) fn components(&self, connectivity: Connectivity) -> Components {
        let [_, ny, nz] = self.shape;
        let mut joined = UnionFind::new(self.runs.len());
        for z in 0..nz {
            for y in 0..ny {
                let here = self.of_row(z * ny + y);
                if here.is_empty() {
                    continue;
                }
                for other in rows_before([y, z], ny, connectivity).into_iter().flatten() {
                    self.join_touching(here.clone(), self.of_row(other), connectivity, &mut joined);
                }
            }
        }
        let (of_run, n_components) = joined.into_numbers();
        Components { of_run, n_components }
    }

    /// Joins the runs of two rows that touch, walking along both.
    fn join_touching(
        &self,
        here: Range<usize>,
        before: Range<usize>,
        connectivity: Connectivity,
        joined: &mut UnionFind,
    ) {
        let reach = u32::from(connectivity == Connectivity::All);
        let runs = &self.runs;
        let (mut a, mut b) = (here.start, before.start);
        while a < here.end && b < before.end {
            if runs[a].start < runs[b].end + reach && runs[b].start < runs[a].end + reach {
                joined.join(a, b);
            }
            // The run that ends first cannot touch anything further along.
            if runs[a].end < runs[b].end { a += 1 } else { b += 1 }
        }
    }
}

/// The runs of some rows, and how many come before each of these rows.
fn cut_rows(bits: &Bits, rows: Range<usize>) -> (Vec<Run>, Vec<u32>) {
    let mut runs = Vec::new();
    let mut n_before = Vec::with_capacity(rows.len());
    for row in rows {
        // A slice of a volume that fits in memory has fewer than 2³² runs, and a row fewer voxels.
        n_before.push(runs.len() as u32);
        if bits.row(row).iter().any(|&word| word != 0) {
            runs.extend(bits.runs(row).map(|run| Run { start: run.start as u32, end: run.end as u32 }));
        }
    }
    (runs, n_before)
}

/// The rows before row (y, z) in storage order that its voxels can touch.
fn rows_before([y, z]: [usize; 2], ny: usize, connectivity: Connectivity) -> [Option<usize>; 4] {
    let row = z * ny + y;
    let by_corner = connectivity == Connectivity::All;
    [
        (y > 0).then(|| row - 1),
        (z > 0 && y > 0 && by_corner).then(|| row - ny - 1),
        (z > 0).then(|| row - ny),
        (z > 0 && y + 1 < ny && by_corner).then(|| row - ny + 1),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flood::{flood, random_bits};

    #[test]
    fn equals_flood_fill_on_random_volumes() {
        for case in 0..300 {
            let bits = random_bits(case);
            let [nx, ny, _] = bits.shape();
            let runs = Runs::cut(&bits);
            for connectivity in [Connectivity::Faces, Connectivity::All] {
                let components = runs.components(connectivity);
                let mut found = vec![usize::MAX; nx * bits.n_rows()];
                for row in 0..runs.n_rows() {
                    for run in runs.of_row(row) {
                        let range = runs.all()[run].range();
                        found[row * nx..][range].fill(components.of_run[run]);
                    }
                }
                assert_eq!(found, flood(&bits, true, connectivity), "case {case} {connectivity:?}");
            }
            for (index, x) in (0..nx * bits.n_rows()).map(|index| (index, index % nx)) {
                let voxel = [x, index / nx % ny, index / (nx * ny)];
                let run = runs.find(voxel).filter(|&run| runs.all()[run].range().contains(&x));
                assert_eq!(run.is_some(), bits.get(voxel), "case {case} {voxel:?}");
            }
        }
    }
}
