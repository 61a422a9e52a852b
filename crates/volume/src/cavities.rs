//! Cavities filled.
//!
//! **Input** [`Bits`] and their runs. **Output** the same, with every closed-in piece of background set.
//! **Notation** a gap is a run of background between two runs of foreground of one row; all other background of
//! the row reaches its end.
//! **Steps** 1. join gaps of neighbouring rows that share a face, the counterpart of a 26-connected foreground;
//! 2. a gap that shares a face with background that reaches the end of its row, or with the border of the volume,
//! is outside, and all that is joined with it; 3. fill the others.
//! **Why gaps?** What reaches the end of a row is outside by itself, so the background need not be labelled: rows
//! without foreground cost nothing.
//! **Guarantees** the background is one piece with the outside; the foreground's components and tunnels stay.
//! **Cost** O(rows + runs · α(runs)) time, O(runs) memory.

use espalier_geom::union_find::UnionFind;
use espalier_model::Bits;

use crate::runs::{Run, Runs};

/// The cavities of a volume.
pub(crate) struct Cavities {
    pub(crate) n_cavities: usize,
    pub(crate) n_voxels: usize,
    /// Row and extent of the runs that fill them.
    fillings: Vec<(usize, Run)>,
}

/// A run of background between two of foreground.
struct Gaps {
    gaps: Vec<Run>,
    row_starts: Vec<usize>,
}

/// Finds the cavities of the volume with these runs.
pub(crate) fn find(runs: &Runs, [_, ny, nz]: [usize; 3]) -> Cavities {
    let gaps = Gaps::of(runs);
    let mut joined = UnionFind::new(gaps.gaps.len());
    let mut is_outside = vec![false; gaps.gaps.len()];
    for row in 0..runs.n_rows() {
        let (y, z) = (row % ny, row / ny);
        let neighbours = [(y > 0).then(|| row - 1), (z > 0).then(|| row - ny)];
        for before in neighbours.into_iter().flatten() {
            gaps.join_touching(row, before, &mut joined);
            gaps.mark_open(row, runs.row(before), &mut is_outside);
            gaps.mark_open(before, runs.row(row), &mut is_outside);
        }
        if y == 0 || y + 1 == ny || z == 0 || z + 1 == nz {
            is_outside[gaps.row_starts[row]..gaps.row_starts[row + 1]].fill(true);
        }
    }
    gaps.closed_in(joined, &is_outside)
}

/// Fills them.
pub(crate) fn fill(bits: &mut Bits, cavities: &Cavities) {
    cavities.fillings.iter().for_each(|(row, run)| bits.fill_run(*row, run.range()));
}

impl Gaps {
    fn of(runs: &Runs) -> Self {
        let mut gaps = Vec::new();
        let mut row_starts = vec![0];
        for row in 0..runs.n_rows() {
            gaps.extend(runs.row(row).windows(2).map(|pair| Run { start: pair[0].end, end: pair[1].start }));
            row_starts.push(gaps.len());
        }
        Self { gaps, row_starts }
    }

    fn join_touching(&self, row: usize, before: usize, joined: &mut UnionFind) {
        let (mut a, mut b) = (self.row_starts[row], self.row_starts[before]);
        let (a_end, b_end) = (self.row_starts[row + 1], self.row_starts[before + 1]);
        while a < a_end && b < b_end {
            let (here, there) = (self.gaps[a], self.gaps[b]);
            if here.start < there.end && there.start < here.end {
                joined.join(a, b);
            }
            if here.end < there.end { a += 1 } else { b += 1 }
        }
    }

    /// Marks the gaps of a row that share a face with background of the row `beside` that reaches its end.
    fn mark_open(&self, row: usize, beside: &[Run], is_outside: &mut [bool]) {
        let (first, last) = match beside {
            [] => (u32::MAX, 0),
            [first, ..] => (first.start, beside.last().unwrap_or(first).end),
        };
        let here = self.row_starts[row]..self.row_starts[row + 1];
        for (gap, is_outside) in self.gaps[here.clone()].iter().zip(&mut is_outside[here]) {
            *is_outside |= gap.start < first || gap.end > last;
        }
    }

    /// The gaps that are joined with none outside.
    fn closed_in(&self, joined: UnionFind, is_outside: &[bool]) -> Cavities {
        let (piece, n_pieces) = joined.into_numbers();
        let mut is_open = vec![false; n_pieces];
        piece.iter().zip(is_outside).for_each(|(&piece, &outside)| is_open[piece] |= outside);
        let mut fillings = Vec::new();
        for row in 0..self.row_starts.len() - 1 {
            let gaps = self.row_starts[row]..self.row_starts[row + 1];
            fillings.extend(gaps.filter(|&gap| !is_open[piece[gap]]).map(|gap| (row, self.gaps[gap])));
        }
        Cavities {
            n_cavities: is_open.iter().filter(|&&open| !open).count(),
            n_voxels: fillings.iter().map(|(_, run)| run.len()).sum(),
            fillings,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flood::{flood, random_bits};
    use crate::runs::Connectivity;

    /// The cavities by flood fill: components of the background by faces that touch no border.
    fn plain(bits: &Bits) -> (Bits, usize) {
        let [nx, ny, nz] = bits.shape();
        let component = flood(bits, false, Connectivity::Faces);
        let n_components = component.iter().filter(|&&c| c != usize::MAX).max().map_or(0, |&c| c + 1);
        let mut is_open = vec![false; n_components];
        let voxel = |index: usize| [index % nx, index / nx % ny, index / (nx * ny)];
        for (index, &c) in component.iter().enumerate().filter(|(_, c)| **c != usize::MAX) {
            let at_border =
                voxel(index).iter().zip([nx, ny, nz]).any(|(&v, extent)| v == 0 || v + 1 == extent);
            is_open[c] |= at_border;
        }
        let mut filled = bits.clone();
        for (index, &c) in component.iter().enumerate().filter(|(_, c)| **c != usize::MAX) {
            if !is_open[c] {
                filled.set(voxel(index));
            }
        }
        (filled, is_open.iter().filter(|&&open| !open).count())
    }

    #[test]
    fn equals_flood_fill_on_random_volumes() {
        let mut n_found = 0;
        for case in 0..400 {
            let bits = random_bits(case);
            let cavities = find(&Runs::cut(&bits), bits.shape());
            let mut filled = bits.clone();
            fill(&mut filled, &cavities);
            assert_eq!((&filled, cavities.n_cavities), (&plain(&bits).0, plain(&bits).1), "case {case}");
            assert_eq!(filled.count() - bits.count(), cavities.n_voxels, "case {case}");
            n_found += cavities.n_cavities;
        }
        assert!(n_found > 100, "the volumes have cavities: {n_found}");
    }
}
