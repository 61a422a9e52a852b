//! Known answers on trees made by hand.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use espalier_model::{Branches, Grid, Node, Region, Sphere, Volume, Voxels};
use glam::DVec3;

use super::*;

fn node(position: [f64; 3], radius_mm: f64, parent: Option<usize>) -> Node {
    Node { position_mm: DVec3::from_array(position), radius_mm, parent, kind: 0 }
}

fn tree(nodes: &[Node]) -> Tree {
    Tree::new(nodes).expect("a tree")
}

fn plain() -> MeasureContext<'static> {
    MeasureContext { stenosis_percent: 25.0, ..MeasureContext::default() }
}

#[track_caller]
fn near(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-9 * expected.abs().max(1.0), "{found}, not {expected}");
}

/// A trunk up z that forks into one branch straight on with a bend, and one at 60 degrees which forks again.
fn sample() -> Tree {
    let (sin, cos) = (0.75_f64.sqrt(), 0.5);
    let out = |s: f64| [s * sin, 0.0, 20.0 + s * cos];
    tree(&[
        node([0.0, 0.0, 0.0], 3.0, None),
        node([0.0, 0.0, 10.0], 2.0, Some(0)),
        node([0.0, 0.0, 20.0], 2.0, Some(1)),
        // Straight on, then sideways: 10 + 10 mm.
        node([0.0, 0.0, 30.0], 1.5, Some(2)),
        node([0.0, 10.0, 30.0], 1.5, Some(3)),
        // At 60 degrees.
        node(out(12.0), 1.0, Some(2)),
        node([out(12.0)[0], 5.0, out(12.0)[2]], 0.5, Some(5)),
        node([out(12.0)[0], -5.0, out(12.0)[2]], 0.5, Some(5)),
    ])
}

#[test]
fn a_tree_by_hand() {
    let tree = sample();
    let anatomy = measure(&tree, &plain());
    let [trunk, bent, tilted, left, right] = anatomy.branches.as_slice() else { panic!("five branches") };
    let shape = |b: &BranchMeasures| (b.parent, b.generation, b.strahler, b.n_tips, b.start_node, b.end_node);
    assert_eq!(shape(trunk), (None, 0, 2, 3, 0, 2));
    assert_eq!(shape(bent), (Some(0), 1, 1, 1, 2, 4));
    assert_eq!(shape(tilted), (Some(0), 1, 2, 2, 2, 5));
    assert_eq!(shape(right), (Some(2), 2, 1, 1, 5, 7));
    assert_eq!((trunk.children.clone(), tilted.children.clone()), (vec![1, 2], vec![3, 4]));

    near(bent.length_mm, 20.0);
    near(bent.chord_mm, 200.0_f64.sqrt());
    near(bent.tortuosity(), 2.0_f64.sqrt());
    near(left.start_from_root_mm, 32.0);
    near(anatomy.branches.iter().map(|branch| branch.length_mm).sum(), tree.length_mm());

    // Half of the trunk tapers from 3 to 2.
    near(trunk.radius_mean_mm, 2.25);
    near(trunk.volume_mm3, PI / 3.0 * 10.0 * 19.0 + PI * 40.0);
    near(trunk.surface_mm2, PI * 5.0 * 101.0_f64.sqrt() + PI * 40.0);
    assert_eq!((trunk.radius_min_mm, trunk.radius_max_mm), (2.0, 3.0));
    // The branch at 60 degrees begins with its own radius, not with the trunk's.
    assert_eq!((tilted.radius_mean_mm, tilted.radius_max_mm, tilted.taper), (1.0, 1.0, 0.0));
    near(tilted.radius_to_parent, 1.0 / 2.25);

    near(tilted.branching_angle_deg, 60.0);
    near(bent.branching_angle_deg, 0.0);
    near(bent.sibling_angle_deg, 60.0);
    near(left.branching_angle_deg, 90.0);
    near(left.sibling_angle_deg, 180.0);
    assert!(trunk.branching_angle_deg.is_nan() && trunk.sibling_angle_deg.is_nan());
}

#[test]
fn taper_is_the_slope() {
    let nodes: Vec<Node> = (0..5_u32)
        .map(|i| {
            node([f64::from(i * i), 0.0, 0.0], 9.0 - 0.5 * f64::from(i * i), (i as usize).checked_sub(1))
        })
        .collect();
    near(measure(&tree(&nodes), &plain()).branches[0].taper, 0.5);
}

