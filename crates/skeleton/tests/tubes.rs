//! Tubes of every width: after pruning one curve with two ends, no shorter than length − width.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "tests say what they found, and fail aloud"
)]

mod common;

use std::collections::BTreeSet;

use common::curve::{ends, pruned};
use common::{mask_of, topology};
use espalier_geom::space::plane_axes;
use espalier_model::Mask;
use espalier_skeleton::{Params, skeletonize};
use glam::DVec3;

/// Length of every tube, and the edge of the box about it.
const LENGTH: f64 = 40.0;
const BOX: usize = 52;

/// Along the axes, along diagonals, and a little off both.
const DIRECTIONS: [[f64; 3]; 15] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 1.0, 0.0],
    [0.0, 1.0, -1.0],
    [1.0, 0.0, 1.0],
    [1.0, 1.0, 1.0],
    [1.0, -1.0, 1.0],
    [1.0, 2.0, 0.0],
    [2.0, 1.0, 1.0],
    [0.0, 1.0, 3.0],
    [1.0, 0.0, -0.1],
    [-1.0, 0.05, 0.0],
    [1.0, -0.3, 0.2],
    [0.9, 0.8, -0.1],
];

/// Where the axis lies between the voxel centres.
const SHIFTS: [[f64; 3]; 4] = [[0.0; 3], [0.5; 3], [0.5, 0.0, 0.0], [0.21, 0.37, 0.83]];

/// A tube about the middle of its box, round or square.
fn tube(direction: DVec3, width: f64, is_square: bool, shift: [f64; 3]) -> Mask {
    let (right, up) = plane_axes(direction, DVec3::new(0.1, 0.2, 1.0));
    let center = DVec3::splat(25.0) + DVec3::from_array(shift);
    let radius = 0.5 * width;
    mask_of([BOX; 3], |p| {
        let q = p - center;
        let (x, y) = (q.dot(right), q.dot(up));
        let is_across = if is_square {
            x.abs().max(y.abs()) < 0.5 * width - 1e-9
        } else {
            x * x + y * y < radius * radius - 1e-9
        };
        is_across && q.dot(direction).abs() <= 0.5 * LENGTH
    })
}

/// The extent of voxels along a direction.
fn extent(voxels: impl Iterator<Item = [f64; 3]>, direction: DVec3) -> f64 {
    let (low, high) = voxels
        .map(|voxel| DVec3::from_array(voxel).dot(direction))
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), along| (low.min(along), high.max(along)));
    high - low
}

/// What was found of the tubes.
#[derive(Debug, Default)]
struct Found {
    n_tubes: usize,
    n_ends_pruned: usize,
    worst_margin: f64,
}

/// Checks every width, round and square.
fn check(direction: DVec3, shift: [f64; 3], found: &mut Found) {
    let direction = direction.normalize();
    for (width, is_square) in (1..=9).flat_map(|width| [(f64::from(width), false), (f64::from(width), true)])
    {
        // A narrower round tube in between voxels would fall apart.
        let width = if is_square { width } else { width.max(1.8) };
        let name = format!("direction {direction:.2}, width {width}, square {is_square}, shift {shift:?}");
        let mask = tube(direction, width, is_square, shift);
        if mask.n_foreground() == 0 {
            continue;
        }
        let thinned = skeletonize(&mask, &Params::default()).expect("not empty");
        if thinned.report.get("mask_components") != Some(1.0) {
            continue;
        }
        let all: BTreeSet<_> = thinned.skeleton.voxels().iter().map(|voxel| voxel.map(i64::from)).collect();
        let n_ends = ends(&all).len();
        let curve = pruned(all, &mask);
        let length = extent(mask.voxels().map(|voxel| voxel.map(|c| c as f64)), direction);
        let kept = extent(curve.iter().map(|voxel| voxel.map(|c| c as f64)), direction);
        let margin = kept - (length - width);
        assert!(margin >= 0.0, "{name}: {kept:.2} of {length:.2}");
        assert_eq!(ends(&curve).len(), 2, "{name}: ends");
        if found.n_tubes.is_multiple_of(50) {
            assert_eq!(
                topology(&mask),
                topology(&common::skeleton_mask(&mask, &Params::default())),
                "{name}"
            );
        }
        found.worst_margin = if found.n_tubes == 0 { margin } else { found.worst_margin.min(margin) };
        found.n_tubes += 1;
        found.n_ends_pruned += n_ends - 2;
    }
}

#[test]
fn tubes_keep_their_length_and_two_ends() {
    let mut found = Found::default();
    for (direction, shift) in DIRECTIONS.into_iter().zip(SHIFTS.into_iter().cycle()) {
        check(DVec3::from_array(direction), shift, &mut found);
    }
    println!("{found:?}");
    assert!(found.n_tubes >= 240 && found.n_ends_pruned == 0, "{found:?}");
}

/// Some minutes in a debug build: `cargo test --release -p espalier-skeleton --test tubes -- --ignored --nocapture`.
#[test]
#[ignore = "seconds in a release build, minutes in a debug build"]
fn tubes_of_all_directions_keep_their_length_and_two_ends() {
    let mut found = Found::default();
    let sphere = (0..60).map(|step| {
        let z = (f64::from(step) + 0.5) / 60.0;
        let (sin, cos) = espalier_geom::math::sin_cos(f64::from(step) * 2.399_963_229_728_653);
        DVec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z)
    });
    for direction in DIRECTIONS.map(DVec3::from_array).into_iter().chain(sphere) {
        SHIFTS.into_iter().for_each(|shift| check(direction, shift, &mut found));
    }
    println!("{found:?}");
    assert!(found.n_tubes >= 4500 && found.n_ends_pruned == 0, "{found:?}");
}
