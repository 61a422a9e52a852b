//! An irregular stack on an even orthogonal grid.
//!
//! **Input** the slices of a tilted or uneven stack, decoded. **Output** voxels on the grid of a [`Plan`].
//! **Steps** 1. the grid: the slices' own axes and pixel spacing; along the normal the distance that a quarter of the
//! slices keep or undercut, stretched so that the first and the last plane lie on the first and the last slice;
//! aside, room for every slice; 2. each plane between the two slices around it: linear along the normal, bilinear
//! within each slice, since the slices lie aside of each other; masks and labels by the policy of
//! [`interpolate`](crate::interpolate), where the modality says whether they may be labels; 3. outside the slices the
//! smallest value of all, which is air in a CT.
//! **Guarantees** a value stands where the headers say it was measured, in mm; on a slice that needs no shift by
//! parts of a pixel the values are the slice's own.
//! **Cost** O(new voxels), in parallel over planes.

use espalier_model::Report;
use glam::{DAffine3, DVec2};
use rayon::prelude::*;

use super::error::Irregularity;
use super::stack::Stack;
use crate::interpolate::{Between, Number, Policy};

/// A plane is a slice if it is nearer than this share of the step: positions are written with few decimals.
const ON_SLICE: f64 = 0.02;

/// The grid, and where the slices lie on it.
pub(super) struct Plan {
    pub(super) shape: [usize; 3],
    /// Maps voxel coordinates to LPS+ mm.
    pub(super) lps_from_voxel: DAffine3,
    old_size: [usize; 2],
    /// The position of each slice along the normal, in new planes, and their distance in mm.
    heights: Vec<f64>,
    step_mm: f64,
    /// Where the first pixel of each slice lies, in new voxels.
    offsets: Vec<DVec2>,
}

impl Plan {
    pub(super) fn of(stack: &Stack) -> Self {
        let first = &stack.images[0].slice;
        let spacing = DVec2::from_array(first.spacing);
        let total = stack.heights[stack.heights.len() - 1];
        let mut distances: Vec<f64> = stack.heights.windows(2).map(|pair| pair[1] - pair[0]).collect();
        distances.sort_by(f64::total_cmp);
        // A quarter, and not the smallest: one slice that overlaps another must not multiply the volume.
        let wanted = distances[(distances.len() - 1) / 4];
        let n_steps = (total / wanted).round().max(1.0);
        let step = total / n_steps;

        let offsets: Vec<DVec2> = stack.offsets.iter().map(|&offset| offset / spacing).collect();
        let low = offsets.iter().copied().fold(DVec2::INFINITY, DVec2::min);
        let high = offsets.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
        // Rounding must not add a column.
        let extra = (high - low - 1e-6).ceil().max(DVec2::ZERO);
        let [nx, ny] = first.stored.size;
        let [x, y] = first.axes;
        let origin = first.position + x * (low.x * spacing.x) + y * (low.y * spacing.y);
        Self {
            shape: [
                nx.saturating_add(extra.x as usize),
                ny.saturating_add(extra.y as usize),
                (n_steps as usize).saturating_add(1),
            ],
            lps_from_voxel: DAffine3::from_cols(x * spacing.x, y * spacing.y, x.cross(y) * step, origin),
            old_size: first.stored.size,
            heights: stack.heights.iter().map(|height| height / step).collect(),
            step_mm: step,
            offsets: offsets.iter().map(|&offset| offset - low).collect(),
        }
    }
}

impl Plan {
    /// Whether a plane is one of the slices.
    fn is_on_slice(&self, z: usize) -> bool {
        let next = self.heights.partition_point(|&height| height < z as f64 - ON_SLICE);
        self.heights.get(next).is_some_and(|height| height - z as f64 <= ON_SLICE)
    }

    /// The largest distance between slices, over which values had to be made up.
    fn widest_gap_mm(&self) -> f64 {
        self.heights.windows(2).map(|pair| (pair[1] - pair[0]) * self.step_mm).fold(0.0, f64::max)
    }
}

