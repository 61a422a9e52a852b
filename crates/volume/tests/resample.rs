//! A volume at another spacing: grids, scans before and masks after voxels are chosen, seeds, limits.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use espalier_model::{Diagnose, Grid, Mask, Volume, Voxels};
use espalier_volume::{Method, Params, Segmented, Spacing, clean, segment};
use glam::{DAffine3, DMat3, DVec2, DVec3};
use ndarray::Array3;

fn grid(shape: [usize; 3], spacing_mm: DVec3) -> Grid {
    Grid::axis_aligned(shape, spacing_mm, DVec3::new(10.0, -20.0, 30.0)).expect("legal")
}

/// A scan with values by place, RAS+ mm.
fn scan(grid: &Grid, value: impl Fn(DVec3) -> f64) -> Volume {
    let [nx, ny, nz] = grid.shape();
    let at = |(z, y, x)| {
        let voxel = DVec3::new(x as f64, y as f64, z as f64);
        value(grid.world_from_voxel().transform_point3(voxel)).round() as i16
    };
    Volume::new(grid.clone(), Voxels::I16(Array3::from_shape_fn((nz, ny, nx), at)), 1.0, 0.0)
}

fn at(spacing: Spacing) -> Params {
    Params { resample_mm: Some(spacing), ..Params::default() }
}

fn done(result: Result<Segmented, espalier_volume::Error>) -> Segmented {
    result.unwrap_or_else(|error| panic!("{error}"))
}

/// Where the middle of all voxels lies, and how many ml they are.
fn middle(mask: &Mask) -> (DVec3, f64) {
    let sum: DVec3 = mask.voxels().map(|voxel| DVec3::from_array(voxel.map(|v| v as f64))).sum();
    let n = mask.n_foreground() as f64;
    (mask.grid().world_from_voxel().transform_point3(sum / n), n * mask.grid().voxel_volume_mm3() / 1e3)
}

#[test]
fn a_ball_stays_where_it_is_and_as_large() {
    let thick = grid([40, 36, 12], DVec3::new(0.8, 0.9, 3.0));
    let centre = DVec3::new(25.0, -5.0, 46.0);
    let ball_ml = 4.0 / 3.0 * std::f64::consts::PI * 1.0;
    let ct = scan(&thick, |point| 1000.0 - 100.0 * (point - centre).length());
    let band = Params { method: Method::Threshold, lower: Some(0.0), thick_slices: 0.0, ..Params::default() };
    for spacing in [Spacing::Isotropic, Spacing::Cubic(0.5), Spacing::Each([0.8, 0.9, 1.0])] {
        let resampled = done(segment(&ct, &Params { resample_mm: Some(spacing), ..band.clone() }));
        let (place, ml) = middle(&resampled.mask);
        assert!((place - centre).length() < 0.05, "{spacing:?}: {place}");
        assert!((ml / ball_ml - 1.0).abs() < 0.03, "{spacing:?}: {ml} ml");
        let found = resampled.mask.grid().spacing_mm();
        assert!((found - spacing.mm(thick.spacing_mm())).length() < 1e-5, "{found}");
        assert_eq!(resampled.report.warnings[0].code, "W-VOLUME-RESAMPLED");
        assert!(resampled.report.warnings[0].message.contains("40x36x12"), "{:?}", resampled.report.warnings);

        // The same of the mask: chosen first, then resampled.
        let mask = done(segment(&ct, &band)).mask;
        let resampled = done(clean(mask, &at(spacing)));
        let (place, ml) = middle(&resampled.mask);
        assert!((place - centre).length() < 0.15, "{spacing:?}: {place}");
        assert!((ml / ball_ml - 1.0).abs() < 0.06, "{spacing:?}: {ml} ml");
    }
}

#[test]
fn the_same_spacing_changes_nothing() {
    let mask = Mask::from_fn(grid([9, 8, 7], DVec3::new(1.0, 1.0, 2.5)), |[x, y, z]| x + y > 4 && z > 1);
    let same = done(clean(mask.clone(), &at(Spacing::Each([1.0, 1.0, 2.5]))));
    assert_eq!((same.mask, same.report.warnings.len()), (mask, 0));
}

