//! Organs that the border of the scan cuts, and masks of no shape at all: every step takes what the one before gives.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

use espalier_geom::random::{Purpose, Stream};
use espalier_model::{Grid, Mask, Tree};
use glam::DVec3;

/// The whole way from a mask to its tree.
#[track_caller]
fn grow(mask: &Mask) -> Tree {
    let skeleton = espalier_skeleton::skeletonize(mask, &Default::default()).expect("a skeleton").skeleton;
    let spheres =
        espalier_radius::inscribed_spheres(mask, &skeleton, &Default::default()).expect("spheres").spheres;
    let (low, high) = (DVec3::ZERO, DVec3::from_array(mask.grid().shape().map(|n| (n - 1) as f64)));
    for sphere in &spheres.0 {
        let center = mask.grid().voxel_from_world().transform_point3(sphere.center_mm);
        assert!(
            center.cmpge(low - 1e-9).all() && center.cmple(high + 1e-9).all(),
            "centre outside: {center}"
        );
    }
    espalier_tree::build(mask, &skeleton, &spheres, &Default::default()).expect("a tree").tree
}

#[test]
fn tubes_cut_lengthwise() {
    for spacing in [DVec3::ONE, DVec3::new(0.8, 0.8, 5.0), DVec3::new(1.0, 3.0, 2.0)] {
        for share in [-0.7, -0.2, 0.0, 0.6] {
            let shape = [90, 24, 24];
            let grid = Grid::axis_aligned(shape, spacing, DVec3::ZERO).expect("grid");
            let radius = 2.0 * spacing.max_element();
            let axis = DVec3::new(0.0, share * radius, 12.0 * spacing.z);
            let inside = |p: DVec3| (p - axis).with_x(0.0).length() <= radius;
            let mask =
                Mask::from_fn(grid, |voxel| inside(DVec3::from_array(voxel.map(|c| c as f64)) * spacing));
            let length_mm = grow(&mask).length_mm();
            assert!(length_mm >= 89.0 * spacing.x - 2.0 * radius, "{spacing} {share}: {length_mm} mm");
        }
    }
}

#[test]
fn masks_of_no_shape() {
    for seed in 0..30 {
        let mut stream = Stream::new(seed, Purpose::Test, 21, 0);
        let shape = [0; 3].map(|_| 1 + stream.below(14) as usize);
        let spacing =
            DVec3::new(stream.uniform(0.2, 5.0), stream.uniform(0.2, 5.0), stream.uniform(0.2, 5.0));
        let grid = Grid::axis_aligned(shape, spacing, DVec3::ZERO).expect("grid");
        let density = stream.uniform(0.2, 1.0);
        let mut voxels: Vec<bool> = (0..grid.n_voxels()).map(|_| stream.unit() < density).collect();
        voxels[0] = true;
        assert!(grow(&Mask::from_voxels(grid, &voxels)).n_nodes() >= 1);
    }
}
