//! Gaps narrower than a ball, closed.
//!
//! **Input** the bits of a mask, its grid, a radius in mm. **Output** the same with every background voxel set that no
//! ball of this radius can reach without touching the mask, and a ledger entry for each patch of them.
//! **Notation** M the mask; B the ball, the voxels whose centres lie within the radius of the centre of one; a chord is
//! the part of B on one line along x; D all voxels that a ball about a voxel of M covers.
//! **Steps** 1. the chords of B, by the spacing along each axis; 2. D, by the runs of M: a run of a row, longer by half a
//! chord at either end, in the row that the chord is aside; 3. of the voxels of D that are not in M, those whose whole
//! ball lies in D: every gap of a row of D, longer by half a chord, is taken away from the row that the chord is aside;
//! 4. the patches of what is left, 26-connected, largest first.
//! **Guarantees** the closing on an unbounded grid, so that the volume's edge is neither background nor foreground: it
//! holds M, done twice it changes nothing, and it stays inside the box of M. The result does not depend on the number of
//! threads. Memory is known before it is taken.
//! **Source** the closing of [Serra1982], dilation and then erosion.
//! **Differs from the source** nothing; beside M's box nothing is looked at.
//! **Cost** O(chords · (runs of M + rows near M)) time; two masks and the box of M, wider by two radii, in memory.

use espalier_model::{Bits, Grid, LedgerEntry, LedgerKind};
use rayon::prelude::*;

use crate::Error;
use crate::components::{Component, measure};
use crate::error::check_memory;
use crate::runs::{Connectivity, Runs};

/// The most voxels that a radius may span: a closing of a tree of vessels bridges a few; one that spans more is a
/// mistake in the unit, and takes time with its square.
const MAX_REACH: f64 = 64.0;
/// A centre that is off by rounding is still in the ball.
const ROUNDING: f64 = 1e-9;
/// The most patches that the ledger lists one by one.
const MAX_LISTED: usize = 200;

/// What was filled.
pub(crate) struct Closed {
    pub(crate) n_voxels: usize,
    pub(crate) n_patches: usize,
    pub(crate) entries: Vec<LedgerEntry>,
}

/// Closes gaps of a mask; refused where the radius spans too many voxels, or takes more memory than `max_bytes`.
pub(crate) fn close(bits: &mut Bits, grid: &Grid, radius_mm: f64, max_bytes: u64) -> Result<Closed, Error> {
    let Some((low, high)) = bits.bounding_box() else {
        return Ok(Closed { n_voxels: 0, n_patches: 0, entries: Vec::new() });
    };
    let ball = Ball::new(grid, radius_mm)?;
    let frame = Frame { low, extents: [0, 1, 2].map(|axis| high[axis] - low[axis] + 1), reach: ball.reach };
    frame.check(bits, max_bytes)?;
    let runs = Runs::cut(bits);
    let dilated: Vec<Bits> =
        (0..frame.wide(2)).into_par_iter().map(|z| ball.dilated_plane(&runs, bits, &frame, z)).collect();
    let planes: Vec<Bits> =
        (0..frame.extents[2]).into_par_iter().map(|z| ball.filled_plane(&dilated, bits, &frame, z)).collect();
    drop(dilated);

    let mut added = Bits::new(bits.shape());
    for (z, plane) in planes.iter().enumerate() {
        for y in 0..frame.extents[1] {
            let row = frame.row(bits, [y, z]);
            for run in plane.runs(y) {
                added.fill_run(row, run.start + low[0]..run.end + low[0]);
            }
        }
    }
    bits.words_mut().iter_mut().zip(added.words()).for_each(|(word, more)| *word |= more);
    Ok(listed(&added, grid, radius_mm))
}

/// The part of the ball on one line along x.
#[derive(Clone, Copy)]
struct Chord {
    /// How many rows it is aside along y and z.
    aside: [i64; 2],
    /// How many voxels it reaches to either side along x.
    half: usize,
}

struct Ball {
    chords: Vec<Chord>,
    /// How many voxels it reaches along each axis.
    reach: [usize; 3],
}

impl Ball {
    fn new(grid: &Grid, radius_mm: f64) -> Result<Self, Error> {
        let spacing_mm = grid.spacing_mm();
        let longest = radius_mm / spacing_mm.min_element();
        if longest > MAX_REACH {
            return Err(Error::Closing {
                radius_mm,
                n_voxels: longest,
                largest_mm: MAX_REACH * spacing_mm.min_element(),
            });
        }
        let within = radius_mm * (1.0 + ROUNDING);
        let reach = (spacing_mm.recip() * within).floor().to_array().map(|reach| reach as usize);
        let span = |axis: usize| -(reach[axis] as i64)..=reach[axis] as i64;
        let chord = |[y, z]: [i64; 2]| {
            let (y_mm, z_mm) = (y as f64 * spacing_mm.y, z as f64 * spacing_mm.z);
            let left = within * within - y_mm * y_mm - z_mm * z_mm;
            let half = (left.max(0.0).sqrt() / spacing_mm.x).floor() as usize;
            (left >= 0.0).then_some(Chord { aside: [y, z], half })
        };
        let chords = span(2).flat_map(|z| span(1).map(move |y| [y, z])).filter_map(chord).collect();
        Ok(Self { chords, reach })
    }

