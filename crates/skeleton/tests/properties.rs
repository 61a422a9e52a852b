//! What holds for the skeleton of any mask.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "tests say what they found, and fail aloud"
)]

mod common;

use common::{grid, mask_of, skeleton_mask, topology};
use espalier_geom::random::{Purpose, Stream};
use espalier_model::Mask;
use espalier_skeleton::{Orientation, Params, Thinning, skeletonize};
use glam::DVec3;

/// A random volume: white noise for odd seeds, blobs for even ones.
fn random_mask(seed: u32) -> Mask {
    let mut stream = Stream::new(u64::from(seed), Purpose::Test, 7, 0);
    let shape = [0; 3].map(|_| 6 + stream.below(9) as usize);
    if seed % 2 == 1 {
        let density = stream.uniform(0.1, 0.9);
        let noise: Vec<bool> = (0..shape.iter().product()).map(|_| stream.unit() < density).collect();
        return Mask::from_voxels(grid(shape), &noise);
    }
    let size = DVec3::from_array(shape.map(|n| n as f64));
    let balls: Vec<(DVec3, f64)> = (0..3 + stream.below(9))
        .map(|_| {
            let center = DVec3::new(stream.unit(), stream.unit(), stream.unit()) * size;
            (center, stream.uniform(0.7, 4.0))
        })
        .collect();
    mask_of(shape, |p| balls.iter().any(|&(center, radius)| p.distance(center) <= radius))
}

#[test]
fn safe_keeps_the_topology_of_200_random_volumes() {
    for seed in 0..200 {
        let mask = random_mask(seed);
        if mask.n_foreground() == 0 {
            continue;
        }
        let thinned = skeletonize(&mask, &Params::default()).expect("not empty");
        let skeleton = skeleton_mask(&mask, &Params::default());
        assert_eq!(topology(&skeleton), topology(&mask), "seed {seed}: components, Euler number");
        assert!(thinned.report.warnings.is_empty(), "seed {seed}");
        assert_eq!(
            thinned.report.get("mask_euler_number"),
            Some(f64::from(topology(&mask).1)),
            "seed {seed}"
        );
        let is_inside = thinned.skeleton.voxels().iter().all(|v| mask.contains(v.map(i64::from)));
        assert!(is_inside, "seed {seed}: skeleton outside the mask");
        assert_eq!(skeleton_mask(&skeleton, &Params::default()), skeleton, "seed {seed}: thin again");
    }
}

#[test]
fn lee94_counts_what_it_loses() {
    let params = Params { thinning: Thinning::Lee94, orientation: Orientation::Stored };
    let mut n_changed = 0;
    for seed in 0..200 {
        let mask = random_mask(seed);
        if mask.n_foreground() == 0 {
            continue;
        }
        let thinned = skeletonize(&mask, &params).expect("not empty");
        let is_changed = topology(&skeleton_mask(&mask, &params)) != topology(&mask);
        assert_eq!(!thinned.report.warnings.is_empty(), is_changed, "seed {seed}");
        n_changed += usize::from(is_changed);
    }
    println!("the published rule changes the topology of {n_changed} of 200 volumes");
    assert!(n_changed > 0, "the warning was never tested");
}

#[test]
fn empty_margins_change_nothing() {
    let inner = random_mask(4);
    let [nx, ny, nz] = inner.grid().shape();
    let outer = mask_of([nx + 5, ny + 4, nz + 3], |p| inner.contains((p - 2.0).to_array().map(|c| c as i64)));
    for thinning in [Thinning::Safe, Thinning::Lee94] {
        let params = Params { thinning, ..Params::default() };
        let voxels = |mask| skeletonize(mask, &params).expect("not empty").skeleton.voxels().to_vec();
        let shifted: Vec<[u32; 3]> = voxels(&inner).into_iter().map(|v| v.map(|c| c + 2)).collect();
        assert_eq!(voxels(&outer), shifted, "{thinning:?}");
    }
}
