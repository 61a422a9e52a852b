//! Closed forms: what the formula says, the tree and the mask must say too.

#![allow(clippy::expect_used, clippy::panic, reason = "helpers of tests fail as tests do")]

use std::f64::consts::PI;

use espalier_geom::{angle, math};
use espalier_model::Tree;
use espalier_phantom::{Kind, Params, Phantom, generate, rasterise};
use glam::DVec3;

mod common;

fn make(kind: Kind, params: &Params) -> Phantom {
    generate(kind, params, 0).expect("a legal phantom")
}

fn measured_volume(phantom: &Phantom) -> f64 {
    let mask = phantom.mask.as_ref().expect("a mask");
    mask.n_foreground() as f64 * mask.grid().voxel_volume_mm3()
}

/// The largest turn at any node, and the sum of turns, in degrees.
fn turns_deg(tree: &Tree) -> (f64, f64) {
    let turn = |node: usize| {
        let parent = tree.parent(node)?;
        let above = tree.parent(parent)?;
        let (p, q, r) = (tree.position_mm(above), tree.position_mm(parent), tree.position_mm(node));
        Some(angle::between(q - p, r - q).to_degrees())
    };
    (0..tree.n_nodes()).filter_map(turn).fold((0.0, 0.0), |(most, sum): (f64, f64), t| (most.max(t), sum + t))
}

/// The volume of the mask, averaged over sixteen places of the grid: a single one counts lattice points in a circle,
/// which is off by a percent or two at these radii.
fn mean_volume(kind: Kind, params: &Params) -> f64 {
    let at = |i: i32| {
        let offset_voxels = [0.8192, 0.6711, 0.5497].map(|step| (f64::from(i) * step).fract());
        measured_volume(&make(kind, &Params { offset_voxels, ..params.clone() }))
    };
    (0..16).map(at).sum::<f64>() / 16.0
}

#[test]
fn volumes_are_the_closed_forms() {
    for spacing_mm in [[0.5; 3], [0.4, 0.4, 2.0]] {
        for direction in [[0.0, 0.0, 1.0], [1.0, 2.0, 3.0]] {
            let params = Params { spacing_mm, direction, bend_radius_mm: 15.0, ..Params::default() };
            for kind in [Kind::Straight, Kind::Bent, Kind::Helix, Kind::Torus] {
                let expected = make(kind, &params).truth.volume_mm3.expect("a closed form");
                let measured = mean_volume(kind, &params);
                assert!(
                    (measured / expected - 1.0).abs() < 0.008,
                    "{kind:?} at {spacing_mm:?} along {direction:?}: {measured} mm³, expected {expected}"
                );
            }
        }
    }
}

#[test]
fn a_tapered_tube_has_the_volume_of_its_cone() {
    let params = Params { taper: 0.25, spacing_mm: [0.4; 3], ..Params::default() };
    let phantom = make(Kind::Straight, &params);
    assert_eq!(phantom.truth.volume_mm3, None);
    let (big, small, length) = (4.0, 1.0, 60.0);
    let frustum = PI * length / 3.0 * (big * big + big * small + small * small);
    // The caps are a little more than hemispheres at the thick end and less at the thin one.
    let caps = 2.0 / 3.0 * PI * (big * big * big + small * small * small);
    assert!((mean_volume(Kind::Straight, &params) / (frustum + caps) - 1.0).abs() < 0.008);
    assert_eq!(phantom.truth.radius_range_mm, [1.0, 4.0]);
}

#[test]
fn lengths_are_the_closed_forms() {
    let params = Params { bend_radius_mm: 12.0, ..Params::default() };
    for (kind, expected) in [
        (Kind::Straight, 60.0),
        (Kind::Bent, 120.0 + 12.0 * PI / 3.0),
        (Kind::Helix, 2.0 * math::hypot(40.0 * PI, 24.0)),
        (Kind::Y, 180.0),
        (Kind::Comb, 9.0 * 15.0 + 8.0 * 25.0),
    ] {
        let phantom = make(kind, &params);
        assert!((phantom.truth.length_mm - expected).abs() < 1e-9, "{kind:?}: {}", phantom.truth.length_mm);
        assert!((phantom.tree.length_mm() / expected - 1.0).abs() < 1e-3, "{kind:?}: tree");
        assert_eq!(phantom.truth.n_tips, phantom.tree.n_tips(), "{kind:?}: tips");
    }
    // The opened ring misses one step.
    let torus = make(Kind::Torus, &params);
    assert!((torus.truth.length_mm - 40.0 * PI).abs() < 1e-9);
    let missing = torus.truth.length_mm - torus.tree.length_mm();
    assert!((1.9..2.1).contains(&missing), "{missing}");
}

#[test]
fn bends_turn_by_their_angle() {
    for bend_angle_deg in [0.0, 15.0, 60.0, 120.0, 170.0] {
        for (bend_radius_mm, roll_deg) in [(0.0, 0.0), (0.0, 77.0), (20.0, -30.0)] {
            let direction = [0.3, -0.8, 0.2];
            let params = Params {
                bend_angle_deg,
                bend_radius_mm,
                roll_deg,
                direction,
                length_mm: 30.0,
                ..Params::default()
            };
            let phantom = make(Kind::Bent, &params);
            assert_eq!(phantom.truth.bend_angle_deg, Some(bend_angle_deg));
            let (most, sum) = turns_deg(&phantom.tree);
            assert!((sum - bend_angle_deg).abs() < 0.2, "{sum} of {bend_angle_deg}");
            assert!(
                bend_radius_mm > 0.0 || (most - bend_angle_deg).abs() < 0.02,
                "{most} of {bend_angle_deg}"
            );
        }
    }
}