/// Whole factors: each voxel becomes a block of its own, but for the corners that a half cuts off.
#[test]
fn a_mask_is_cut_at_a_half() {
    let mask = Mask::from_fn(grid([5, 1, 1], DVec3::ONE), |[x, ..]| x == 1 || x == 2);
    let fine = done(clean(mask, &at(Spacing::Each([0.5, 1.0, 1.0]))));
    let row: Vec<bool> = fine.mask.to_voxels();
    assert_eq!(row, [false, false, true, true, true, true, false, false, false, false]);
    let coarse = Mask::from_fn(grid([6, 1, 1], DVec3::ONE), |[x, ..]| x >= 2);
    let coarse = done(clean(coarse, &at(Spacing::Each([2.0, 1.0, 1.0]))));
    assert_eq!(coarse.mask.to_voxels(), [false, true, true]);
    assert!(coarse.report.warnings[0].message.contains("coarser"));
}

#[test]
fn a_seed_is_meant_on_the_files_axes() {
    let thick = grid([20, 20, 6], DVec3::new(1.0, 1.0, 4.0));
    // Two bright columns; the seed is in the one at x = 15.
    let ct = scan(&thick, |point| {
        let near = |x: f64| DVec2::new(point.x - 10.0 - x, point.y + 20.0 - 10.0).length() < 2.5;
        if near(5.0) || near(15.0) { 1000.0 } else { -30.0 - point.z }
    });
    let params = Params {
        method: Method::RegionGrow,
        lower: Some(500.0),
        seed_voxel: Some([15, 10, 5]),
        ..at(Spacing::Isotropic)
    };
    let grown = done(segment(&ct, &params));
    let (place, _) = middle(&grown.mask);
    assert!((place - DVec3::new(25.0, -10.0, 40.0)).length() < 0.1, "{place}");
    assert_eq!(grown.mask.grid().shape(), [20, 20, 24]);
    let outside = Params { seed_voxel: Some([15, 10, 6]), ..params };
    assert_eq!(segment(&ct, &outside).expect_err("outside").code(), "E-VOLUME-SEED-OUTSIDE");
}

#[test]
fn what_is_too_much_or_illegal_is_refused() {
    let mask = Mask::from_fn(grid([9, 9, 9], DVec3::ONE), |_| true);
    let check = |spacing, expected| {
        let error = clean(mask.clone(), &at(spacing)).expect_err("refused");
        assert_eq!((error.code(), error.class().exit_code()), expected, "{spacing:?}: {error}");
    };
    check(Spacing::Cubic(1e-6), ("E-VOLUME-TOO-LARGE", 5));
    check(Spacing::Cubic(0.0), ("E-PARAM", 2));
    check(Spacing::Each([1.0, f64::NAN, 1.0]), ("E-PARAM", 2));
    let parse =
        |text: &str| toml::from_str::<Params>(&format!("resample_mm = {text}")).map(|p| p.resample_mm);
    assert_eq!(parse("0.7").expect("legal"), Some(Spacing::Cubic(0.7)));
    assert_eq!(parse("[1, 1, 2.5]").expect("legal"), Some(Spacing::Each([1.0, 1.0, 2.5])));
    assert_eq!(parse("\"isotropic\"").expect("legal"), Some(Spacing::Isotropic));
    for wrong in ["\"fine\"", "[1, 2]", "[1, 2, 3, 4]", "true"] {
        assert!(parse(wrong).is_err(), "{wrong}");
    }
}

/// The spacing of each axis is that of the file's, though the mask's are turned to right, anterior, superior.
#[test]
fn each_spacing_is_along_the_files_own_axes() {
    // x of the file goes up, y to the left, z to the front.
    let axes = DMat3::from_cols(DVec3::Z * 2.0, DVec3::NEG_X * 3.0, DVec3::Y);
    let grid = Grid::new([8, 6, 12], DAffine3::from_mat3(axes)).expect("legal");
    let mask = Mask::from_fn(grid, |_| true);
    let turned = done(clean(mask, &at(Spacing::Each([1.0, 1.5, 0.5]))));
    let grid = turned.mask.grid();
    assert!((grid.spacing_mm() - DVec3::new(1.5, 0.5, 1.0)).length() < 1e-6, "{}", grid.spacing_mm());
    assert_eq!((grid.shape(), grid.orientation().as_str()), ([12, 24, 16], "RAS"));
}
