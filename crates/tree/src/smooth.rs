//! Branches lose the staircase of the voxels.
//!
//! **Input** [`Outline`]. **Output** the same, its lines evenly spaced and smoothed, positions and radii alike.
//! **Steps** 1. Space the samples evenly, two to the smallest spacing. 2. A Gaussian along the arc with σ =
//! `smooth_voxels` voxels, of fourth order for positions and plain for radii. A voxel is the largest spacing projected on
//! the local direction: on thick slices the staircase is as long as the slices are thick along the branch. Of thick branches
//! σ for positions is [`OF_RADIUS`] of the radius, times `smooth_voxels`, since their axis wanders by as much as their section is uneven. 3. Beyond
//! its ends a line goes on as its own point reflection, so that ends stay exactly where they are and straight
//! lines stay straight.
//! **Cost** O(N · σ / step).

use espalier_geom::math;
use espalier_model::Grid;
use glam::DVec3;

use crate::curve::{evenly_spaced, voxel_along_mm};
use crate::graph::{Sample, polyline_length_mm};
use crate::outline::Outline;

/// Samples to the smallest spacing.
const SAMPLES_PER_SPACING: f64 = 2.0;
/// σ for positions as a share of the radius, where that is more: a trunk bends over some radii. On slices of 3 mm the line of a
/// trachea of 9 mm went to and fro by a millimetre without it.
const OF_RADIUS: f64 = 0.25;
/// The Gaussian ends after so many standard deviations.
const TRUNCATE: f64 = 4.0;

/// Spaces the samples of every line evenly, two to the smallest spacing.
pub(crate) fn space_evenly(outline: &mut Outline, grid: &Grid) {
    let step_mm = grid.spacing_mm().min_element() / SAMPLES_PER_SPACING;
    for line in &mut outline.lines {
        let n_edges = (polyline_length_mm(&line.samples) / step_mm).round().max(1.0) as usize;
        line.samples = evenly_spaced(&line.samples, n_edges);
    }
}

/// Smooths evenly spaced lines.
pub(crate) fn smooth(outline: &mut Outline, grid: &Grid, smooth_voxels: f64) {
    if smooth_voxels <= 0.0 {
        return;
    }
    for line in &mut outline.lines {
        line.samples = smoothed(&line.samples, grid, smooth_voxels);
    }
}

fn smoothed(samples: &[Sample], grid: &Grid, smooth_voxels: f64) -> Vec<Sample> {
    let n = samples.len();
    let step_mm = polyline_length_mm(samples) / (n.max(2) - 1) as f64;
    if n < 3 || step_mm <= 0.0 {
        return samples.to_vec();
    }
    // Directions are judged over the thickest voxel on both sides: less would follow the staircase itself.
    let reach = math::ceil(grid.spacing_mm().max_element() / step_mm) as usize;
    let voxel_axes = grid.world_from_voxel().matrix3;
    let mut out = samples.to_vec();
    for i in 1..n - 1 {
        let ahead = samples[(i + reach).min(n - 1)].position_mm;
        let direction = (ahead - samples[i.saturating_sub(reach)].position_mm).normalize_or_zero();
        let direction_voxel = DVec3::new(
            direction.dot(voxel_axes.x_axis.normalize()),
            direction.dot(voxel_axes.y_axis.normalize()),
            direction.dot(voxel_axes.z_axis.normalize()),
        );
        let sigma_mm = smooth_voxels * voxel_along_mm(direction_voxel, grid.spacing_mm());
        out[i] = gaussian_at(samples, i, sigma_mm / step_mm);
        let trunk_sigma_mm = OF_RADIUS * smooth_voxels * samples[i].radius_mm;
        if trunk_sigma_mm > sigma_mm {
            out[i].position_mm = gaussian_at(samples, i, trunk_sigma_mm / step_mm).position_mm;
        }
    }
    out
}

/// The weighted mean about sample `i`, σ in samples; beyond the ends the point reflection of the line.
fn gaussian_at(samples: &[Sample], i: usize, sigma: f64) -> Sample {
    let last = samples.len() - 1;
    let at = |offset: isize| {
        let j = i as isize + offset;
        let reflect = |end: usize, inner: usize| Sample {
            position_mm: 2.0 * samples[end].position_mm - samples[inner].position_mm,
            radius_mm: samples[inner].radius_mm,
        };
        if j < 0 {
            reflect(0, j.unsigned_abs())
        } else if j as usize > last {
            reflect(last, 2 * last - j as usize)
        } else {
            samples[j as usize]
        }
    };
    // No further than a line can be reflected once.
    let n_taps = (math::ceil(TRUNCATE * sigma) as usize).min(last) as isize;
    let (mut weights, mut position_mm) = (0.0, DVec3::ZERO);
    let (mut bells, mut radius_mm) = (0.0, 0.0);
    for offset in -n_taps..=n_taps {
        let u = offset as f64 / sigma.max(1e-9);
        let bell = math::exp(-0.5 * u * u);
        // A plain Gaussian pulls a bend inwards by κσ²/2; this kernel has no second moment and does not.
        let weight = (1.5 - 0.5 * u * u) * bell;
        let sample = at(offset);
        weights += weight;
        position_mm += sample.position_mm * weight;
        bells += bell;
        radius_mm += sample.radius_mm * bell;
    }
    Sample { position_mm: position_mm / weights, radius_mm: radius_mm / bells }
}
