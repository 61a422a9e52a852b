//! Region growing from a seed.
//!
//! **Input** a volume, a seed voxel, a band of values. **Output** one bit a voxel.
//! **Steps** 1. choose the voxels that lie in the band, ends included; 2. label their components by faces
//! (6-connected); 3. keep the seed's.
//! **Guarantees** the result is the 6-connected component of the band that holds the seed. No recursion.
//! **Why not 26-connected?** An airway's wall is thinner than a voxel in places; over edges and corners the
//! region leaks into the lung at the very same threshold.
//! **Cost** O(voxels) time, two bits a voxel and the runs of the band.

use espalier_model::{Bits, Grid, Volume};
use glam::DVec3;

use crate::choose::choose;
use crate::runs::{Connectivity, Runs};
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
pub(crate) fn grow(volume: &Volume, seed: [usize; 3], (lower, upper): (f64, f64)) -> Result<Bits, Error> {
    let in_band = |value: f64| (lower..=upper).contains(&value);
    if !in_band(volume.value(volume.grid().index(seed))) {
        return Err(seed_error(volume, seed, (lower, upper)));
    }
    let band = choose(volume, in_band);
    let runs = Runs::cut(&band);
    let components = runs.components(Connectivity::Faces);
    let wanted = runs.find(seed).map(|run| components.of_run[run]);
    let mut region = Bits::new(band.shape());
    for row in 0..runs.n_rows() {
        for run in runs.of_row(row).filter(|&run| Some(components.of_run[run]) == wanted) {
            region.fill_run(row, runs.all()[run].range());
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
