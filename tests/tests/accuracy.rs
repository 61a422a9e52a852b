//! Known answers: a tube of known length, bend, branching and radius, its mask thinned, measured and made a tree again.
//!
//! **Truth** The phantom's axis, between the centres of its rounded ends.
//! **Length** of the whole tree, against the closed form.
//! **Bend angle** between straight lines fitted to the two legs, from 1.5 radii beyond the bend over 4 radii.
//! **Branch angle** between straight lines fitted to the branches, from one radius beyond the fork over 4 radii: outside
//! of the fork's sphere, where the branches are tubes of their own.
//! **Radius** at every node of the tree.
//! **Sharp corners** are cut by the medial axis, at a right angle by 0.26 radii, whatever the grid. The allowed error of the
//! length is for legs long enough not to feel it: a right angle is held to it here with 25 radii in all. Legs of 6 radii on
//! slices at the limit of two voxels to a radius came out 2.9 % short; that is a known limit, not tested away.
//! **Grids** cubes of 0.8 mm and slices of 3.5 mm with pixels of 0.7 mm; tubes along the axes and oblique to all of
//! them, centred on voxels and between them.
#![allow(clippy::print_stdout, reason = "the table is what the test is looked at for")]
#![allow(clippy::expect_used, reason = "helpers of tests only")]

use espalier_model::Tree;
use espalier_phantom::{Kind, Params, Phantom, generate};
use espalier_tree::Built;
use glam::DVec3;

/// Allowed relative error of the length.
const LENGTH: f64 = 0.01;
/// Allowed error of an angle, in degrees.
const ANGLE_DEG: f64 = 2.0;
/// Allowed error of the radius, in smallest spacings.
const RADIUS_SPACINGS: f64 = 0.5;
/// Allowed error of a fork's place, in voxels.
const FORK_VOXELS: f64 = 1.0;
/// The length of the stretches that angles are measured on, in radii.
const STRETCH: f64 = 4.0;

/// Spacing and the radius of the tube: at least twice the largest spacing.
const CUBES: ([f64; 3], f64) = ([0.8; 3], 4.0);
const SLICES: ([f64; 3], f64) = ([0.7, 0.7, 3.5], 8.0);

const DIRECTIONS: [[f64; 3]; 4] = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [1.0, 0.0, 1.0], [1.0, 0.6, 0.25]];
const OFFSETS: [[f64; 3]; 2] = [[0.0; 3], [0.37, 0.21, 0.45]];

