//! Exact anisotropic Euclidean distance to the background.
//!
//! **Input** a mask. **Output** for each foreground voxel the distance from its centre to the nearest background
//! centre, in mm.
//! **Notation** a *run* is a maximal row of foreground voxels along one axis.
//! **Steps** For x, then y, then z, each run on its own: the squared distances so far are the heights of parabolas,
//! the background voxels at the run's ends parabolas of height 0; the lower envelope is the distance with this
//! axis taken in. Nothing beyond a run's end can be nearer than that end, so runs are independent.
//! **Guarantees** exact up to rounding in `f64`; the border of the scan is not background; the result does not
//! depend on the number of threads.
//! **Source** [Felzenszwalb2012] section 2.1, restricted to runs.
//! **Cost** O(foreground) time; eight bytes a voxel of the foreground's box, of which the system provides only
//! the pages that hold foreground.

use std::ops::Range;

use espalier_model::Mask;
use glam::DVec3;
use rayon::prelude::*;

use crate::Error;

/// Runs that one task takes: enough to hide its start, few enough to share out.
const RUNS_PER_TASK: usize = 1024;

/// The distance of each foreground voxel to the background.
#[derive(Clone, Debug)]
pub struct DistanceField {
    /// First voxel of the box that is held: the foreground's and one voxel more, inside the scan.
    low: [usize; 3],
    /// Extents of the box.
    shape: [usize; 3],
    spacing_mm: DVec3,
    /// Squared distance in mm², x fastest; 0 for background, infinite where a mask has no background at all.
    squared: Vec<f64>,
}

/// The exact distance field of a mask.
///
/// ```
/// use espalier_model::{Grid, Mask};
/// let grid = Grid::axis_aligned([5, 1, 1], glam::DVec3::new(0.5, 1.0, 1.0), glam::DVec3::ZERO)?;
/// let field = espalier_radius::distance_field(&Mask::from_voxels(grid, &[false, true, true, true, true]));
/// assert_eq!(field.distance_mm([4, 0, 0]), 2.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[must_use]
pub fn distance_field(mask: &Mask) -> DistanceField {
    let spacing_mm = mask.grid().spacing_mm();
    let (low, shape) = box_of(mask);
    let squared = vec![0.0; shape[0] * shape[1] * shape[2]];
    let mut field = DistanceField { low, shape, spacing_mm, squared };

    let foreground = field.foreground(mask);
    for &cell in &foreground {
        field.squared[cell] = f64::INFINITY;
    }
    for axis in 0..3 {
        field.take_in(axis, &foreground);
    }
    field
}

/// [`distance_field`], where it may take so many bytes of memory.
///
/// # Errors
/// [`Error::FieldTooLarge`] if it needs more.
pub fn distance_field_within(mask: &Mask, max_bytes: u64) -> Result<DistanceField, Error> {
    let (_, shape) = box_of(mask);
    let bytes_each = size_of::<f64>() as u64;
    let needed = shape.iter().fold(bytes_each, |product, &extent| product.saturating_mul(extent as u64));
    if needed > max_bytes {
        Err(Error::FieldTooLarge { needed, limit: max_bytes })
    } else {
        Ok(distance_field(mask))
    }
}

/// First voxel and extents of the box that is held; no voxel of an empty mask.
fn box_of(mask: &Mask) -> ([usize; 3], [usize; 3]) {
    let Some((first, last)) = mask.bounding_box() else { return ([0; 3], [0; 3]) };
    let low = first.map(|c| c.saturating_sub(1));
    let shape = [0, 1, 2].map(|axis| (last[axis] + 2).min(mask.grid().shape()[axis]) - low[axis]);
    (low, shape)
}

impl DistanceField {
    /// The distance from a voxel's centre to the nearest background centre, in mm; 0 for background and outside
    /// the scan, infinite in a mask without background.
    #[must_use]
    pub fn distance_mm(&self, voxel: [i64; 3]) -> f64 {
        self.cell(voxel).map_or(0.0, |cell| self.squared[cell].sqrt())
    }

    fn cell(&self, voxel: [i64; 3]) -> Option<usize> {
        let mut at = [0; 3];
        for axis in 0..3 {
            let offset = voxel[axis] - self.low[axis] as i64;
            at[axis] = usize::try_from(offset).ok().filter(|&offset| offset < self.shape[axis])?;
        }
        Some((at[2] * self.shape[1] + at[1]) * self.shape[0] + at[0])
    }

