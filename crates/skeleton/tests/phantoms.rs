//! Bodies whose skeletons are known: lines, bars, tubes, rings, balls.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "tests say what they found, and fail aloud"
)]

mod common;

use common::{mask_of, skeleton_mask, topology};
use espalier_model::{Grid, Mask};
use espalier_skeleton::{Error, Orientation, Params, Thinning, skeletonize};
use glam::{DAffine3, DVec3};

fn safe(mask: &Mask) -> Vec<[u32; 3]> {
    skeletonize(mask, &Params::default()).expect("not empty").skeleton.voxels().to_vec()
}

#[test]
fn a_line_stays_as_it_is() {
    for axis in 0..3 {
        let line = mask_of([9, 9, 9], |p| (0..3).all(|other| other == axis || p[other] == 4.0));
        assert_eq!(skeleton_mask(&line, &Params::default()), line, "axis {axis}");
    }
}

#[test]
fn blocks_do_not_vanish() {
    for size in 1..=7 {
        let block = mask_of([9, 9, 9], |p| p.min_element() >= 1.0 && p.max_element() <= f64::from(size));
        let n_voxels = safe(&block).len();
        assert!((1..=size.max(3) as usize).contains(&n_voxels), "cube of {size}: {n_voxels} voxels");
    }
    let block = mask_of([4, 4, 4], |p| p.min_element() >= 1.0 && p.max_element() <= 2.0);
    let params = Params { thinning: Thinning::Lee94, ..Params::default() };
    let lee94 = skeletonize(&block, &params).expect("not empty");
    assert!(lee94.skeleton.voxels().is_empty(), "the published rule loses it");
    assert_eq!(lee94.report.warnings[0].code, "W-SKELETON-TOPOLOGY");
}

#[test]
fn a_torus_keeps_its_loop() {
    let torus = mask_of([41, 41, 15], |p| {
        let q = p - DVec3::new(20.0, 20.0, 7.0);
        let ring = (q.x * q.x + q.y * q.y).sqrt() - 14.0;
        ring * ring + q.z * q.z <= 20.0
    });
    let skeleton = skeleton_mask(&torus, &Params::default());
    assert_eq!(topology(&skeleton), (1, 0));
    let n_voxels = skeleton.n_foreground() as f64;
    // A digital circle of radius 14 in 26-steps: 8·14/√2 at least, its circumference at most.
    assert!((79.0..=89.0).contains(&n_voxels), "{n_voxels}");
}

#[test]
fn a_hollow_ball_keeps_its_cavity() {
    let shell = mask_of([21, 21, 21], |p| (5.0..=8.0).contains(&p.distance(DVec3::splat(10.0))));
    // One component and one cavity: Euler number 2.
    assert_eq!(topology(&shell), (1, 2));
    assert_eq!(topology(&skeleton_mask(&shell, &Params::default())), (1, 2));
}

#[test]
fn a_full_grid_thins_to_its_middle() {
    let full = mask_of([5, 5, 31], |_| true);
    let voxels = safe(&full);
    assert!(voxels.iter().all(|&[x, y, _]| (x, y) == (2, 2)) && voxels.len() >= 26, "{voxels:?}");
}

#[test]
fn orientation_ras_undoes_the_storage_order() {
    let body = |p: DVec3| {
        let trunk = (p.x - 14.0).abs() <= 2.5 && (p.y - 10.0).abs() <= 2.0;
        let branch =
            (p.y - 10.0 - 0.7 * (p.x - 14.0)).abs() <= 1.5 && (p.z - 12.0).abs() <= 1.5 && p.x >= 14.0;
        trunk || branch
    };
    let upright = mask_of([30, 24, 26], body);
    // The same body stored as (z, x, y) with x running from right to left.
    let affine = DAffine3::from_cols(DVec3::Z, DVec3::NEG_X, DVec3::Y, DVec3::new(29.0, 0.0, 0.0));
    let grid = Grid::new([26, 30, 24], affine).expect("grid");
    let turned = Mask::from_fn(grid, |voxel| {
        let [z, x, y] = voxel.map(|c| c as f64);
        body(DVec3::new(29.0 - x, y, z))
    });

    let mut ours = safe(&turned).into_iter().map(|[z, x, y]| [29 - x, y, z]).collect::<Vec<_>>();
    ours.sort_unstable_by_key(|&[x, y, z]| [z, y, x]);
    assert_eq!(ours, safe(&upright));
    let stored_order = Params { orientation: Orientation::Stored, ..Params::default() };
    assert_eq!(skeleton_mask(&upright, &stored_order), skeleton_mask(&upright, &Params::default()));
}

#[test]
fn an_empty_mask_is_an_error() {
    let empty = mask_of([3, 3, 3], |_| false);
    assert_eq!(skeletonize(&empty, &Params::default()), Err(Error::EmptyMask));
}

#[test]
fn params_come_from_toml() {
    let params: Params = toml::from_str("thinning = \"lee94\"\norientation = \"stored\"").expect("legal");
    assert_eq!(params, Params { thinning: Thinning::Lee94, orientation: Orientation::Stored });
    assert_eq!(toml::from_str::<Params>("").expect("defaults"), Params::default());
    assert!(toml::from_str::<Params>("thining = \"safe\"").is_err());
    assert!(Params::default().validate().is_ok());
}
