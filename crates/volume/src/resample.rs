//! A volume or a mask at another spacing.
//!
//! **Input** a scan, or the bits of a mask, and the spacing that is wanted. **Output** the same on a grid of that
//! spacing along the same axes.
//! **Steps** 1. the grid: as many voxels along each axis as the old box needs, their box centred on the old one; 2. the
//! value at each new voxel by the policy of [`interpolate`](crate::interpolate): linear for a scan, which is resampled
//! before voxels are chosen; for a mask, and for labels that were chosen, linear and cut at a half.
//! **Guarantees** every old voxel lies in the new box, every new centre in the old one; memory is known before it is
//! taken; a spacing that is the volume's own changes nothing. The result does not depend on the number of threads.
//! **Cost** O(new voxels) for a scan; for a mask O(new voxels in rows near it).

use espalier_model::nifti_out::stored_grid;
use espalier_model::{Bits, Grid, Mask, Report, Volume};
use glam::{DAffine3, DMat3, DVec3};
use rayon::prelude::*;

use crate::Error;
use crate::Spacing;
use crate::error::check_memory;
use crate::interpolate::{Lookup, ROUNDING, bytes_per_voxel, resample_voxels};

/// A spacing that differs by less, as a share, is the same: files round to single precision.
const SAME: f64 = 1e-5;

/// A scan at the spacing; none where it has it already.
pub(crate) fn scan(
    volume: &Volume,
    spacing: Spacing,
    max_bytes: u64,
    report: &mut Report,
) -> Result<Option<Volume>, Error> {
    let Some(plan) = Plan::new(volume.grid(), spacing)? else { return Ok(None) };
    plan.check(bytes_per_voxel(volume.voxels()).saturating_mul(8), max_bytes)?;
    let [x, y, z] = &plan.axes;
    let lookup = Lookup {
        old_shape: volume.grid().shape(),
        new_shape: plan.shape,
        old_from_new: DAffine3::from_mat3_translation(
            DMat3::from_diagonal(DVec3::new(x.ratio, y.ratio, z.ratio)),
            DVec3::new(x.at(0), y.at(0), z.at(0)),
        ),
        is_scan: true,
    };
    let scaling = volume.scaling();
    let (voxels, how) = resample_voxels!(lookup, volume.voxels(), scaling);
    plan.note(volume.grid(), how, report);
    Ok(Some(Volume::new(plan.grid()?, voxels, scaling.0, scaling.1)))
}

/// A mask at the spacing; the same where it has it already.
pub(crate) fn mask(mask: Mask, spacing: Spacing, max_bytes: u64, report: &mut Report) -> Result<Mask, Error> {
    let Some(plan) = Plan::new(mask.grid(), spacing)? else { return Ok(mask) };
    plan.check(1, max_bytes)?;
    let grid = plan.grid()?;
    let mut bits = Bits::new(plan.shape);
    let words_per_plane = bits.words_per_row() * plan.shape[1];
    let columns: Vec<Neighbours> = (0..plan.shape[0]).map(|x| plan.axes[0].neighbours(x)).collect();
    let planes = bits.words_mut().par_chunks_mut(words_per_plane).enumerate();
    planes.for_each(|(z, words)| plan.fill_plane(mask.bits(), &columns, z, words));
    plan.note(mask.grid(), "linear interpolation cut at a half, since they are a mask", report);
    Ok(Mask::new(grid, bits))
}

/// One axis of the new grid.
#[derive(Clone, Copy)]
struct Axis {
    n_old: usize,
    n_new: usize,
    /// The new spacing in old ones.
    ratio: f64,
}

/// The two old voxels about a new one, and the share of the second.
type Neighbours = ([usize; 2], f64);

impl Axis {
    /// Where a new voxel's centre lies, in old voxels.
    fn at(&self, new: usize) -> f64 {
        let middle = (self.n_old as f64 - 1.0) / 2.0;
        middle + (new as f64 - (self.n_new as f64 - 1.0) / 2.0) * self.ratio
    }

    fn neighbours(&self, new: usize) -> Neighbours {
        let at = self.at(new).clamp(0.0, self.n_old as f64 - 1.0);
        let first = at.floor();
        ([first as usize, (first as usize + 1).min(self.n_old - 1)], at - first)
    }
}

/// The new grid.
struct Plan {
    old: Grid,
    spacing_mm: DVec3,
    shape: [usize; 3],
    axes: [Axis; 3],
}