    /// The foreground cells of the box, in storage order.
    fn foreground(&self, mask: &Mask) -> Vec<usize> {
        let [nx, ny, nz] = self.shape;
        let rows = (0..ny * nz).into_par_iter().map(|row| {
            let scan_row = (self.low[2] + row / ny) * mask.grid().shape()[1] + self.low[1] + row % ny;
            let cells = |run: Range<usize>| run.map(move |x| row * nx + x - self.low[0]);
            mask.bits().runs(scan_row).flat_map(cells).collect::<Vec<_>>()
        });
        rows.collect::<Vec<_>>().concat()
    }

    /// Takes one more axis into the squared distances.
    fn take_in(&mut self, axis: usize, foreground: &[usize]) {
        let stride: usize = self.shape[..axis].iter().product();
        let place = |cell: usize| cell / stride % self.shape[axis];
        let is_start = |cell: usize| place(cell) == 0 || self.squared[cell - stride] == 0.0;
        let starts: Vec<usize> = foreground.par_iter().copied().filter(|&cell| is_start(cell)).collect();
        let spacing = self.spacing_mm[axis];

        let transformed: Vec<Vec<f64>> = starts
            .par_chunks(RUNS_PER_TASK)
            .map(|starts| {
                let mut out = Vec::new();
                let mut heights = Vec::new();
                let mut envelope = Envelope::default();
                for &start in starts {
                    let opens = place(start) > 0;
                    let closes = self.read_run(start, stride, self.shape[axis] - place(start), &mut heights);
                    envelope.transform(&heights, [opens, closes], spacing, &mut out);
                }
                out
            })
            .collect();

        for (starts, values) in starts.chunks(RUNS_PER_TASK).zip(&transformed) {
            let mut values = values.iter();
            for &start in starts {
                let mut cell = start;
                let end = start + (self.shape[axis] - start / stride % self.shape[axis]) * stride;
                while cell < end && self.squared[cell] != 0.0 {
                    self.squared[cell] = values.next().copied().unwrap_or(0.0);
                    cell += stride;
                }
            }
        }
    }

    /// Reads the run from `start`, at most `limit` long; returns whether background closes it.
    fn read_run(&self, start: usize, stride: usize, limit: usize, heights: &mut Vec<f64>) -> bool {
        heights.clear();
        let run = (0..limit).map(|step| self.squared[start + step * stride]);
        heights.extend(run.take_while(|&height| height != 0.0));
        heights.len() < limit
    }
}

/// A lower envelope of parabolas, kept between runs to save allocations.
#[derive(Default)]
struct Envelope {
    /// Apex position and height of the parabolas in the envelope, from left to right.
    parabolas: Vec<(f64, f64)>,
    /// Where each takes over from the one before.
    starts: Vec<f64>,
}

impl Envelope {
    /// Appends to `out`, for each place of a run, the least of height + distance² over the run and its closed ends.
    fn transform(&mut self, heights: &[f64], [opens, closes]: [bool; 2], spacing: f64, out: &mut Vec<f64>) {
        self.parabolas.clear();
        self.starts.clear();
        if opens {
            self.push(-spacing, 0.0);
        }
        for (place, &height) in heights.iter().enumerate().filter(|(_, height)| height.is_finite()) {
            self.push(place as f64 * spacing, height);
        }
        if closes {
            self.push(heights.len() as f64 * spacing, 0.0);
        }
        if self.parabolas.is_empty() {
            out.extend(heights);
            return;
        }
        let mut current = 0;
        for place in 0..heights.len() {
            let x = place as f64 * spacing;
            while self.starts.get(current + 1).is_some_and(|&start| start <= x) {
                current += 1;
            }
            let (apex, height) = self.parabolas[current];
            out.push((x - apex) * (x - apex) + height);
        }
    }

    fn push(&mut self, apex: f64, height: f64) {
        while let (Some(&(last_apex, last_height)), Some(&last_start)) =
            (self.parabolas.last(), self.starts.last())
        {
            let meeting = 0.5 * ((height - last_height) / (apex - last_apex) + apex + last_apex);
            if meeting > last_start {
                self.parabolas.push((apex, height));
                self.starts.push(meeting);
                return;
            }
            self.parabolas.pop();
            self.starts.pop();
        }
        self.parabolas.push((apex, height));
        self.starts.push(f64::NEG_INFINITY);
    }
}
