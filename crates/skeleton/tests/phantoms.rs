//! Bodies whose skeletons are known: lines, bars, tubes, rings, balls.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "tests say what they found, and fail aloud"
)]

mod common;

use common::{mask_of, skeleton_mask, topology};
use espalier_model::Mask;
use espalier_skeleton::{Error, Params, Thinning, skeletonize};
use glam::DVec3;

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
    let params = Params { thinning: Thinning::Lee94 };
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
fn an_empty_mask_is_an_error() {
    let empty = mask_of([3, 3, 3], |_| false);
    assert_eq!(skeletonize(&empty, &Params::default()), Err(Error::EmptyMask));
}

#[test]
fn params_come_from_toml() {
    let params: Params = toml::from_str("thinning = \"lee94\"").expect("legal");
    assert_eq!(params, Params { thinning: Thinning::Lee94 });
    assert_eq!(toml::from_str::<Params>("").expect("defaults"), Params::default());
    assert!(toml::from_str::<Params>("thining = \"safe\"").is_err());
    assert!(Params::default().validate().is_ok());
}
