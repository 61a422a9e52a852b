//! Airways grown in noisy lungs, no threshold given.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use espalier_geom::math;
use espalier_geom::random::{Purpose, Stream};
use espalier_model::{Grid, Volume, Voxels};
use espalier_volume::{Method, Params, Preset, Segmented, segment};
use glam::DVec3;
use ndarray::Array3;

/// A bronchus with a wall in the middle of a lung, and a branch as thin as a voxel that leaves it obliquely.
const EXTENT: usize = 64;
const SEED: [i64; 3] = [32, 32, 20];
const LENGTH: usize = 14;

/// The voxels of the branch: each is the last one's neighbour over a corner.
fn branch() -> impl Iterator<Item = [usize; 3]> {
    (0..LENGTH).map(|i| [38 + i, 38 + i, 24 + i])
}

fn is_stem([x, y, z]: [usize; 3]) -> bool {
    (6..58).contains(&z) && math::hypot(x as f64 - 32.0, y as f64 - 32.0) <= 8.0
}

/// Where the wall gives way.
fn is_gap([x, y, z]: [usize; 3]) -> bool {
    x < 32 && y == 32 && z == 50
}

fn scan(lung: f64, noise: f64, random_seed: u64) -> Volume {
    let mut stream = Stream::new(random_seed, Purpose::Test, 0, 0);
    let branch: Vec<[usize; 3]> = branch().collect();
    let clean = |voxel: [usize; 3]| {
        let [x, y, z] = voxel.map(|v| v as f64);
        let from_axis = math::hypot(x - 32.0, y - 32.0);
        if branch.contains(&voxel) || is_stem(voxel) {
            -1000.0
        } else if from_axis <= 10.0 && (4.0..60.0).contains(&z) && !is_gap(voxel) {
            -300.0
        } else {
            lung
        }
    };
    let noisy = |(z, y, x)| (clean([x, y, z]) + noise * stream.normal()).round() as i16;
    let values = Array3::from_shape_fn([EXTENT; 3], noisy);
    let grid = Grid::axis_aligned([EXTENT; 3], DVec3::ONE, DVec3::ZERO).expect("legal");
    Volume::new(grid, Voxels::I16(values), 1.0, 0.0)
}

fn grown(scan: &Volume, params: &Params) -> Segmented {
    segment(scan, params).unwrap_or_else(|error| panic!("{error}"))
}

fn preset() -> Params {
    Params { preset: Some(Preset::Airway), seed_voxel: Some(SEED), ..Params::default() }
}

/// How much of the stem and of the branch was found, and how many voxels are of neither.
fn found(segmented: &Segmented) -> (f64, usize, usize) {
    let branch: Vec<[usize; 3]> = branch().collect();
    let n_stem = (0..EXTENT.pow(3))
        .filter(|i| is_stem([i % EXTENT, i / EXTENT % EXTENT, i / (EXTENT * EXTENT)]))
        .count();
    let (mut stem, mut of_branch, mut other) = (0, 0, 0);
    for voxel in segmented.mask.voxels() {
        if is_stem(voxel) {
            stem += 1;
        } else if branch.contains(&voxel) {
            of_branch += 1;
        } else {
            other += 1;
        }
    }
    (f64::from(stem) / n_stem as f64, of_branch, other)
}

#[test]
fn a_branch_over_edges_is_found_in_noise() {
    for (random_seed, noise) in [(1, 10.0), (2, 20.0), (3, 25.0)] {
        let scan = scan(-850.0, noise, random_seed);
        let grown_by_preset = grown(&scan, &preset());
        let (stem, of_branch, other) = found(&grown_by_preset);
        let told = format!("noise {noise}: {stem} {of_branch} {other} {:?}", grown_by_preset.report);
        assert!(stem >= 0.98 && of_branch + 1 >= LENGTH && other <= 20, "{told}");
        let count = |key| grown_by_preset.report.get(key).unwrap_or(f64::NAN);
        assert!(count("edges_threshold") < count("band_upper"), "{told}");
        assert!(count("band_upper") <= count("stable_threshold") && count("edges_voxels") >= 10.0, "{told}");
        let table = grown_by_preset.growth.expect("it grew").to_tsv();
        assert_eq!(table.lines().filter(|line| line.ends_with("\tedges")).count(), 1, "{told}");

        // A band that is given is grown over faces, and stays.
        let band = Params { upper: Some(count("band_upper")), method: Method::RegionGrow, ..preset() };
        let (_, of_branch, other) = found(&grown(&scan, &band));
        assert!(of_branch <= 2 && other <= 20, "{of_branch} {other}");
    }
}

/// A lung with much of it as dark as a bronchus: next to nothing is given up, or won.
#[test]
fn emphysema_takes_nothing_away() {
    let scan = scan(-940.0, 15.0, 4);
    let by_preset = grown(&scan, &preset());
    let (stem, of_branch, other) = found(&by_preset);
    let n_stable = by_preset.report.get("stable_ml").map_or(0.0, |ml| 1000.0 * ml);
    let n_voxels = by_preset.mask.n_foreground() as f64;
    assert!(n_voxels >= 0.9 * n_stable && stem >= 0.85, "{stem} {n_voxels} of {n_stable}");
    assert!(other <= 50, "{stem} {of_branch} {other} {:?}", by_preset.report);
}