/// Errors of one phantom against what is allowed: (name, error, allowed).
type Errors = Vec<(&'static str, f64, f64)>;

/// Runs a kind of phantom on both grids in all directions; `shape` sets its lengths and angles, in radii.
fn check(kind: Kind, shape: impl Fn(&mut Params), angles: impl Fn(&Params, &Tree) -> Errors) {
    let mut failures = Vec::new();
    for (spacing_mm, radius_mm) in [CUBES, SLICES] {
        for (i, direction) in DIRECTIONS.into_iter().enumerate() {
            let offset_voxels = OFFSETS[i % OFFSETS.len()];
            let mut params = Params {
                spacing_mm,
                offset_voxels,
                direction,
                radius_mm,
                margin_mm: 2.0,
                ..Params::default()
            };
            params.step_mm = 0.25 * radius_mm;
            shape(&mut params);
            let (phantom, tree) = round_trip(kind, &params);
            let mut errors = common_errors(&params, &phantom, &tree);
            errors.extend(angles(&params, &tree));
            let cells: Vec<String> = errors
                .iter()
                .map(|(name, error, allowed)| format!("{name} {error:+.3}/{allowed:.2}"))
                .collect();
            println!("{kind:?} {spacing_mm:?} along {direction:?} {offset_voxels:?}: {}", cells.join("  "));
            for (name, error, allowed) in errors {
                if error.is_nan() || error.abs() > allowed {
                    failures.push(format!(
                        "{kind:?} {spacing_mm:?} along {direction:?}: {name} {error:+.4}, allowed {allowed:.3}"
                    ));
                }
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

fn round_trip(kind: Kind, params: &Params) -> (Phantom, Tree) {
    let phantom = generate(kind, params, 0).expect("a phantom");
    let mask = phantom.mask.as_ref().expect("a mask");
    let skeleton = espalier_skeleton::skeletonize(mask, &espalier_skeleton::Params::default())
        .expect("a skeleton")
        .skeleton;
    let spheres = espalier_radius::inscribed_spheres(mask, &skeleton, &espalier_radius::Params::default())
        .expect("spheres")
        .spheres;
    let Built { tree, .. } =
        espalier_tree::build(mask, &skeleton, &spheres, &espalier_tree::Params::default()).expect("a tree");
    (phantom, tree)
}

/// Tips, length and radii.
fn common_errors(params: &Params, phantom: &Phantom, tree: &Tree) -> Errors {
    let smallest = params.spacing_mm.into_iter().fold(f64::INFINITY, f64::min);
    let radius_error = tree
        .nodes()
        .iter()
        .map(|node| node.radius_mm - params.radius_mm)
        .fold(0.0, |worst: f64, error| if error.abs() > worst.abs() { error } else { worst });
    vec![
        ("tips", tree.n_tips() as f64 - phantom.truth.n_tips as f64, 0.0),
        ("length", tree.length_mm() / phantom.truth.length_mm - 1.0, LENGTH),
        ("radius_mm", radius_error, RADIUS_SPACINGS * smallest),
    ]
}

/// The direction of a polyline between two arc lengths, by least squares over evenly spaced points.
fn direction(polyline: &[DVec3], from_mm: f64, to_mm: f64) -> DVec3 {
    const N: usize = 100;
    let point = |share: f64| {
        let mut left_mm = from_mm + share * (to_mm - from_mm);
        for edge in polyline.windows(2) {
            let length_mm = edge[0].distance(edge[1]);
            if left_mm <= length_mm {
                return edge[0].lerp(edge[1], left_mm / length_mm);
            }
            left_mm -= length_mm;
        }
        polyline[polyline.len() - 1]
    };
    let slope: DVec3 = (0..=N).map(|i| (i as f64 / N as f64 - 0.5) * point(i as f64 / N as f64)).sum();
    slope.normalize()
}

fn angle_deg(a: DVec3, b: DVec3) -> f64 {
    espalier_geom::math::acos(a.dot(b).clamp(-1.0, 1.0)).to_degrees()
}

fn bend_error(params: &Params, tree: &Tree) -> Errors {
    let polyline: Vec<DVec3> = tree.nodes().iter().map(|node| node.position_mm).collect();
    let half_arc = 0.5 * params.bend_radius_mm * params.bend_angle_deg.to_radians();
    let (middle, near) = (0.5 * tree.length_mm(), half_arc + 1.5 * params.radius_mm);
    let far = near + STRETCH * params.radius_mm;
    let before = direction(&polyline, middle - far, middle - near);
    let after = direction(&polyline, middle + near, middle + far);
    vec![("bend_deg", angle_deg(before, after) - params.bend_angle_deg, ANGLE_DEG)]
}

fn fork_errors(params: &Params, tree: &Tree) -> Errors {
    let branches = tree.branches();
    let [first, _, _] = branches.list() else { return vec![("branches", branches.list().len() as f64, 3.0)] };
    let fork = first.end();
    let outwards: Vec<DVec3> = branches
        .list()
        .iter()
        .map(|branch| {
            let mut polyline: Vec<DVec3> = branch.polyline().map(|node| tree.position_mm(node)).collect();
            if branch.end() == fork {
                polyline.reverse();
            }
            direction(&polyline, params.radius_mm, (1.0 + STRETCH) * params.radius_mm)
        })
        .collect();
    // The root may be at any of the three tips; the stem is the branch that runs against the axis.
    let axis = DVec3::from_array(params.direction);
    let stem =
        (0..3).min_by(|&a, &b| outwards[a].dot(axis).total_cmp(&outwards[b].dot(axis))).expect("three");
    let [a, b] = [(stem + 1) % 3, (stem + 2) % 3].map(|i| outwards[i]);
    let mut turns = [angle_deg(-outwards[stem], a), angle_deg(-outwards[stem], b)];
    turns.sort_by(f64::total_cmp);
    let share = params.branch_share.min(1.0 - params.branch_share);
    let fork_voxels = (tree.position_mm(fork) / DVec3::from_array(params.spacing_mm)).length();
    vec![
        ("branch_deg", angle_deg(a, b) - params.branch_angle_deg, ANGLE_DEG),
        ("turn_deg", turns[0] - share * params.branch_angle_deg, ANGLE_DEG),
        ("turn_deg", turns[1] - (1.0 - share) * params.branch_angle_deg, ANGLE_DEG),
        ("fork_voxels", fork_voxels, FORK_VOXELS),
    ]
}

#[test]
fn straight_tubes() {
    check(Kind::Straight, |p| p.length_mm = 30.0 * p.radius_mm, |_, _| Vec::new());
}

#[test]
fn sharp_bends() {
    // A sharp corner's medial axis cuts the corner, by a quarter of a radius at a right angle; the legs are long
    // enough that this is not what the test measures.
    for (angle_deg, legs) in [(60.0, 15.0), (90.0, 25.0)] {
        check(
            Kind::Bent,
            |p| {
                p.length_mm = legs * p.radius_mm;
                p.bend_angle_deg = angle_deg;
                p.roll_deg = 30.0;
            },
            bend_error,
        );
    }
}

#[test]
fn round_bends() {
    check(
        Kind::Bent,
        |p| {
            p.length_mm = 12.0 * p.radius_mm;
            p.bend_angle_deg = 75.0;
            p.bend_radius_mm = 3.0 * p.radius_mm;
            p.roll_deg = 50.0;
        },
        bend_error,
    );
}

#[test]
fn forks() {
    for (branch_angle_deg, branch_share, roll_deg) in
        [(70.0, 0.5, 0.0), (40.0, 0.5, 20.0), (110.0, 0.3, 70.0)]
    {
        check(
            Kind::Y,
            |p| {
                p.length_mm = 12.0 * p.radius_mm;
                (p.branch_angle_deg, p.branch_share, p.roll_deg) = (branch_angle_deg, branch_share, roll_deg);
            },
            fork_errors,
        );
    }
}

#[test]
fn helices() {
    check(
        Kind::Helix,
        |p| {
            p.ring_radius_mm = 4.0 * p.radius_mm;
            p.pitch_mm = 5.0 * p.radius_mm;
            p.turns = 1.5;
        },
        |_, _| Vec::new(),
    );
}
