//! Vessels with contrast grown from a seed, no threshold given.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use espalier_geom::random::{Purpose, Stream};
use espalier_model::{Diagnose, Grid, Volume, Voxels};
use espalier_volume::{Method, Params, Preset, Segmented, segment};
use glam::DVec3;
use ndarray::Array3;

/// A vessel of 7 voxels' radius with a branch of 2, in tissue, and fat on one side.
const EXTENT: usize = 44;
const SEED: [usize; 3] = [22, 22, 10];

fn is_vessel([x, y, z]: [usize; 3]) -> bool {
    let [x, y, z] = [x, y, z].map(|v| v as f64);
    let is_within = |u: f64, v: f64, radius: f64| espalier_geom::math::hypot(u - 22.0, v - 22.0) <= radius;
    (3.0..40.0).contains(&z) && is_within(x, y, 7.0) || (22.0..41.0).contains(&x) && is_within(y, z, 2.0)
}

/// Values inside, outside, and the standard deviation of their noise.
#[derive(Clone, Copy, Debug)]
struct Contrast {
    inside: f64,
    outside: f64,
    noise: f64,
}

impl Contrast {
    fn value(self, voxel: [usize; 3]) -> f64 {
        let is_fat = voxel[1] < 8;
        if is_vessel(voxel) {
            self.inside
        } else if is_fat {
            self.outside - 150.0
        } else {
            self.outside
        }
    }

    /// In whole numbers, or with fractions.
    fn scan(self, is_whole: bool, random_seed: u64) -> Volume {
        let mut stream = Stream::new(random_seed, Purpose::Test, 0, 0);
        let noisy = |(z, y, x)| (self.value([x, y, z]) + self.noise * stream.normal()) as f32;
        let values = Array3::from_shape_fn([EXTENT; 3], noisy);
        let grid = Grid::axis_aligned([EXTENT; 3], DVec3::ONE, DVec3::ZERO).expect("legal");
        let voxels =
            if is_whole { Voxels::I16(values.mapv(|v| v.round() as i16)) } else { Voxels::F32(values) };
        Volume::new(grid, voxels, 1.0, 0.0)
    }
}

fn params() -> Params {
    let seed_voxel = Some(SEED.map(|v| v as i64));
    Params { preset: Some(Preset::Vessel), seed_voxel, ..Params::default() }
}

fn grown(scan: &Volume) -> Segmented {
    segment(scan, &params()).unwrap_or_else(|error| panic!("{error}"))
}

/// The share of the vessel's voxels that were found, and of those found the share that are the vessel's.
fn shares(segmented: &Segmented) -> [f64; 2] {
    let n_vessel = (0..EXTENT.pow(3))
        .filter(|i| is_vessel([i % EXTENT, i / EXTENT % EXTENT, i / (EXTENT * EXTENT)]))
        .count() as f64;
    let n_common = segmented.mask.voxels().filter(|&voxel| is_vessel(voxel)).count() as f64;
    [n_common / n_vessel, n_common / segmented.mask.n_foreground() as f64]
}

#[test]
fn the_threshold_is_half_way_at_any_contrast() {
    for (inside, outside, noise) in [
        (210.0, 102.0, 0.0),
        (210.0, 102.0, 25.0),
        (210.0, 102.0, 40.0),
        (400.0, 40.0, 30.0),
        (160.0, 60.0, 15.0),
        (320.0, 220.0, 25.0),
        (1850.0, 340.0, 250.0),
    ] {
        for (is_whole, random_seed) in [(true, 1), (true, 2), (false, 3)] {
            let contrast = Contrast { inside, outside, noise };
            let found = grown(&contrast.scan(is_whole, random_seed));
            let count = |key| found.report.get(key).unwrap_or(f64::NAN);
            let told = format!("{contrast:?} {is_whole} {random_seed}: {:?}", found.report);
            let half = (inside + outside) / 2.0;
            let tolerance = 2.0 + 0.1 * noise;
            assert!((count("half_maximum") - half).abs() <= tolerance, "{told}");
            assert!((count("value_inside") - inside).abs() <= 2.0 * tolerance, "{told}");
            assert!((count("value_outside") - outside).abs() <= 2.0 * tolerance, "{told}");
            assert_eq!(count("band_lower"), count("half_maximum"), "{told}");
            // Where the two overlap by noise some voxels are wrong at any threshold.
            let [recall, precision] = shares(&found);
            let least = if noise < 0.2 * (inside - outside) { 0.99 } else { 0.9 };
            assert!(recall >= least && precision >= least, "{recall} {precision} {told}");
            assert!(
                !found.report.warnings.iter().any(|warning| warning.code.starts_with("W-VOLUME-NO")),
                "{told}"
            );
            let table = found.growth.expect("it grew").to_tsv();
            assert_eq!(table.lines().filter(|line| line.ends_with("\ttaken")).count(), 1, "{told}");
        }
    }
}

/// A seed on a dark speck of noise: the way out is named, nothing is grown from the tissue.
#[test]
fn a_seed_darker_than_half_way_is_told() {
    let contrast = Contrast { inside: 210.0, outside: 102.0, noise: 5.0 };
    let Voxels::I16(mut values) = contrast.scan(true, 4).voxels().clone() else { panic!("whole values") };
    let [x, y, z] = SEED;
    values[[z, y, x]] = 140;
    let grid = Grid::axis_aligned([EXTENT; 3], DVec3::ONE, DVec3::ZERO).expect("legal");
    let error = segment(&Volume::new(grid, Voxels::I16(values), 1.0, 0.0), &params()).expect_err("dark");
    assert_eq!((error.code(), error.class().exit_code()), ("E-VOLUME-SEED-BAND", 2));
    assert!(error.to_string().contains("has the value 140, outside 156 to inf"), "{error}");
}

/// Bone, or another vessel, that touches: the leak comes before half-way.
#[test]
fn a_leak_before_half_way_ends_it() {
    let contrast = Contrast { inside: 210.0, outside: 102.0, noise: 0.0 };
    let Voxels::I16(mut values) = contrast.scan(true, 5).voxels().clone() else { panic!("whole values") };
    values.indexed_iter_mut().filter(|((_, y, _), _)| *y >= 29).for_each(|(_, value)| *value = 180);
    let grid = Grid::axis_aligned([EXTENT; 3], DVec3::ONE, DVec3::ZERO).expect("legal");
    let found = grown(&Volume::new(grid, Voxels::I16(values), 1.0, 0.0));
    let count = |key| found.report.get(key).unwrap_or(f64::NAN);
    assert_eq!((count("leaking_threshold"), count("band_lower")), (180.0, 181.0), "{:?}", found.report);
    assert_eq!(shares(&found)[1], 1.0);
}

/// A band that is given is taken as it is.
#[test]
fn a_given_band_stays() {
    let scan = Contrast { inside: 210.0, outside: 102.0, noise: 25.0 }.scan(true, 6);
    let given = Params { lower: Some(170.0), method: Method::RegionGrow, ..params() };
    let found = segment(&scan, &given).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((found.report.get("band_lower"), found.report.get("half_maximum")), (Some(170.0), None));
}