/// Fills `new`, which has the plan's shape, from numbers, their scaling, and whether they are known to be intensities.
pub(super) fn resample<T: Number>(
    (old, scaling, is_scan): (&[T], (f64, f64), bool),
    (plan, irregularity): (&Plan, &Irregularity),
    new: &mut [T],
    report: &mut Report,
) {
    let [nx, ny, nz] = plan.shape;
    let sampler = Sampler { old, plan, between: Between::of(old, scaling, is_scan) };
    let planes = new.par_chunks_mut(nx * ny).enumerate();
    let n_outside: usize = planes.map(|(z, plane)| sampler.fill_plane(z, plane)).sum();
    let n_between = (0..nz).filter(|&z| !plan.is_on_slice(z)).count();
    report.count_usize("dicom_planes", nz);
    report.count_usize("dicom_planes_between_slices", n_between);
    report.count("dicom_widest_gap_mm", plan.widest_gap_mm());
    report.count_usize("dicom_voxels_outside_slices", n_outside);
    if let Some((degrees, _)) = irregularity.tilt {
        report.count("dicom_tilt_deg", degrees);
    }
    let n_missing = irregularity.missing.iter().map(|(n_missing, ..)| n_missing).sum();
    report.count_usize("dicom_missing_slices", n_missing);
    let [ox, oy] = plan.old_size;
    let how = sampler.between.words();
    let n_slices = plan.heights.len();
    report.warn(
        "W-DICOM-RESAMPLED",
        format!(
            "{irregularity}: {n_slices} slices of {ox}x{oy} were resampled to {nx}x{ny}x{nz} even orthogonal voxels by \
             {how}; {n_between} of {nz} planes lie between slices, up to {:.2} mm apart, and {:.1} % of the voxels \
             outside of them",
            plan.widest_gap_mm(),
            100.0 * n_outside as f64 / (nx * ny * nz) as f64
        ),
    );
}

struct Sampler<'a, T> {
    old: &'a [T],
    plan: &'a Plan,
    between: Between<T>,
}

impl<T: Number> Sampler<'_, T> {
    /// Fills a plane; tells how many of its voxels lie outside the slices.
    fn fill_plane(&self, z: usize, plane: &mut [T]) -> usize {
        let heights = &self.plan.heights;
        let here = z as f64;
        // The slice at or below the plane, and the share of the one above.
        let below = heights.partition_point(|&height| height <= here + 1e-9).clamp(1, heights.len() - 1) - 1;
        let share = ((here - heights[below]) / (heights[below + 1] - heights[below])).clamp(0.0, 1.0);
        let [nx, _, _] = self.plan.shape;
        let mut n_outside = 0;
        for (index, voxel) in plane.iter_mut().enumerate() {
            let point = DVec2::new((index % nx) as f64, (index / nx) as f64);
            let value = if self.between.policy == Policy::Labels {
                self.nearest(below + usize::from(share >= 0.5), point)
            } else {
                self.blend(below, share, point)
            };
            n_outside += usize::from(value.is_none());
            *voxel = value.unwrap_or(self.between.fill);
        }
        n_outside
    }

    /// Where only one slice reaches, the nearer of the two decides.
    fn blend(&self, below: usize, share: f64, point: DVec2) -> Option<T> {
        // A slice without weight is not looked at, so that a plane on a slice is that slice.
        let lower = if share < 1.0 { self.bilinear(below, point) } else { None };
        let upper = if share > 0.0 { self.bilinear(below + 1, point) } else { None };
        let value = match (lower, upper) {
            (Some(a), Some(b)) => a + share * (b - a),
            (Some(a), None) if share < 0.5 => a,
            (None, Some(b)) if share >= 0.5 => b,
            _ => return None,
        };
        Some(self.between.settle(value))
    }

    fn bilinear(&self, slice: usize, point: DVec2) -> Option<f64> {
        let local = self.inside(slice, point)?;
        let base = local.floor();
        let weight = local - base;
        let [x, y] = [base.x as usize, base.y as usize];
        let at = |x: usize, y: usize| self.at(slice, [x, y]).to_f64();
        let row = |y: usize| {
            let left = at(x, y);
            if weight.x > 0.0 { left + weight.x * (at(x + 1, y) - left) } else { left }
        };
        let lower = row(y);
        Some(if weight.y > 0.0 { lower + weight.y * (row(y + 1) - lower) } else { lower })
    }

    fn nearest(&self, slice: usize, point: DVec2) -> Option<T> {
        let local = (self.inside(slice, point)? + 0.5).floor();
        Some(self.at(slice, [local.x as usize, local.y as usize]))
    }

    /// The point in a slice's own pixels, if its cell is in the slice; at most half a pixel is clamped.
    fn inside(&self, slice: usize, point: DVec2) -> Option<DVec2> {
        let local = point - self.plan.offsets[slice];
        let far = DVec2::new(self.plan.old_size[0] as f64 - 1.0, self.plan.old_size[1] as f64 - 1.0);
        let is_inside = local.cmpge(DVec2::splat(-0.5)).all() && local.cmple(far + 0.5).all();
        is_inside.then(|| local.clamp(DVec2::ZERO, far))
    }

    fn at(&self, slice: usize, [x, y]: [usize; 2]) -> T {
        let [nx, ny] = self.plan.old_size;
        self.old[(slice * ny + y) * nx + x]
    }
}
