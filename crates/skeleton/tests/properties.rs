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
use espalier_skeleton::{Params, Thinning, skeletonize};
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

/// What must hold for `safe` on any mask.
fn check_safe(mask: &Mask, name: &str) {
    let params = Params::default();
    let thinned = skeletonize(mask, &params).expect("not empty");
    let skeleton = skeleton_mask(mask, &params);
    assert_eq!(topology(&skeleton), topology(mask), "{name}: components, Euler number");
    assert!(thinned.report.warnings.is_empty(), "{name}");
    assert_eq!(thinned.report.get("mask_euler_number"), Some(f64::from(topology(mask).1)), "{name}");
    assert_eq!(thinned.report.get("mask_components"), Some(topology(mask).0 as f64), "{name}");
    let is_inside = thinned.skeleton.voxels().iter().all(|v| mask.contains(v.map(i64::from)));
    assert!(is_inside, "{name}: skeleton outside the mask");
    assert_eq!(skeleton_mask(&skeleton, &params), skeleton, "{name}: thin again");
}

#[test]
fn safe_keeps_the_topology_of_200_random_volumes() {
    for seed in 0..200 {
        let mask = random_mask(seed);
        if mask.n_foreground() > 0 {
            check_safe(&mask, &format!("seed {seed}"));
        }
    }
}

#[test]
fn safe_keeps_the_topology_of_the_400_volumes_of_the_fixture() {
    let not_empty = |(_, mask, _): &(String, Mask, Mask)| mask.n_foreground() > 0;
    let cases: Vec<_> = common::fixture().into_iter().filter(not_empty).collect();
    assert!(cases.len() >= 395, "{} volumes", cases.len());
    cases.iter().for_each(|(name, mask, _)| check_safe(mask, name));
}

/// Name, and the most ends that `safe` may leave: about those of `lee94`, which are 39, 35, 40, 48, 49, 3 and 668, and what
/// is brought back, most of it on the first, whose slices are 3 mm thick (55).
const MOST_ENDS: [(&str, usize); 7] = [
    ("airquant_airway", 56),
    ("exact09_case18_bronchi", 48),
    ("medmpd_lungs1_bronchi", 52),
    ("totalseg_pulmonary_airway", 54),
    ("medmpd_liver3_hepatic_vein", 60),
    ("vmtk_aorta_levelset_mask", 3),
    ("medmpd_brain2_vessels", 770),
];

#[test]
fn safe_keeps_the_topology_of_real_masks_and_does_not_fray() {
    let Some(data) = common::data_folder() else { return };
    for (name, most_ends) in MOST_ENDS {
        let mask = common::read_mask(&data.join(format!("volumes/{name}.nii.gz")));
        // Counting large masks apart from the crate's own code takes minutes.
        if mask.n_foreground() < 10_000 {
            check_safe(&mask, name);
        }
        let params = Params::default();
        let thinned = skeletonize(&mask, &params).expect("not empty");
        assert!(thinned.report.warnings.is_empty(), "{name}: {:?}", thinned.report.warnings);
        let n_ends = thinned.report.get("skeleton_endpoints").expect("count");
        assert!(n_ends <= most_ends as f64, "{name}: {n_ends} ends");
    }
}

/// Masks that fill their volume to every border, down to one voxel.
#[test]
fn safe_keeps_the_topology_of_full_volumes() {
    let longs = [1, 2, 61, 62, 63, 64, 65, 66, 127, 130];
    let bars = longs.into_iter().flat_map(|n| {
        (0..3).flat_map(move |axis| {
            [[1, 1], [1, 2], [2, 2], [3, 2]].map(|[a, b]| {
                let mut shape = [a, b, a];
                shape[axis] = n;
                shape
            })
        })
    });
    let blocks = [[2, 2, 2], [1, 14, 9], [14, 1, 9], [14, 9, 1], [5, 5, 5], [17, 16, 15], [70, 20, 3]];
    for shape in bars.chain(blocks) {
        let full = mask_of(shape, |_| true);
        check_safe(&full, &format!("{shape:?}"));
        let n_voxels = skeleton_mask(&full, &Params::default()).n_foreground();
        let mut extents = shape;
        extents.sort_unstable();
        let [_, width, length] = extents;
        let least = if width <= 3 { length.saturating_sub(width).max(1) } else { 1 };
        assert!((least..=length + width).contains(&n_voxels), "{shape:?}: {n_voxels} voxels");
    }
}

#[test]
fn lee94_counts_what_it_loses() {
    let params = Params { thinning: Thinning::Lee94 };
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
        let params = Params { thinning };
        let voxels = |mask| skeletonize(mask, &params).expect("not empty").skeleton.voxels().to_vec();
        let shifted: Vec<[u32; 3]> = voxels(&inner).into_iter().map(|v| v.map(|c| c + 2)).collect();
        assert_eq!(voxels(&outer), shifted, "{thinning:?}");
    }
}
