//! The distance field against brute force.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "tests say what they found, and fail aloud"
)]

use espalier_geom::random::{Purpose, Stream};
use espalier_model::{Grid, Mask, Skeleton};
use espalier_radius::{Params, Rule, distance_field, inscribed_spheres};
use glam::DVec3;

/// The nearest background centre among all of them.
fn by_brute_force(mask: &Mask, voxel: [i64; 3]) -> f64 {
    let (grid, spacing) = (mask.grid(), mask.grid().spacing_mm());
    let point = DVec3::from_array(voxel.map(|c| c as f64)) * spacing;
    (0..grid.n_voxels())
        .filter(|&index| !mask.bits().get(grid.voxel(index)))
        .map(|index| (DVec3::from_array(grid.voxel(index).map(|c| c as f64)) * spacing).distance(point))
        .fold(f64::INFINITY, f64::min)
}

/// White noise.
fn random(grid: &Grid, stream: &mut Stream, density: f64) -> Mask {
    let voxels: Vec<bool> = (0..grid.n_voxels()).map(|_| stream.unit() < density).collect();
    Mask::from_voxels(grid.clone(), &voxels)
}

fn check(mask: &Mask, name: &str) {
    let field = distance_field(mask);
    for index in 0..mask.grid().n_voxels() {
        let voxel = mask.grid().voxel(index).map(|c| c as i64);
        let (ours, expected) = (field.distance_mm(voxel), by_brute_force(mask, voxel));
        assert!(
            (ours - expected).abs() < 1e-6 || ours == expected,
            "{name} {voxel:?}: {ours}, expected {expected}"
        );
    }
    assert_eq!(field.distance_mm([-1, 0, 0]), 0.0, "{name}: outside the scan");

    // What the bits say about each foreground voxel, taken for a skeleton.
    let voxels: Vec<[u32; 3]> = mask.voxels().map(|voxel| voxel.map(|c| c as u32)).collect();
    if voxels.is_empty() || voxels.len() == mask.grid().n_voxels() {
        return;
    }
    let skeleton = Skeleton::new(mask.grid().clone(), voxels.clone());
    for rule in [Rule::Voxel, Rule::NeighborhoodMax] {
        let params = Params { rule, ..Params::default() };
        let spheres = inscribed_spheres(mask, &skeleton, &params).expect("spheres").spheres;
        for (voxel, sphere) in voxels.iter().zip(&spheres.0) {
            let voxel = voxel.map(i64::from);
            let around = (0..27).map(|i| [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1]);
            let largest = around
                .map(|offset| field.distance_mm([0, 1, 2].map(|axis| voxel[axis] + offset[axis])))
                .fold(0.0, f64::max);
            let expected = if rule == Rule::Voxel { field.distance_mm(voxel) } else { largest };
            assert!((sphere.radius_mm - expected).abs() < 1e-6, "{name} {voxel:?}: {sphere:?}, {expected}");
        }
    }
}

#[test]
fn random_masks_of_any_spacing() {
    for seed in 0..60 {
        let mut stream = Stream::new(seed, Purpose::Test, 11, 0);
        let shape = [0; 3].map(|_| 1 + stream.below(13) as usize);
        let spacing =
            DVec3::new(stream.uniform(0.2, 5.0), stream.uniform(0.2, 5.0), stream.uniform(0.2, 5.0));
        let grid = Grid::axis_aligned(shape, spacing, DVec3::ZERO).expect("grid");
        // Dense masks have long runs and few sites, sparse ones the opposite; some touch all borders.
        let density = stream.uniform(0.3, 1.0);
        let mask = random(&grid, &mut stream, density);
        check(&mask, &format!("seed {seed}"));
    }
}

#[test]
fn extreme_masks() {
    let grid = |shape| Grid::axis_aligned(shape, DVec3::new(1.0, 2.0, 5.0), DVec3::ZERO).expect("grid");
    check(&Mask::empty(grid([3, 4, 5])), "empty");
    check(&Mask::from_fn(grid([1, 1, 1]), |_| true), "one voxel, no background");
    let full = grid([4, 3, 2]);
    check(&Mask::from_fn(full.clone(), |_| true), "no background");
    for hole in [0, 11, 23] {
        check(&Mask::from_fn(full.clone(), |voxel| full.index(voxel) != hole), &format!("hole at {hole}"));
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let grid = Grid::axis_aligned([40, 37, 31], DVec3::new(0.7, 0.7, 3.1), DVec3::ZERO).expect("grid");
    let mut stream = Stream::new(3, Purpose::Test, 12, 0);
    let mask = random(&grid, &mut stream, 0.9);
    let bits = |n_threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().expect("pool");
        let field = pool.install(|| distance_field(&mask));
        let voxels = (0..grid.n_voxels()).map(|index| grid.voxel(index).map(|c| c as i64));
        voxels.map(|voxel| field.distance_mm(voxel).to_bits()).collect::<Vec<_>>()
    };
    assert_eq!(bits(1), bits(4));
}