#[test]
fn directions_are_measured_outside_of_the_fork() {
    // The branch first follows the trunk inside of the fork's sphere, then leaves at a right angle.
    let tree = tree(&[
        node([0.0, 0.0, -30.0], 4.0, None),
        node([0.0, 0.0, 0.0], 4.0, Some(0)),
        node([0.0, 0.0, 3.0], 2.0, Some(1)),
        node([20.0, 0.0, 3.0], 2.0, Some(2)),
        node([0.0, 20.0, 0.0], 2.0, Some(1)),
    ]);
    let measured = measure(&tree, &plain()).branches;
    near(measured[1].branching_angle_deg, 90.0);
    near(measured[1].sibling_angle_deg, 90.0);
}

#[test]
fn generations_are_summed_up() {
    let anatomy = measure(&sample(), &plain());
    let [zeroth, first, second] = anatomy.generations.as_slice() else { panic!("three generations") };
    assert_eq!((zeroth.n_branches, zeroth.n_terminal), (1, 0));
    assert_eq!((first.n_branches, first.n_terminal, second.n_terminal), (2, 1, 2));
    near(first.length_mm.mean, 16.0);
    near(first.length_mm.sd, 32.0_f64.sqrt());
    near(first.branching_angle_deg.mean, 30.0);
    assert!(zeroth.length_mm.sd.is_nan() && zeroth.branching_angle_deg.mean.is_nan());
    let text = anatomy.generations_tsv();
    assert!(text.lines().nth(1).expect("a row").starts_with("0\t1\t0\t20.00000\t"), "{text}");
}

/// A straight vessel with a node every mm and these radii, which forks at `fork_mm` if that is given.
fn vessel(radii: &[f64]) -> Tree {
    let nodes: Vec<Node> = radii
        .iter()
        .enumerate()
        .map(|(i, &radius)| node([0.0, 0.0, -(i as f64)], radius, i.checked_sub(1)))
        .collect();
    tree(&nodes)
}

#[test]
fn a_narrow_place_is_found_with_its_grade() {
    let mut radii = vec![2.0; 61];
    radii[28..=32].copy_from_slice(&[1.8, 1.4, 1.0, 1.4, 1.8]);
    let anatomy = measure(&vessel(&radii), &plain());
    let [found] = anatomy.stenoses.as_slice() else { panic!("{:?}", anatomy.stenoses) };
    assert_eq!((found.branch, found.node), (0, 30));
    assert_eq!(found.position_mm, DVec3::new(0.0, 0.0, -30.0));
    near(found.narrowing_percent, 50.0);
    assert_eq!((found.radius_mm, found.reference_radius_mm), (1.0, 2.0));
    near(anatomy.profile[30].narrowing_percent, 50.0);
    assert_eq!(anatomy.profile.len(), 61);
    // What radii are not known to is no finding.
    let coarse = MeasureContext { resolution_mm: 1.1, ..plain() };
    assert_eq!(measure(&vessel(&radii), &coarse).stenoses, []);
}

#[test]
fn tapers_steps_and_tips_are_not_narrow() {
    let taper: Vec<f64> = (0..60).map(|i| 3.0 - 0.04 * f64::from(i)).collect();
    let step: Vec<f64> = (0..60).map(|i| if i < 30 { 4.0 } else { 2.0 }).collect();
    let widening: Vec<f64> = taper.iter().rev().copied().collect();
    for radii in [taper, step, widening] {
        assert_eq!(measure(&vessel(&radii), &plain()).stenoses, []);
    }
    // Far beyond any lesion a vessel may be as wide as it was.
    let mut long = vec![1.0; 100];
    long[0..10].fill(2.0);
    long[90..100].fill(2.0);
    assert_eq!(measure(&vessel(&long), &plain()).stenoses, []);
}

#[test]
fn a_stenosis_before_a_fork_is_one_finding_and_forks_are_none() {
    // A trunk of radius 3, narrowed to 1.2 at 20 mm; the fork's sphere is wider than all; both daughters have 2.
    let radius = |z: f64| if (z - 20.0).abs() < 3.0 { 1.2 + 0.6 * (z - 20.0).abs() } else { 3.0 };
    let mut nodes: Vec<Node> = (0..=40_u32)
        .map(|i| node([0.0, 0.0, f64::from(i)], radius(f64::from(i)), (i as usize).checked_sub(1)))
        .collect();
    nodes[40].radius_mm = 5.0;
    for side in [-1.0, 1.0] {
        let mut parent = 40;
        for i in 1..=20 {
            nodes.push(node([side * f64::from(i), 0.0, 40.0 + f64::from(i)], 2.0, Some(parent)));
            parent = nodes.len() - 1;
        }
    }
    let found = measure(&tree(&nodes), &plain()).stenoses;
    assert_eq!(found.len(), 1, "{found:?}");
    near(found[0].narrowing_percent, 60.0);
    near(found[0].reference_radius_mm, 3.0);
}