impl Plan {
    /// None where the volume has the spacing already.
    fn new(grid: &Grid, spacing: Spacing) -> Result<Option<Self>, Error> {
        let old_mm = grid.spacing_mm();
        let spacing_mm = spacing.mm(old_mm);
        if ((spacing_mm - old_mm) / old_mm).abs().max_element() < SAME {
            return Ok(None);
        }
        let ratio = spacing_mm / old_mm;
        let axis = |axis: usize| {
            let n_old = grid.shape()[axis];
            // Rounding must not add a plane; the conversion saturates, and the limit refuses what is too much.
            let n_new = (n_old as f64 / ratio[axis] - 1e-4).ceil().max(1.0) as usize;
            Axis { n_old, n_new, ratio: ratio[axis] }
        };
        let axes = [0, 1, 2].map(axis);
        Ok(Some(Self { old: grid.clone(), spacing_mm, shape: axes.map(|axis| axis.n_new), axes }))
    }

    /// Whether the new voxels, each of so many bits, fit the memory.
    fn check(&self, bits_per_voxel: u64, max_bytes: u64) -> Result<(), Error> {
        let n_voxels = self.shape.iter().fold(1_u64, |product, &n| product.saturating_mul(n as u64));
        let needed = n_voxels.saturating_mul(bits_per_voxel) / 8;
        check_memory("resampling", needed, max_bytes)
    }

    fn grid(&self) -> Result<Grid, Error> {
        let old = self.old.world_from_voxel();
        let [x, y, z] = self.axes;
        let axes = old.matrix3 * DMat3::from_diagonal(DVec3::new(x.ratio, y.ratio, z.ratio));
        let origin = old.transform_point3(DVec3::new(x.at(0), y.at(0), z.at(0)));
        let grid = Grid::new(self.shape, DAffine3::from_mat3_translation(axes, origin));
        grid.and_then(|grid| stored_grid(&grid)).map_err(Error::Grid)
    }

    /// Fills a plane of a new mask.
    fn fill_plane(&self, old: &Bits, columns: &[Neighbours], z: usize, words: &mut [u64]) {
        let [_, ny_old, _] = old.shape();
        let (planes, share_z) = self.axes[2].neighbours(z);
        for (y, row) in words.chunks_mut(words.len() / self.shape[1]).enumerate() {
            let (rows, share_y) = self.axes[1].neighbours(y);
            let beside = [0, 1, 2, 3].map(|i| {
                let weight_y = if i % 2 == 0 { 1.0 - share_y } else { share_y };
                let weight_z = if i / 2 == 0 { 1.0 - share_z } else { share_z };
                (old.row(planes[i / 2] * ny_old + rows[i % 2]), weight_y * weight_z)
            });
            if beside.iter().all(|(row, weight)| *weight == 0.0 || row.iter().all(|&word| word == 0)) {
                continue;
            }
            for (x, &([first, second], share)) in columns.iter().enumerate() {
                let of_row = |(row, weight): &(&[u64], f64)| {
                    let bit = |x: usize| if row[x / 64] >> (x % 64) & 1 == 1 { 1.0 } else { 0.0 };
                    weight * ((1.0 - share) * bit(first) + share * bit(second))
                };
                if beside.iter().map(of_row).sum::<f64>() >= 0.5 - ROUNDING {
                    row[x / 64] |= 1 << (x % 64);
                }
            }
        }
    }

    fn note(&self, old: &Grid, how: &str, report: &mut Report) {
        let ([ox, oy, oz], [nx, ny, nz]) = (old.shape(), self.shape);
        let (from, to) = (old.spacing_mm(), self.spacing_mm);
        let coarser = (0..3).any(|axis| to[axis] > from[axis] * (1.0 + SAME));
        report.warn(
            "W-VOLUME-RESAMPLED",
            format!(
                "{ox}x{oy}x{oz} voxels of {:.4} x {:.4} x {:.4} mm were resampled to {nx}x{ny}x{nz} of {:.4} x {:.4} x \
                 {:.4} mm by {how}{}",
                from.x,
                from.y,
                from.z,
                to.x,
                to.y,
                to.z,
                if coarser { "; they are coarser, so that thin branches may be lost" } else { "" }
            ),
        );
        report.count_usize("resampled_from_voxels", old.n_voxels());
        report.count_usize("resampled_to_voxels", nx * ny * nz);
    }
}
