//! The CT of a phantom: tissues with partial volume, the scanner's blur, noise, whole HU.
//!
//! **Input** [`Phantom`], [`Params`], a seed. **Output** [`Volume`] of `i16` HU, slope 1, intercept 0.
//! **Steps** 1. in each slice, paint every voxel: each of its 27 samples takes the uppermost layer that holds it
//! (lumen, wall, arteries, surroundings), and the voxel their mean; 2. blur by a Gaussian, axis by axis; 3. add
//! normal noise, clamp to what 12-bit CT holds, round.
//! **Guarantees** the same bytes at any thread count: each slice has its own random stream.
//! **Cost** O(voxels); 5 bytes a voxel besides the result.

use std::sync::Arc;

use espalier_geom::math;
use espalier_geom::random::{Purpose, Stream};
use espalier_model::diagnose::ParamError;
use espalier_model::{Grid, Volume, Voxels};
use glam::DVec3;
use ndarray::Array3;
use rayon::prelude::*;

use crate::body::Body;
use crate::companions;
use crate::raster::{N_SAMPLES, Raster};
use crate::scene::{Scene, lumen_hu};
use crate::{Error, Kind, Params, Phantom};

/// What a 12-bit CT can hold, in HU.
const HU_RANGE: [f64; 2] = [-1024.0, 3071.0];
/// HU of the airways' wall, and of the blood in the arteries beside them.
const WALL_HU: f64 = -40.0;
const ARTERY_HU: f64 = 45.0;
/// The widest blur in voxels: three of these are the reach of the kernel.
const MAX_BLUR_VOXELS: f64 = 16.0;

/// Thickness in mm of the wall of an airway of a radius: a sixth of it, so that the wall of the finest branches
/// vanishes in the blur.
pub(crate) fn wall_mm(radius_mm: f64, size: f64) -> f64 {
    0.04 * size + 0.155 * radius_mm
}

/// Bodies and their HU, the uppermost first.
type Layers = Vec<(Arc<Body>, f64)>;

fn layers(phantom: &Phantom, params: &Params, seed: u64) -> Layers {
    let mut layers = vec![(Arc::clone(&phantom.body), lumen_hu(phantom.kind))];
    if phantom.kind == Kind::Airway {
        let walls = Body::about(&phantom.shape, |radius| radius + wall_mm(radius, params.size));
        layers.push((Arc::new(walls), WALL_HU));
        layers.push((Arc::new(companions::arteries(&phantom.shape, params, seed)), ARTERY_HU));
    }
    layers
}

/// The CT of a phantom with a mask, on the mask's grid.
pub(crate) fn ct(phantom: &Phantom, params: &Params, seed: u64) -> Result<Volume, Error> {
    params.validate()?;
    let mask = phantom.mask.as_ref().ok_or(Error::TreeOnly { kind: phantom.kind.name() })?;
    let grid = mask.grid();
    let kernels = (DVec3::splat(params.blur_mm) / grid.spacing_mm()).to_array().map(kernel);
    let widest = params.blur_mm / grid.spacing_mm().min_element();
    let message = format!("must be at most {MAX_BLUR_VOXELS} voxels of the smallest spacing, is {widest:.1}");
    ParamError::check("blur_mm", widest <= MAX_BLUR_VOXELS, message)?;

    let layers = layers(phantom, params, seed);
    let rasters = layers
        .iter()
        .map(|(body, hu)| Ok((Raster::new(body, grid)?, *hu)))
        .collect::<Result<Vec<_>, Error>>()?;
    let scene = Scene::new(phantom.kind, params, seed);
    let [nx, ny, nz] = grid.shape();
    let mut painted = vec![0.0_f32; grid.n_voxels()];
    painted.par_chunks_mut(nx * ny).enumerate().for_each(|(z, slice)| {
        paint(slice, z, (grid, &rasters, &scene));
        blur_rows(slice, nx, &kernels[0]);
        blur_columns(slice, nx, &kernels[1]);
    });
    let mut stored = vec![0_i16; grid.n_voxels()];
    stored.par_chunks_mut(nx * ny).enumerate().for_each(|(z, slice)| {
        let blurred = blur_across(&painted, (z, nz, nx * ny), &kernels[2]);
        let mut noise = Stream::new(seed, Purpose::PhantomNoise, z as u32, 0);
        for (voxel, hu) in slice.iter_mut().zip(blurred) {
            let noisy = f64::from(hu) + params.noise_hu * noise.normal();
            *voxel = noisy.clamp(HU_RANGE[0], HU_RANGE[1]).round() as i16;
        }
    });
    // The vector has the grid's length, so the shape fits.
    let array = Array3::from_shape_vec((nz, ny, nx), stored).unwrap_or_default();
    Ok(Volume::new(grid.clone(), Voxels::I16(array), 1.0, 0.0))
}