    /// A plane of D, in the wide frame.
    fn dilated_plane(&self, runs: &Runs, bits: &Bits, frame: &Frame, z: usize) -> Bits {
        let mut plane = Bits::new([frame.wide(0), frame.wide(1), 1]);
        for y in 0..frame.wide(1) {
            for chord in &self.chords {
                let Some(source) = frame.narrow_row(bits, [y, z], chord.aside) else { continue };
                for run in runs.row(source) {
                    let start = run.start as usize - frame.low[0] + frame.reach[0];
                    plane.fill_run(y, start - chord.half..start + run.len() + chord.half);
                }
            }
        }
        plane
    }

    /// A plane of what is to be filled, in the box of M.
    fn filled_plane(&self, dilated: &[Bits], bits: &Bits, frame: &Frame, z: usize) -> Bits {
        let [nx, ny, _] = frame.extents;
        let mut plane = Bits::new([nx, ny, 1]);
        for y in 0..ny {
            plane.fill_run(y, 0..nx);
            for run in bits.runs(frame.row(bits, [y, z])) {
                plane.clear_run(y, run.start - frame.low[0]..run.end - frame.low[0]);
            }
            for chord in &self.chords {
                let at = |v: usize, axis: usize| {
                    (v + frame.reach[axis]).wrapping_add_signed(chord.aside[axis - 1] as isize)
                };
                // What is left before a run of D, between two, and after the last.
                let mut gap_start = 0;
                let ends = std::iter::once(frame.wide(0)..frame.wide(0));
                for run in dilated[at(z, 2)].runs(at(y, 1)).chain(ends) {
                    if gap_start < run.start {
                        let start = gap_start.saturating_sub(chord.half + frame.reach[0]);
                        let end = (run.start + chord.half).saturating_sub(frame.reach[0]).min(nx);
                        plane.clear_run(y, start..end.max(start));
                    }
                    gap_start = run.end;
                }
                if plane.row(y).iter().all(|&word| word == 0) {
                    break;
                }
            }
        }
        plane
    }
}

/// The box of M, and the wide one that is larger by the ball's reach on each side.
struct Frame {
    low: [usize; 3],
    extents: [usize; 3],
    reach: [usize; 3],
}

impl Frame {
    fn wide(&self, axis: usize) -> usize {
        self.extents[axis] + 2 * self.reach[axis]
    }

    /// The row of the volume at (y, z) of the box.
    fn row(&self, bits: &Bits, [y, z]: [usize; 2]) -> usize {
        (z + self.low[2]) * bits.shape()[1] + y + self.low[1]
    }

    /// The row of the volume that is `aside` of (y, z) of the wide box, if it is in the box of M.
    fn narrow_row(&self, bits: &Bits, [y, z]: [usize; 2], aside: [i64; 2]) -> Option<usize> {
        let inside = |v: usize, axis: usize| {
            let v = v.checked_add_signed(aside[axis - 1] as isize)?.checked_sub(self.reach[axis])?;
            (v < self.extents[axis]).then_some(v)
        };
        Some(self.row(bits, [inside(y, 1)?, inside(z, 2)?]))
    }

    /// Whether D and two masks fit the memory.
    fn check(&self, bits: &Bits, max_bytes: u64) -> Result<(), Error> {
        let wide_words = self.wide(0).div_ceil(64) as u64;
        let n_wide = [wide_words, self.wide(1) as u64, self.wide(2) as u64];
        let n_words = n_wide.iter().fold(1_u64, |product, &n| product.saturating_mul(n));
        let needed = n_words.saturating_add(2 * bits.words().len() as u64).saturating_mul(8);
        check_memory("closing gaps", needed, max_bytes)
    }
}

/// Counts and lists the patches.
fn listed(added: &Bits, grid: &Grid, radius_mm: f64) -> Closed {
    let runs = Runs::cut(added);
    let mut patches = measure(&runs, &runs.components(Connectivity::All), grid);
    patches.sort_by_key(|patch| std::cmp::Reverse(patch.n_voxels));
    let entry = |patch: &Component, what: String| LedgerEntry {
        kind: LedgerKind::GapClosed,
        position_mm: patch.centroid_mm(grid),
        radius_mm: 0.0,
        length_mm: 0.0,
        reason: format!("{what} filled: no ball of {radius_mm} mm fits between the mask"),
    };
    let n_listed = patches.len().min(MAX_LISTED);
    let mut entries: Vec<LedgerEntry> =
        patches[..n_listed].iter().map(|patch| entry(patch, format!("{} voxels", patch.n_voxels))).collect();
    let mut rest = Component::default();
    patches[n_listed..].iter().for_each(|patch| rest.add(*patch));
    if rest.n_voxels > 0 {
        let n = patches.len() - n_listed;
        entries.push(entry(&rest, format!("{n} further patches of {} voxels", rest.n_voxels)));
    }
    Closed { n_voxels: added.count(), n_patches: patches.len(), entries }
}
