//! Drawing a body on a voxel grid.
//!
//! **Input** [`Body`], an axis-aligned [`Grid`]. **Output** per slice, for each voxel, which of its 27 sample
//! points lie inside: 27 bits, a 3 × 3 × 3 pattern at −1/3, 0, +1/3 of the spacing about the centre.
//! **Guarantees** a voxel is in the mask exactly if its centre lies in the body or on its surface; bits are
//! joined by OR, so the order of cones and the number of threads do not matter.
//! **Cost** O(voxels in the cones' boxes), 27-fold only for voxels that a surface may cut.

use espalier_model::{Bits, Grid, Mask};
use glam::DVec3;
use rayon::prelude::*;

use crate::Error;
use crate::body::{Body, Cone};

/// Sample points per voxel.
pub(crate) const N_SAMPLES: u32 = 27;
/// All samples inside.
const FULL: u32 = (1 << N_SAMPLES) - 1;
/// The sample at the voxel's centre.
const CENTRE: u32 = 1 << 13;
/// The largest number of tests of a voxel against a cone: about a minute on one core.
const MAX_TESTS: f64 = 4e9;

/// The largest number of pairs of a cone and a slice that it touches: half a gigabyte.
const MAX_ENTRIES: f64 = 1.3e8;

/// A body sorted into the slices of a grid.
pub(crate) struct Raster<'a> {
    body: &'a Body,
    spacing: DVec3,
    origin: DVec3,
    shape: [usize; 3],
    /// The cones that touch slice z are `list[offsets[z]..offsets[z + 1]]`.
    offsets: Vec<usize>,
    list: Vec<u32>,
}

/// What is asked of each voxel.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Samples {
    CentreOnly,
    All,
}

/// The voxels along x, y, z, from first to one past the last, that a cone may reach.
fn reach(cone: &Cone, (origin, spacing): (DVec3, DVec3), shape: [usize; 3]) -> [(usize, usize); 3] {
    let (low, high) = cone.bounds();
    // Half a voxel more, since samples lie off the centre.
    let (low, high) = ((low - origin) / spacing - 0.5, (high - origin) / spacing + 0.5);
    [0, 1, 2].map(|axis| {
        let extent = shape[axis] as f64;
        let first = low[axis].ceil().clamp(0.0, extent) as usize;
        let end = (high[axis].floor() + 1.0).clamp(0.0, extent) as usize;
        (first, end.max(first))
    })
}

impl<'a> Raster<'a> {
    /// Sorts the cones of `body` into the slices of an axis-aligned `grid`.
    pub(crate) fn new(body: &'a Body, grid: &Grid) -> Result<Self, Error> {
        let (spacing, shape) = (grid.spacing_mm(), grid.shape());
        let origin = grid.world_from_voxel().translation;
        let boxes = || body.cones.iter().map(|cone| reach(cone, (origin, spacing), shape));
        let n_tests: f64 =
            boxes().map(|b| b.iter().map(|(first, end)| (end - first) as f64).product::<f64>()).sum();
        // The list below holds an entry for each cone and slice.
        let n_entries: f64 = boxes().map(|[_, _, (first, end)]| (end - first) as f64).sum();
        if n_tests > MAX_TESTS || n_entries > MAX_ENTRIES {
            return Err(Error::TooMuchWork { n_cones: body.cones.len(), n_tests, limit: MAX_TESTS });
        }
        let mut offsets = vec![0; shape[2] + 1];
        for [_, _, (first, end)] in boxes() {
            offsets[first + 1..=end].iter_mut().for_each(|count| *count += 1);
        }
        for z in 0..shape[2] {
            offsets[z + 1] += offsets[z];
        }
        let mut next = offsets.clone();
        let mut list = vec![0; offsets[shape[2]]];
        for (cone_idx, [_, _, (first, end)]) in boxes().enumerate() {
            for slot in &mut next[first..end] {
                list[*slot] = cone_idx as u32;
                *slot += 1;
            }
        }
        Ok(Self { body, spacing, origin, shape, offsets, list })
    }

    /// The sample bits of slice z, x fastest.
    pub(crate) fn slice(&self, z: usize) -> Vec<u32> {
        self.draw(z, Samples::All)
    }

    fn draw(&self, z: usize, samples: Samples) -> Vec<u32> {
        let [nx, ny, _] = self.shape;
        let mut bits = vec![0; nx * ny];
        let half_diagonal = 0.5 * self.spacing.length();
        for &cone_idx in &self.list[self.offsets[z]..self.offsets[z + 1]] {
            let cone = &self.body.cones[cone_idx as usize];
            let [(x_first, x_end), (y_first, y_end), _] =
                reach(cone, (self.origin, self.spacing), self.shape);
            for y in y_first..y_end {
                for x in x_first..x_end {
                    let voxel = &mut bits[y * nx + x];
                    if *voxel == FULL {
                        continue;
                    }
                    let center = self.origin + self.spacing * DVec3::new(x as f64, y as f64, z as f64);
                    let depth = cone.depth_mm(center);
                    if depth > half_diagonal {
                        *voxel = FULL;
                    } else if samples == Samples::CentreOnly {
                        *voxel |= if depth >= 0.0 { CENTRE } else { 0 };
                    } else if depth > -half_diagonal {
                        *voxel |= self.sample(cone, center);
                    }
                }
            }
        }
        bits
    }

    /// Which of the 27 samples about `center` lie in the cone.
    fn sample(&self, cone: &Cone, center: DVec3) -> u32 {
        let third = self.spacing / 3.0;
        (0..N_SAMPLES).fold(0, |bits, sample| {
            let step = |digit: u32| f64::from(digit % 3) - 1.0;
            let offset = third * DVec3::new(step(sample), step(sample / 3), step(sample / 9));
            bits | u32::from(cone.depth_mm(center + offset) >= 0.0) << sample
        })
    }
}

/// The mask of a body: the voxels whose centre lies in it or on its surface.
pub(crate) fn mask(body: &Body, grid: &Grid) -> Result<Mask, Error> {
    let raster = Raster::new(body, grid)?;
    let [nx, ny, _] = raster.shape;
    let mut bits = Bits::new(raster.shape);
    let words_per_row = bits.words_per_row();
    bits.words_mut().par_chunks_mut(words_per_row * ny).enumerate().for_each(|(z, slice)| {
        let samples = raster.draw(z, Samples::CentreOnly);
        for (row, samples) in slice.chunks_exact_mut(words_per_row).zip(samples.chunks_exact(nx)) {
            for (x, _) in samples.iter().enumerate().filter(|&(_, sample)| sample & CENTRE != 0) {
                row[x / 64] |= 1 << (x % 64);
            }
        }
    });
    Ok(Mask::new(grid.clone(), bits))
}