#[test]
fn branches_of_a_y_part_by_their_angle() {
    for (branch_angle_deg, branch_share, roll_deg) in
        [(70.0, 0.5, 0.0), (40.0, 0.0, 45.0), (110.0, 0.3, 200.0), (175.0, 1.0, -90.0)]
    {
        let direction = [-1.0, 0.4, 0.7];
        let params = Params { branch_angle_deg, branch_share, roll_deg, direction, ..Params::default() };
        let phantom = make(Kind::Y, &params);
        let tree = &phantom.tree;
        let hub = (0..tree.n_nodes()).find(|&node| tree.children(node).len() == 2).expect("a fork");
        let arrival = tree.position_mm(hub) - tree.position_mm(tree.parent(hub).expect("a stem"));
        let out = |idx: usize| tree.position_mm(tree.children(hub)[idx]) - tree.position_mm(hub);
        let between = angle::between(out(0), out(1)).to_degrees();
        assert!((between - branch_angle_deg).abs() < 0.02, "{between} of {branch_angle_deg}");
        let first = angle::between(arrival, out(0)).to_degrees();
        assert!((first - branch_share * branch_angle_deg).abs() < 0.02, "{first}");
    }
}

#[test]
fn a_mask_voxel_is_one_whose_centre_lies_in_the_body() {
    let params = Params { spacing_mm: [0.9, 1.1, 2.3], offset_voxels: [0.3, -0.4, 0.1], ..Params::default() };
    for kind in [Kind::Straight, Kind::Y, Kind::Torus, Kind::Helix] {
        let phantom = make(kind, &Params { taper: 0.5, ..params.clone() });
        let mask = phantom.mask.as_ref().expect("a mask");
        let world_from_voxel = mask.grid().world_from_voxel();
        for (index, &is_inside) in mask.to_voxels().iter().enumerate().step_by(7) {
            let [x, y, z] = mask.grid().voxel(index).map(|c| c as f64);
            let depth = phantom.body.depth_mm(world_from_voxel.transform_point3(DVec3::new(x, y, z)));
            assert_eq!(is_inside, depth >= 0.0, "{kind:?} voxel {index}: depth {depth}");
        }
    }
}

#[test]
fn topology_is_known() {
    let params = Params { tooth_pitch_mm: 14.0, ..Params::default() };
    for kind in [Kind::Straight, Kind::Bent, Kind::Helix, Kind::Y, Kind::Torus, Kind::Comb] {
        let phantom = make(kind, &params);
        let mask = phantom.mask.as_ref().expect("a mask");
        assert_eq!(common::n_components(mask), 1, "{kind:?}");
        assert_eq!(common::euler_number(mask), 1 - phantom.truth.n_loops as i64, "{kind:?}");
        let (low, high) = mask.bounding_box().expect("foreground");
        let shape = mask.grid().shape();
        assert!(
            (0..3).all(|axis| low[axis] >= 2 && high[axis] + 3 <= shape[axis]),
            "{kind:?} has its margin"
        );
    }
}

#[test]
fn the_grid_can_be_shifted_below_a_voxel() {
    let volume_at = |offset: f64| {
        let params =
            Params { offset_voxels: [offset; 3], direction: [0.31, 0.77, 0.52], ..Params::default() };
        let phantom = make(Kind::Straight, &params);
        (phantom.mask.as_ref().map(|mask| mask.to_voxels()), measured_volume(&phantom), phantom.tree)
    };
    let (mask, volume, tree) = volume_at(0.0);
    let (shifted_mask, shifted_volume, shifted_tree) = volume_at(0.37);
    assert_ne!(mask, shifted_mask);
    assert_eq!(tree, shifted_tree);
    assert!((volume / shifted_volume - 1.0).abs() < 0.03);
}

#[test]
fn rough_masks_flip_the_share_asked_for() {
    let smooth = make(Kind::Straight, &Params::default());
    let rough = make(Kind::Straight, &Params { roughness: 0.15, ..Params::default() });
    let (smooth, rough) = (smooth.mask.expect("a mask"), rough.mask.expect("a mask"));
    let n_flipped = smooth.to_voxels().iter().zip(&rough.to_voxels()).filter(|(a, b)| a != b).count();
    let n_near = (0..smooth.grid().n_voxels())
        .filter(|&index| {
            let [x, y, z] = smooth.grid().voxel(index).map(|c| c as i64);
            let own = smooth.bits().get(smooth.grid().voxel(index));
            let steps = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];
            steps.iter().any(|[dx, dy, dz]| smooth.contains([x + dx, y + dy, z + dz]) != own)
        })
        .count();
    let share = n_flipped as f64 / n_near as f64;
    assert!((share - 0.15).abs() < 0.02, "{share}");
}

#[test]
fn any_tree_can_be_drawn() {
    let neuron = generate(Kind::Neuron, &Params { n_nodes: 60, ..Params::default() }, 0).expect("legal");
    assert!(neuron.mask.is_none());
    let params = Params { spacing_mm: [0.001; 3], margin_mm: 0.005, ..Params::default() };
    let mask = rasterise(&neuron.tree, &params, 0).expect("legal");
    assert!(mask.n_foreground() > 1000);
}