#[test]
fn areas_come_from_the_nearest_cross_section() {
    let sphere = |z: f64, area_radius_mm: f64| Sphere {
        center_mm: DVec3::new(0.1, 0.0, z),
        radius_mm: 1.0,
        distance_mm: 1.0,
        area_radius_mm,
        wall_mm: 0.0,
        is_cut: false,
    };
    let spheres = InscribedSpheres(vec![sphere(-0.4, 1.5), sphere(-0.1, f64::NAN), sphere(-5.0, 9.0)]);
    let context = MeasureContext { spheres: Some(&spheres), ..plain() };
    let profile = measure(&vessel(&[1.0, 1.0, 1.0, 1.0]), &context).profile;
    let areas: Vec<f64> = profile.iter().map(|row| row.area_radius_mm).collect();
    assert_eq!(areas[..2], [1.5, 1.5]);
    assert!(areas[2].is_nan() && areas[3].is_nan());
}

#[test]
fn labels_by_majority_else_by_nearness() {
    // Another grid than any mask's: 2 mm voxels, x and y mirrored. Label 7 for z in 0..20, 9 above.
    let affine = glam::DAffine3::from_cols(
        DVec3::new(-2.0, 0.0, 0.0),
        DVec3::new(0.0, -2.0, 0.0),
        DVec3::new(0.0, 0.0, 2.0),
        DVec3::new(9.0, 9.0, 1.0),
    );
    let grid = Grid::new([10, 10, 20], affine).expect("a grid");
    let values = (0..grid.n_voxels()).map(|index| if grid.voxel(index)[2] < 10 { 7 } else { 9 }).collect();
    let array = ndarray::Array3::from_shape_vec((20, 10, 10), values).expect("an array");
    let names = BTreeMap::from([(7, "lower".to_owned())]);
    let map = LabelMap {
        volume: Volume::new(grid, Voxels::U8(array), 1.0, 0.0),
        names,
        colors: BTreeMap::from([(7, [1, 2, 3])]),
        reach_mm: 5.0,
    };
    let context = MeasureContext { labels: Some(&map), ..plain() };
    let region = |from: [f64; 3], to: [f64; 3]| {
        measure(&tree(&[node(from, 1.0, None), node(to, 1.0, Some(0))]), &context).branches[0].region.clone()
    };
    let lower = |share| Some(Region { label: 7, name: "lower".to_owned(), color: Some([1, 2, 3]), share });
    assert_eq!(region([0.0, 0.0, 12.0], [0.0, 0.0, 22.0]), lower(0.8));
    assert_eq!(
        region([0.0, 0.0, 18.0], [0.0, 0.0, 38.0]).map(|r| (r.label, r.name)),
        Some((9, "9".to_owned()))
    );
    // Outside, 3 mm beside the lower end; then out of reach.
    assert_eq!(region([13.0, 0.0, 5.0], [13.0, 0.0, 15.0]), lower(0.0));
    assert_eq!(region([30.0, 0.0, 5.0], [30.0, 0.0, 15.0]), None);
}

#[test]
fn odd_trees_are_measured_too() {
    let single = measure(&tree(&[node([1.0, 2.0, 3.0], 0.0, None)]), &plain());
    assert_eq!((single.branches.len(), single.profile.len(), single.generations.len()), (0, 0, 0));
    // A star without radii, one branch of which returns to where it began.
    let star = tree(&[
        node([0.0; 3], 0.0, None),
        node([1.0, 0.0, 0.0], 0.0, Some(0)),
        node([0.0, 1.0, 0.0], 0.0, Some(1)),
        node([0.0; 3], 0.0, Some(2)),
        node([0.0, 0.0, 1.0], 0.0, Some(0)),
        node([0.0, 0.0, -1.0], 0.0, Some(0)),
    ]);
    let anatomy = measure(&star, &plain());
    assert_eq!(anatomy.branches.len(), 3);
    assert!(anatomy.branches[0].tortuosity().is_nan());
    near(anatomy.branches[1].sibling_angle_deg, 90.0);
    assert_eq!(anatomy.stenoses, []);
    assert!(!anatomy.branches_tsv().contains("NaN") && !anatomy.profiles_tsv().contains("NaN"));
}

#[test]
fn a_long_chain_of_forks_is_no_problem() {
    let mut nodes = vec![node([0.0; 3], 1.0, None)];
    let mut stem = 0;
    for i in 1..20_000_u32 {
        nodes.push(node([f64::from(i), 1.0, 0.0], 0.1, Some(stem)));
        nodes.push(node([f64::from(i), 0.0, 0.0], 1.0, Some(stem)));
        stem = nodes.len() - 1;
    }
    let tree = tree(&nodes);
    let anatomy = measure(&tree, &plain());
    let branches: Branches = tree.branches();
    assert_eq!(anatomy.branches.len(), branches.list().len());
    assert_eq!(anatomy.branches[0].n_tips + anatomy.branches[1].n_tips, tree.n_tips());
}
