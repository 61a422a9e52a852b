//! Region growing from a seed.
//!
//! **Input** a volume, a seed voxel, a band of values. **Output** one `bool` a voxel, x fastest.
//! **Steps** flood from the seed over voxels that share a face (6-connected) and lie in the band, ends included.
//! **Guarantees** the result is the 6-connected component of the band that holds the seed; it does not depend on
//! the order of visits. No recursion.
//! **Why not 26-connected?** An airway's wall is thinner than a voxel in places; over edges and corners the
//! region leaks into the lung at the very same threshold.
//! **Cost** O(region) time, plus one `bool` a voxel.

use espalier_model::{Grid, Volume};
use glam::DVec3;

use crate::{Error, Params};

/// The seed of the parameters as a voxel inside the grid.
pub(crate) fn seed_voxel(grid: &Grid, params: &Params) -> Result<[usize; 3], Error> {
    let shape = grid.shape();
    let inside = |[x, y, z]: [i64; 3]| grid.voxel_at(DVec3::new(x as f64, y as f64, z as f64));
    let (found, shown) = match (params.seed_voxel, params.seed_mm) {
        (Some([x, y, z]), _) => (inside([x, y, z]), format!("voxel ({x}, {y}, {z})")),
        (None, Some([x, y, z])) => {
            let point = grid.voxel_from_world().transform_point3(DVec3::new(x, y, z));
            (grid.voxel_at(point), format!("({x}, {y}, {z}) mm"))
        }
        // `Params::validate` refuses region growing without a seed.
        (None, None) => (None, "(none)".to_owned()),
    };
    found.ok_or(Error::SeedOutside { seed: shown, shape })
}

/// The region about `seed` with values in the band.
pub(crate) fn grow(
    volume: &Volume,
    seed: [usize; 3],
    (lower, upper): (f64, f64),
) -> Result<Vec<bool>, Error> {
    let grid = volume.grid();
    let [nx, ny, nz] = grid.shape();
    let in_band = |index: usize| (lower..=upper).contains(&volume.value(index));
    let start = grid.index(seed);
    if !in_band(start) {
        return Err(seed_error(volume, seed, (lower, upper)));
    }
    let mut region = vec![false; grid.n_voxels()];
    region[start] = true;
    let mut stack = vec![start];
    while let Some(index) = stack.pop() {
        let [x, y, z] = grid.voxel(index);
        let neighbours = [
            (x > 0).then(|| index - 1),
            (x + 1 < nx).then(|| index + 1),
            (y > 0).then(|| index - nx),
            (y + 1 < ny).then(|| index + nx),
            (z > 0).then(|| index - nx * ny),
            (z + 1 < nz).then(|| index + nx * ny),
        ];
        for neighbour in neighbours.into_iter().flatten() {
            if !region[neighbour] && in_band(neighbour) {
                region[neighbour] = true;
                stack.push(neighbour);
            }
        }
    }
    Ok(region)
}

/// The seed is not in the band: tells the nearest voxel that is, or that there is none.
fn seed_error(volume: &Volume, seed: [usize; 3], (lower, upper): (f64, f64)) -> Error {
    let grid = volume.grid();
    let spacing = grid.spacing_mm();
    let point = |[x, y, z]: [usize; 3]| DVec3::new(x as f64, y as f64, z as f64) * spacing;
    let mut nearest: Option<(f64, usize)> = None;
    let (mut min, mut max) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut index = 0;
    volume.for_each_value(|value| {
        if value.is_finite() {
            (min, max) = (min.min(value), max.max(value));
        }
        if (lower..=upper).contains(&value) {
            let distance = point(grid.voxel(index)).distance(point(seed));
            if nearest.is_none_or(|(best, _)| distance < best) {
                nearest = Some((distance, index));
            }
        }
        index += 1;
    });
    match nearest {
        None => Error::Empty { what: format!("the band {lower} to {upper}"), min, max },
        Some((distance_mm, index)) => Error::SeedOutOfBand {
            seed,
            value: volume.value(grid.index(seed)),
            lower,
            upper,
            nearest: grid.voxel(index),
            distance_mm,
        },
    }
}