/// Paints slice z with the mean HU of each voxel's samples.
fn paint(slice: &mut [f32], z: usize, (grid, rasters, scene): (&Grid, &[(Raster<'_>, f64)], &Scene)) {
    let [nx, _, _] = grid.shape();
    let (spacing, origin) = (grid.spacing_mm(), grid.world_from_voxel().translation);
    let bits: Vec<(Vec<u32>, f64)> = rasters.iter().map(|(raster, hu)| (raster.slice(z), *hu)).collect();
    for (voxel_idx, voxel) in slice.iter_mut().enumerate() {
        let mut taken = 0_u32;
        let mut sum = 0.0;
        for (layer, hu) in &bits {
            let fresh = layer[voxel_idx] & !taken;
            sum += f64::from(fresh.count_ones()) * hu;
            taken |= fresh;
        }
        let n_left = N_SAMPLES - taken.count_ones();
        if n_left > 0 {
            let center = DVec3::new((voxel_idx % nx) as f64, (voxel_idx / nx) as f64, z as f64);
            sum += f64::from(n_left) * scene.hu(origin + spacing * center);
        }
        *voxel = (sum / f64::from(N_SAMPLES)) as f32;
    }
}

/// One half of a normalised Gaussian of a standard deviation in voxels, from the centre outwards.
fn kernel(sigma: f64) -> Vec<f32> {
    let reach = (3.0 * sigma).ceil() as usize;
    let weight =
        |k: usize| if k == 0 { 1.0 } else { math::exp(-0.5 * (k as f64 / sigma) * (k as f64 / sigma)) };
    let sum = 1.0 + 2.0 * (1..=reach).map(weight).sum::<f64>();
    (0..=reach).map(|k| (weight(k) / sum) as f32).collect()
}

/// Blurs a line of `n` values; beyond its ends the last value goes on.
fn blur_line(line: impl Fn(usize) -> f32, n: usize, kernel: &[f32], out: &mut [f32]) {
    for (i, value) in out.iter_mut().enumerate().take(n) {
        *value = kernel[0] * line(i);
        for (k, weight) in kernel.iter().enumerate().skip(1) {
            *value += weight * (line(i.saturating_sub(k)) + line((i + k).min(n - 1)));
        }
    }
}

fn blur_rows(slice: &mut [f32], nx: usize, kernel: &[f32]) {
    if kernel.len() < 2 {
        return;
    }
    let mut source = vec![0.0; nx];
    for row in slice.chunks_exact_mut(nx) {
        source.copy_from_slice(row);
        blur_line(|x| source[x], nx, kernel, row);
    }
}

fn blur_columns(slice: &mut [f32], nx: usize, kernel: &[f32]) {
    if kernel.len() < 2 {
        return;
    }
    let source = slice.to_vec();
    let ny = source.len() / nx;
    for (y, row) in slice.chunks_exact_mut(nx).enumerate() {
        add_weighted(row, &source, (y, ny, nx), kernel);
    }
}

fn blur_across(painted: &[f32], (z, nz, slice_len): (usize, usize, usize), kernel: &[f32]) -> Vec<f32> {
    let mut out = vec![0.0; slice_len];
    add_weighted(&mut out, painted, (z, nz, slice_len), kernel);
    out
}

/// Sets `out` to the weighted sum of the `len`-long pieces of `source` about the `at`-th of `n`.
fn add_weighted(out: &mut [f32], source: &[f32], (at, n, len): (usize, usize, usize), kernel: &[f32]) {
    let piece = |i: usize| &source[i * len..(i + 1) * len];
    out.iter_mut().zip(piece(at)).for_each(|(value, s)| *value = kernel[0] * s);
    for (k, weight) in kernel.iter().enumerate().skip(1) {
        let (before, after) = (piece(at.saturating_sub(k)), piece((at + k).min(n - 1)));
        for ((value, b), a) in out.iter_mut().zip(before).zip(after) {
            *value += weight * (b + a);
        }
    }
}
